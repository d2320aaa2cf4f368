"""three.js as the package trimesh ships it.

trimesh, which reads the meshes anyway, carries three.js with its trackball controls in the page of
its own viewer (0.7 MB). k3d's script takes 2.6 MB, plotly's 4.8 MB, and meshcat's, 0.9 MB with
three.js inside, has a scene protocol of its own but no curves.
"""

import functools
import io
import zipfile

from trimesh import resources

BEGIN, END = "<script>", "var camera,controls,scene"
"""Text before the library in trimesh's page, and the first words of its own program after it."""


@functools.cache
def three_js() -> str:
    """Return the script that defines ``THREE`` with ``TrackballControls``.

    Raises
    ------
    RuntimeError
        If trimesh's page is not as expected; another version of trimesh mends it.
    """
    archive = zipfile.ZipFile(io.BytesIO(resources.get_bytes("templates/viewer.zip")))
    page = archive.read(archive.namelist()[0]).decode("utf-8")
    begin, end = page.find(BEGIN), page.find(END)
    if begin < 0 or end < begin or "TrackballControls" not in page[begin:end]:
        raise RuntimeError("the viewer page of trimesh has changed: install the locked version")
    # The page is a template, in which a dollar sign stands twice.
    return page[begin + len(BEGIN) : end]
