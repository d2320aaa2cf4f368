"""The manual's commands and code blocks: run in order, so that what it says works.

A page is Markdown. ``console`` blocks hold commands after ``$ `` and below each some lines of what
it prints, with ``...`` for what is left out; ``python`` blocks are run in one namespace a page;
``toml`` blocks with a caption are files. ``make docs`` runs all pages in one folder, takes their
figures from it, and builds the manual.
"""

import contextlib
import io
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from joblib.externals.loky import get_reusable_executor

from studies import cli

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
PAGES = (
    "first_study", "own_accident", "sensitivity", "injuries", "posterior", "own_car",
    "headform_corridors", "diagnosis",
)  # fmt: skip
"""Pages with commands, in the order in which they are run: later ones use earlier results."""
FENCE = re.compile(r"(?ms)^```(?:\{code-block\} )?(\w+)\n((?::\w+:[^\n]*\n)*)\n?(.*?)^```$")
FIGURE = re.compile(r"(?m)^!\[[^\]]*\]\(_figures/([^)]+)\)$")


@dataclass(frozen=True)
class Block:
    """A block of a page: line it begins at, language, caption (a file's name), text."""

    line: int
    language: str
    caption: str
    text: str


def blocks_of(page: str) -> list[Block]:
    """Return the fenced blocks of a page.

    Parameters
    ----------
    page : str
        Name of the page.
    """
    text = (DOCS / f"{page}.md").read_text(encoding="utf-8")
    found = []
    for match in FENCE.finditer(text):
        caption = re.search(r":caption: (.*)", match[2])
        line = text.count("\n", 0, match.start()) + 1
        found.append(Block(line, match[1], caption[1].strip() if caption else "", match[3]))
    return found


def figures_of(page: str) -> list[str]:
    """Return the figures that a page shows, as places below the folder in which it is run.

    Parameters
    ----------
    page : str
        Name of the page.
    """
    return FIGURE.findall((DOCS / f"{page}.md").read_text(encoding="utf-8"))


def run_page(page: str, folder: Path) -> None:
    """Run the blocks of a page.

    Parameters
    ----------
    page : str
        Name of the page.
    folder : Path
        Where files and results go; ``configs`` of the project is there too.

    Raises
    ------
    AssertionError
        If a command fails or does not print what the page shows.
    """
    if not (folder / "configs").exists():
        (folder / "configs").symlink_to(ROOT / "configs")
    # Workers that are still there look for files where they were started.
    get_reusable_executor().shutdown(wait=True)
    namespace: dict[str, object] = {}
    with contextlib.chdir(folder):
        for block in blocks_of(page):
            place = f"docs/{page}.md, line {block.line}"
            if block.caption:
                Path(block.caption).write_text(block.text, encoding="utf-8")
            elif block.language == "console":
                _run_commands(block.text, place)
            elif block.language == "python":
                exec(compile(block.text, place, "exec"), namespace)
            elif block.language not in ("toml", "text"):
                raise AssertionError(f"{place}: a block of {block.language} is not run")


def _run_commands(text: str, place: str) -> None:
    """Run the commands of a block and compare what they print."""
    for part in re.split(r"(?m)^\$ ", text)[1:]:
        command, _, expected = part.partition("\n")
        code, printed = _run(shlex.split(command))
        if code != 0:
            raise AssertionError(f"{place}: {command!r} ended with {code}:\n{printed[-2000:]}")
        compare_output(expected, printed, f"{place}: {command!r}")


def _run(words: Sequence[str]) -> tuple[int, str]:
    """Return exit code and output of a command of the product, run in this process."""
    if words[0] != "mcstudy":
        raise AssertionError(f"{words[0]!r}: the manual's commands are those of mcstudy")
    out = io.StringIO()
    held = sys.argv
    sys.argv = list(words)
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            cli.main()
    except SystemExit as end:
        return int(end.code or 0), out.getvalue()
    finally:
        sys.argv = held
    return 0, out.getvalue()


def compare_output(expected: str, printed: str, place: str) -> None:
    """Check that the lines shown are printed in this order; ``...`` stands for any text.

    Parameters
    ----------
    expected : str
        As shown.
    printed : str
        By the command.
    place : str
        Of the command, for the message.

    Raises
    ------
    AssertionError
        With the line that is not printed.
    """
    rest = " ".join(printed.split())
    for line in expected.splitlines():
        words = " ".join(line.split()).removeprefix("... ").removesuffix(" ...")
        if words in ("", "..."):
            continue
        pattern = ".*?".join(re.escape(piece) for piece in words.split("..."))
        found = re.search(pattern, rest)
        if found is None:
            raise AssertionError(f"{place}: does not print {line!r}, but\n{printed[-3000:]}")
        rest = rest[found.end() :]


def take_figures(folder: Path) -> None:
    """Copy the figures that the pages show from the folder in which the pages were run.

    Parameters
    ----------
    folder : Path
    """
    target = DOCS / "_figures"
    shutil.rmtree(target, ignore_errors=True)
    for page in PAGES:
        for name in figures_of(page):
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(folder / name, target / name)


def main() -> None:
    """Run all pages, take their figures, and build the manual into ``docs/_build/html``."""
    folder = DOCS / "_build" / "run"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for page in PAGES:
        print(f"running docs/{page}.md", flush=True)
        run_page(page, folder)
    take_figures(folder)
    html = DOCS / "_build" / "html"
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", str(DOCS), str(html)]
    code = subprocess.run(command, check=False).returncode
    if code == 0:
        print(f"manual: {html / 'index.html'}")
    raise SystemExit(code)


if __name__ == "__main__":
    main()
