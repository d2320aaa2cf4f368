"""Numba settings shared by every compiled kernel.

Numba's own disk cache notices a change in the file of the compiled function only, not in the
kernels that it calls. The cache folder is therefore named after a digest of all sources of this
package: any edit gives a fresh cache, an unchanged installation never recompiles.
"""

import hashlib
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba


def _source_digest() -> str:
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def _usable(folder: Path) -> bool:
    """Return whether a folder is there, or can be made, and can be written."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
        # Compiled code that somebody else may have put there is not run.
        return not hasattr(os, "getuid") or folder.stat().st_uid == os.getuid()
    except OSError:
        return False


def _cache_folder() -> Path | None:
    """Return the folder of compiled kernels: in the user's cache, else in the temporary folder.

    None if neither can be written: the kernels are compiled anew in every process then.
    """
    name = f"kernels-{_source_digest()}"
    try:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    except RuntimeError:
        # Neither HOME nor an entry among the users, as in containers.
        wanted = None
    else:
        wanted = base / "mcstudy" / name
        if _usable(wanted):
            return wanted
    user = os.getuid() if hasattr(os, "getuid") else "user"
    why = "there is no home folder" if wanted is None else f"{wanted} cannot be written"
    try:
        other = Path(tempfile.gettempdir()) / f"mcstudy-{user}-{name}"
    except OSError:
        other = None
    if other is not None and _usable(other):
        print(f"mcstudy: {why}: compiled kernels are kept in {other}", file=sys.stderr)
        return other
    print(f"mcstudy: {why}: kernels are compiled anew in every process", file=sys.stderr)
    return None


_CACHED = True
if "NUMBA_CACHE_DIR" not in os.environ:
    _folder = _cache_folder()
    _CACHED = _folder is not None
    if _folder is not None:
        numba.config.CACHE_DIR = str(_folder)  # type: ignore[attr-defined]
        if _folder.name.startswith("mcstudy-"):
            # Worker processes take it over and say nothing.
            os.environ["NUMBA_CACHE_DIR"] = str(_folder)


def _compile(function: Callable[..., Any], inline: bool) -> Callable[..., Any]:
    flags: dict[str, Any] = {
        "cache": _CACHED,
        "error_model": "numpy",
        "fastmath": {"contract"},
        "forceinline": inline,
        "_nrt": False,
    }
    compiled: Callable[..., Any] = numba.njit(**flags)(function)
    return compiled


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function in nopython mode, cached on disk.

    Kernels allocate nothing, so Numba's reference counting is left out: counting the arrays of the
    named tuples at every call cost ten times the arithmetic. Of fast-math only the fusing of a
    product and a sum is allowed: it is decided when the code is compiled, so a batch row gives the
    same bits in every process.
    """
    return _compile(function, inline=False)


def inlined_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile like ``kernel`` and merge the code into its callers.

    For what the step loop calls: handing a named tuple of arrays to a function that is not merged
    copies some hundred words.
    """
    return _compile(function, inline=True)
