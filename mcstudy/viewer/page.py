"""The page of the viewer."""

import json
from collections.abc import Sequence
from importlib.resources import files

from jinja2 import Environment

from mcstudy.viewer.content import ViewedRun, pack_run
from mcstudy.viewer.library import three_js


def render_viewer(title: str, runs: Sequence[ViewedRun]) -> str:
    """Return an HTML page that shows runs in three dimensions, without a network.

    Parameters
    ----------
    title : str
    runs : sequence of ViewedRun
        At least one; the first one is solid, the others are ghosts over it or stand beside it.
    """
    folder = files("mcstudy.viewer")
    parts = {name: folder.joinpath(name).read_text("utf-8") for name in ("viewer.css", "viewer.js")}
    content = json.dumps({"title": title, "runs": [pack_run(run) for run in runs]})
    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string(folder.joinpath("viewer.html").read_text("utf-8"))
    return template.render(
        title=title,
        style=parts["viewer.css"],
        library=three_js().replace("</script", "<\\/script"),
        program=parts["viewer.js"],
        # Text of users must not end the script that holds it.
        content=content.replace("<", "\\u003c"),
    )
