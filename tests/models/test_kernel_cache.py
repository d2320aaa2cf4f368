"""Where compiled kernels are kept: with and without a home that can be written."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

CODE = "from models import compilation; import numba; print(numba.config.CACHE_DIR)"


def imported(**environment: str | None) -> subprocess.CompletedProcess[str]:
    """Import the compilation in a fresh process; None takes a variable away."""
    base = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    chosen = {key: value for key, value in {**base, **environment}.items() if value is not None}
    return subprocess.run(
        [sys.executable, "-c", CODE], env=chosen, capture_output=True, text=True, timeout=120,
        check=True,
    )  # fmt: skip


def test_the_users_cache_is_taken_in_silence(tmp_path: Path) -> None:
    done = imported(XDG_CACHE_HOME=str(tmp_path))
    assert done.stderr == ""
    assert Path(done.stdout.strip()).parent == tmp_path / "mcstudy"


@pytest.mark.parametrize("how", ["a file stands there", "no such device"])
def test_a_cache_that_cannot_be_written_is_replaced_with_one_line(tmp_path: Path, how: str) -> None:
    other = tmp_path / "temporary"
    other.mkdir()
    wanted = tmp_path / "file"
    wanted.write_text("")
    place = str(wanted) if how == "a file stands there" else "/dev/null/none"
    done = imported(XDG_CACHE_HOME=place, TMPDIR=str(other))
    assert Path(done.stdout.strip()).parent == other
    (line,) = done.stderr.splitlines()
    assert line.startswith("mcstudy: ") and "cannot be written" in line


def test_without_a_home_the_temporary_folder_is_taken(tmp_path: Path) -> None:
    # Of a user without an entry pathlib finds no home.
    code = "import pathlib\n" \
           "def no_home(): raise RuntimeError('Could not determine home directory.')\n" \
           "pathlib.Path.home = no_home\n" + CODE  # fmt: skip
    kept = {k: v for k, v in os.environ.items()
            if k not in ("HOME", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR")}  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-c", code], env=kept | {"TMPDIR": str(tmp_path)}, capture_output=True,
        text=True, timeout=120, check=True,
    )  # fmt: skip
    assert Path(done.stdout.strip()).parent == tmp_path
    assert "there is no home folder" in done.stderr
