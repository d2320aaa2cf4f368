"""Before anything runs in parallel: compile once, so that no worker compiles what another does."""

import shutil
from collections.abc import Iterator
from typing import Any

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
ARGUMENTS = ["--no-sandbox", "--enable-unsafe-swiftshader"]


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile the kernels of every model in the process that starts the workers."""
    if getattr(session.config.option, "numprocesses", None):
        from models.registry import load_model, model_names

        for name in model_names():
            model = load_model(name)
            # A crash of minutes is for the slow tier.
            if model.cost < 10.0:
                model.run({})


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    if CHROMIUM is None:
        pytest.skip("no Chromium: apt install chromium")
    playwright = pytest.importorskip("playwright.sync_api", reason="no Playwright: make install")
    with playwright.sync_playwright() as driver:
        found = driver.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield found
        found.close()
