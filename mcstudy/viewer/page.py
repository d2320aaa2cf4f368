"""The pages of viewer and explorer."""

import json
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

from jinja2 import Environment

from mcstudy.viewer.library import three_js
from mcstudy.viewer.packing import pack_text

MARK = "@content@"
"""Place of the content in a page without any."""


def render_viewer(title: str, runs: Sequence[Mapping[str, Any]]) -> str:
    """Return an HTML page that shows runs in three dimensions, without a network.

    Parameters
    ----------
    title : str
    runs : sequence of mapping
        At least one, each from ``pack_run``; the first one is solid, the others are ghosts over it
        or stand beside it.
    """
    return viewer_shell(title).replace(MARK, _as_text({"runs": list(runs)}))


def viewer_shell(title: str) -> str:
    """Return the viewer's page with ``MARK`` in place of its content.

    Parameters
    ----------
    title : str
    """
    # A title of users could hold the mark.
    title = title.replace(MARK, "")
    return _render("viewer", title, MARK, styles=("viewer.css",), library=pack_text(three_js()))


def render_page(name: str, title: str, content: Mapping[str, Any], *, styles: Sequence[str]) -> str:
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
    """
    return _render(name, title, _as_text(content), styles=styles)


def _as_text(content: Mapping[str, Any]) -> str:
    # Text of users must not end the script that holds it.
    return json.dumps(content).replace("<", "\\u003c")


def _render(
    name: str, title: str, content: str, *, styles: Sequence[str], library: str = ""
) -> str:
    folder = files("mcstudy.viewer")
    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string(folder.joinpath(f"{name}.html").read_text("utf-8"))
    return template.render(
        title=title,
        style="\n".join(folder.joinpath(style).read_text("utf-8") for style in styles),
        library=library,
        program="\n".join(
            folder.joinpath(script).read_text("utf-8") for script in ("content.js", f"{name}.js")
        ),
        content=content,
    )
