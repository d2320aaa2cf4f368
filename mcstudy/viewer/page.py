"""The pages of viewer and explorer."""

import json
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

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
    content = {"title": title, "runs": [pack_run(run) for run in runs]}
    return render_page("viewer", title, content, styles=("viewer.css",), library=three_js())


def render_page(
    name: str,
    title: str,
    content: Mapping[str, Any],
    *,
    styles: Sequence[str],
    library: str = "",
) -> str:
    """Return a page from its template, style and program, with its content inside.

    Parameters
    ----------
    name : str
        Of template and program.
    title : str
    content : mapping
        What the program shows, JSON-able.
    styles : sequence of str
        Files of the style.
    library : str
        Script that the program uses.
    """
    folder = files("mcstudy.viewer")
    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string(folder.joinpath(f"{name}.html").read_text("utf-8"))
    return template.render(
        title=title,
        style="\n".join(folder.joinpath(style).read_text("utf-8") for style in styles),
        library=library.replace("</script", "<\\/script"),
        program="\n".join(
            folder.joinpath(script).read_text("utf-8") for script in ("content.js", f"{name}.js")
        ),
        # Text of users must not end the script that holds it.
        content=json.dumps(content).replace("<", "\\u003c"),
    )
