"""A browser that reports errors and requests, for the tests of pages."""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
ARGUMENTS = ["--no-sandbox", "--enable-unsafe-swiftshader"]
READY = "body[data-ready='1']"


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    if CHROMIUM is None:
        pytest.skip("no Chromium: apt install chromium")
    playwright = pytest.importorskip("playwright.sync_api", reason="no Playwright: make install")
    with playwright.sync_playwright() as driver:
        found = driver.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield found
        found.close()


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
