"""The manual: every command and every block of it works, and it builds without a warning."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from scripts.manual import DOCS, PAGES, ROOT, blocks_of, compare_output, figures_of, run_page

SLOW = tuple(page for page in PAGES if page not in ("first_study", "headform_corridors"))
"""Pages for the slow tier; `make docs` runs all of them."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("manual")


@pytest.mark.parametrize(
    "page", [pytest.param(p, marks=pytest.mark.slow) if p in SLOW else p for p in PAGES]
)
def test_what_a_page_says_works(page: str, folder: Path) -> None:
    assert any(block.language == "console" for block in blocks_of(page))
    run_page(page, folder)
    figures = figures_of(page)
    assert figures
    for figure in figures:
        assert (folder / figure).exists(), figure


def test_every_page_with_a_command_is_run() -> None:
    for file in DOCS.glob("*.md"):
        if "```console" in file.read_text(encoding="utf-8"):
            assert file.stem in PAGES, file


def test_lines_that_are_not_printed_are_found() -> None:
    compare_output("a ... c\n... d ...", "x a b\n c\n y d z", "here")
    with pytest.raises(AssertionError, match="does not print 'e'"):
        compare_output("a\ne", "a\nb", "here")
    with pytest.raises(AssertionError, match="does not print 'a'"):
        compare_output("b\na", "a\nb", "here")


def test_it_builds_without_a_warning_and_loads_nothing_from_elsewhere(tmp_path: Path) -> None:
    # Its figures are made by `make docs`.
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q",
               "-D", "suppress_warnings=image.not_readable", "-d", tmp_path / "trees",
               DOCS, tmp_path / "html"]  # fmt: skip
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    pages = list((tmp_path / "html").glob("*.html"))
    assert len(pages) > 15
    for page in pages:
        html = page.read_text(encoding="utf-8")
        assert not re.search(r'<(?:script|img|iframe)[^>]+src="https?:', html), page.name
        assert not re.search(r'<link[^>]+rel="stylesheet"[^>]+https?:', html), page.name
    assert "<math" in (tmp_path / "html" / "theory_core.html").read_text(encoding="utf-8")
