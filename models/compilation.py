"""Numba settings shared by every compiled kernel.

Numba's own disk cache notices a change in the file of the compiled function only, not in the
kernels that it calls. The cache folder is therefore named after a digest of all sources of this
package: any edit gives a fresh cache, an unchanged installation never recompiles.
"""

import hashlib
import os
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


def _cache_folder() -> Path:
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = base / "mcstudy" / f"kernels-{_source_digest()}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        folder = Path(tempfile.gettempdir()) / f"mcstudy-kernels-{_source_digest()}"
        folder.mkdir(parents=True, exist_ok=True)
    return folder


if "NUMBA_CACHE_DIR" not in os.environ:
    numba.config.CACHE_DIR = str(_cache_folder())  # type: ignore[attr-defined]


def _compile(function: Callable[..., Any], inline: bool) -> Callable[..., Any]:
    flags: dict[str, Any] = {
        "cache": True,
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
