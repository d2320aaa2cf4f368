"""Pages whose errors and requests are reported."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

Opener = Callable[..., Any]


@pytest.fixture
def opened(browser: Any, tmp_path: Path) -> Iterator[Opener]:
    """Open pages from the disk; at the end none may have erred or asked for anything."""
    contexts, wrong = [], []

    def open_page(html: str, place: str = "", *, width: int = 1280, dark: bool = False) -> Any:
        file = tmp_path / f"page{len(contexts)}.html"
        file.write_text(html, encoding="utf-8")
        context = browser.new_context(
            viewport={"width": width, "height": 900}, color_scheme="dark" if dark else "light"
        )
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda m: wrong.append(m.text) if m.type == "error" else None)
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on(
            "request",
            lambda asked: None if asked.url == page.url.split("#")[0] or asked.url == file.as_uri()
            or asked.url.startswith(("about:", "blob:", "data:")) else wrong.append(asked.url),
        )  # fmt: skip
        page.goto(file.as_uri() + (f"#{place}" if place else ""))
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert wrong == []
