"""Reports: hostile text is shown and never obeyed, nothing comes from outside, all is there."""

import base64
import io
import re
from collections.abc import Sequence
from html.parser import HTMLParser

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from mcstudy.figures import crash
from mcstudy.report import Section, Table, render

HOSTILE = "<script>alert('1')</script>\" onload=\"alert(2) & {{ 7 * 7 }} {% raw %} </title></style>"


class Document(HTMLParser):
    """The tags, attributes and text of a page."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str, str]] = []
        self.text: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: Sequence[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += [(tag, name, value or "") for name, value in attrs]

    def handle_data(self, data: str) -> None:
        self.text.append(data)

    def values(self, name: str) -> list[str]:
        return [value for _, key, value in self.attributes if key == name]


def picture() -> Figure:
    time = np.linspace(0.0, 0.1, 50)
    return crash.draw_history(time, {"head": time}, ylabel="head acceleration [g]", until=0.1)


def test_hostile_text_is_shown_and_never_obeyed_and_nothing_comes_from_outside() -> None:
    table = Table(HOSTILE, [HOSTILE, "mean [m]"], [[HOSTILE, "1.0"], ["", HOSTILE]])
    section = Section(HOSTILE, [HOSTILE], [table], {HOSTILE: picture()}, {HOSTILE: b"GIF89a"})
    page = render(HOSTILE, HOSTILE, [section, Section("last")])
    document = Document(page)
    assert not {"link", "script", "iframe", "object", "embed"} & set(document.tags)
    assert not [name for _, name, _ in document.attributes if name.startswith("on")]
    assert "<script" not in page
    assert "49" not in "".join(document.text)
    # Title twice, subtitle, link, heading, paragraph; a table's caption, head and two cells; two
    # figures' captions.
    assert "".join(document.text).count(HOSTILE) == 12
    assert document.values("alt") == [HOSTILE, HOSTILE]
    assert document.tags.count("title") == document.tags.count("style") == 1
    text = re.sub(r"base64,[A-Za-z0-9+/=]*", "", page)
    assert len(text) < len(page) / 2
    assert not re.search(r"https?:|//[a-z]|@import|url\(", text)
    for tag, name, value in document.attributes:
        if name in ("src", "href", "srcset", "data", "action"):
            assert value.startswith("data:image/" if tag == "img" else "#")


def test_report_holds_tables_figures_and_animations() -> None:
    animation, frame = io.BytesIO(), Image.new("P", (4, 4))
    frame.save(animation, format="GIF", save_all=True, append_images=[frame])
    table = Table("Outputs", ["output", "mean"], [["wad", "1.32 (1.30 to 1.34)"], ["hic15", "–"]])
    section = Section("Result", ["One line.", "Another."], [table], {"A figure.": picture()},
                      {"A film.": animation.getvalue()})  # fmt: skip
    document = Document(render("Title", "Subtitle", [section]))
    assert {"Title", "Subtitle", "Result", "One line.", "Another.", "Outputs", "output", "wad",
            "1.32 (1.30 to 1.34)", "–", "A figure.", "A film."} <= {
        part.strip() for part in document.text}  # fmt: skip
    sources = document.values("src")
    first, second = (base64.b64decode(source.split("base64,")[1]) for source in sources)
    assert Image.open(io.BytesIO(first)).format == "PNG"
    assert second == animation.getvalue()
    assert sources[1].startswith("data:image/gif;")
    assert set(document.values("href")) == {f"#{mark}" for mark in document.values("id")}
    assert render("Title", "", []).startswith("<!DOCTYPE html>")


def test_heads_of_columns_of_numbers_stand_above_them() -> None:
    rows = [["wad", "1.32", "", "2 of 3"], ["hic15", "–", "few", "1 of 3"]]
    table = Table("Outputs", ["output", "mean", "target", "met"], rows)
    document = Document(render("Title", "Subtitle", [Section("Result", [], [table])]))
    styled = [(tag, value) for tag, name, value in document.attributes if name == "class"]
    heads = [value for tag, value in styled if tag == "th"]
    assert heads == ["number", "number"]
    assert styled.count(("td", "number")) == 4
