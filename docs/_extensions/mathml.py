"""Equations as MathML, which browsers draw without any script or font from elsewhere."""

import re
from typing import Any

from latex2mathml.converter import convert
from sphinx.application import Sphinx

BOLD = re.compile(r'<(mi|mn) mathvariant="bold[a-z-]*">(&#x[0-9A-F]+;|.)</\1>')
STARTS = {"a": 0x1D482, "A": 0x1D468, "α": 0x1D736, "0": 0x1D7CE}
"""First bold characters of Unicode by the first letter of a row: browsers know no bold variant."""


def visit_inline(self: Any, node: Any) -> None:
    """Write an equation in a line."""
    self.body.append(mathml_of(node.astext(), "inline"))


def visit_display(self: Any, node: Any) -> None:
    """Write an equation on a line of its own."""
    self.body.append(f'<div class="equation">{mathml_of(node.astext(), "block")}</div>')


def mathml_of(text: str, display: str) -> str:
    """Return LaTeX as MathML."""
    return BOLD.sub(_bold, convert(text, display=display))


def _bold(match: re.Match[str]) -> str:
    letter = chr(int(match[2][3:-1], 16)) if match[2].startswith("&") else match[2]
    for first, start in STARTS.items():
        if 0 <= ord(letter) - ord(first) < 26 and letter.isalnum():
            return f"<{match[1]}>{chr(start + ord(letter) - ord(first))}</{match[1]}>"
    return match[0]


def depart(self: Any, node: Any) -> None:
    """Write nothing: the node is written when it is visited."""


def leave_out_text(visit: Any) -> Any:
    """Return a visitor that does not go on to the node's text."""

    def visited(self: Any, node: Any) -> None:
        from docutils.nodes import SkipNode

        visit(self, node)
        raise SkipNode

    return visited


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderer."""
    app.add_html_math_renderer(
        "mathml",
        (leave_out_text(visit_inline), depart),
        (leave_out_text(visit_display), depart),
    )
    return {"parallel_read_safe": True, "parallel_write_safe": True}
