"""Where compiled kernels are kept: with and without a home that can be written."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from models.compilation import digest_of

CODE = "from models import compilation; import numba; print(numba.config.CACHE_DIR)"
# Of a user without an entry pathlib finds no home.
HOMELESS = """import pathlib
def no_home(): raise RuntimeError('Could not determine home directory.')
pathlib.Path.home = no_home
"""
PLACES = ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "HOME")


def imported(code: str = CODE, **environment: str) -> tuple[Path, str]:
    """Import the compilation in a fresh process; return its cache and what it says."""
    kept = {key: value for key, value in os.environ.items() if key not in PLACES}
    done = subprocess.run(
        [sys.executable, "-c", code], env=kept | environment, capture_output=True, text=True,
        timeout=120, check=True,
    )  # fmt: skip
    return Path(done.stdout.strip()), done.stderr


def test_the_users_cache_is_taken_in_silence(tmp_path: Path) -> None:
    cache, told = imported(XDG_CACHE_HOME=str(tmp_path))
    assert (cache.parent, told) == (tmp_path / "mcstudy", "")


@pytest.mark.parametrize("place", ["file", "/dev/null/none"])
def test_a_cache_that_cannot_be_written_is_replaced_with_one_line(
    tmp_path: Path, place: str
) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "temporary").mkdir()
    wanted, other = str(tmp_path / place), tmp_path / "temporary"
    cache, told = imported(XDG_CACHE_HOME=wanted, TMPDIR=str(other))
    assert cache.parent == other
    (line,) = told.splitlines()
    assert line.startswith("mcstudy: ") and "cannot be written" in line


def test_without_a_home_the_temporary_folder_is_taken(tmp_path: Path) -> None:
    cache, told = imported(HOMELESS + CODE, TMPDIR=str(tmp_path))
    assert cache.parent == tmp_path and "there is no home folder" in told


PLAIN = b"def double(x):\n    return 2.0 * x\n\nRATE = 3.0\n"


@pytest.mark.parametrize(
    "same",
    [
        b'"""What."""\n\n# Why.\ndef double(x):\n    "Two."\n    return 2.0 * x\nRATE = 3.0\n',
        b"def double(x):\n    return (2.0\n            * x)\n\n\n\nRATE=3.0",
        PLAIN + b'"""Of what, and its source."""\n',
    ],
)  # fmt: skip
def test_comments_docstrings_and_layout_compile_nothing_anew(same: bytes) -> None:
    assert digest_of([PLAIN]) == digest_of([same])


@pytest.mark.parametrize(
    "other", [PLAIN.replace(b"2.0", b"2.5"), PLAIN.replace(b"3.0", b"4.0"), PLAIN + b"X = 1\n"]
)
def test_any_other_edit_does(other: bytes) -> None:
    assert digest_of([PLAIN]) != digest_of([other])


@pytest.mark.slow
def test_a_comment_in_a_kernels_file_loads_the_cached_code(tmp_path: Path) -> None:
    # A copy of the package, so that its file can be edited.
    shutil.copytree(Path(__file__).parents[2] / "models", tmp_path / "models",
                    ignore=shutil.ignore_patterns("__pycache__"))  # fmt: skip
    code = (
        "from models.criteria.filters import filter_cfc, _there_and_back as kernel\n"
        "filter_cfc([0.0, 1.0, 0.0], 10000.0)\n"
        "print(sum(kernel.stats.cache_hits.values()), sum(kernel.stats.cache_misses.values()))"
    )

    def counts() -> str:
        environment = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
        return subprocess.run(
            [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True,
            env=environment | {"XDG_CACHE_HOME": str(tmp_path), "PYTHONPATH": str(tmp_path)},
        ).stdout.strip()  # fmt: skip

    assert counts() == "0 1"
    source = tmp_path / "models" / "criteria" / "filters.py"
    source.write_text("# A remark.\n\n" + source.read_text())
    assert counts() == "1 0"
    source.write_text(source.read_text().replace("SETTLED = 1e-3", "SETTLED = 2e-3"))
    assert counts() == "0 1"
