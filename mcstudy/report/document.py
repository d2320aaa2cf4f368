"""A report as data, rendered to one self-contained HTML file."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files

from jinja2 import Environment
from matplotlib.figure import Figure

from mcstudy.figures.style import png_bytes

LONGEST = 32
"""Characters of a cell that is kept on one line."""
BEGINNINGS = tuple("–-0123456789")
"""First characters of a cell that is set as a number."""


@dataclass(frozen=True)
class Table:
    """A table: caption, head, rows of formatted text."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]

    @property
    def numbers(self) -> frozenset[int]:
        """Columns, the first one aside, of nothing but numbers: short, and they begin like one."""
        columns = [
            [row[k] for row in self.rows if k < len(row) and row[k]] for k in range(len(self.head))
        ]
        return frozenset(
            k
            for k, cells in enumerate(columns)
            if k and cells and all(len(c) <= LONGEST and c.startswith(BEGINNINGS) for c in cells)
        )


@dataclass(frozen=True)
class Section:
    """A section: heading, paragraphs, tables; figures, GIF files and HTML pages by caption.

    A page is shown in a frame of its own, with scripts that reach nothing outside it.
    """

    heading: str
    paragraphs: Sequence[str] = ()
    tables: Sequence[Table] = ()
    figures: Mapping[str, Figure] = field(default_factory=dict)
    animations: Mapping[str, bytes] = field(default_factory=dict)
    pages: Mapping[str, str] = field(default_factory=dict)


def render(title: str, subtitle: str, sections: Sequence[Section]) -> str:
    """Return the HTML of a report; all text is escaped.

    Parameters
    ----------
    title : str
    subtitle : str
    sections : sequence of Section
    """
    source = files("mcstudy.report").joinpath("template.html").read_text(encoding="utf-8")
    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    environment.globals["longest"] = LONGEST
    shown = [
        {
            "heading": section.heading,
            "paragraphs": section.paragraphs,
            "tables": section.tables,
            "pages": section.pages,
            "images": [
                (caption, "image/png", _encode(png_bytes(figure)))
                for caption, figure in section.figures.items()
            ]
            + [
                (caption, "image/gif", _encode(data))
                for caption, data in section.animations.items()
            ],
        }
        for section in sections
    ]
    return environment.from_string(source).render(title=title, subtitle=subtitle, sections=shown)


def _encode(data: bytes) -> str:
    return base64.b64encode(data).decode()
