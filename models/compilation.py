"""Numba settings shared by every compiled kernel.

Numba's own disk cache detects a change only in the file of the compiled function, not in the
kernels that it calls, and it compiles again when a line above the function moves. The cache folder
is therefore named after a digest of the code of this package without comments, docstrings and line
numbers: only an edit of the code starts a fresh cache.
"""

import ast
import contextlib
import hashlib
import os
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import IndexDataCacheFile


def _without_docstrings(tree: ast.AST) -> ast.AST:
    """Return a tree without docstrings, those below constants included."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            node.body = [line for line in node.body if not _is_text(line)]
    return tree


def _is_text(line: ast.stmt) -> bool:
    """Return whether a statement is a text alone."""
    return (
        isinstance(line, ast.Expr)
        and isinstance(line.value, ast.Constant)
        and isinstance(line.value.value, str)
    )


def digest_of(sources: Sequence[bytes]) -> str:
    """Return a digest of the code of Python sources; comments and docstrings do not change it."""
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sources:
        digest.update(ast.dump(_without_docstrings(ast.parse(source))).encode())
    return digest.hexdigest()[:16]


def _package_digest(base: Path) -> str:
    """Return the digest of this package's code, cached by a digest of the files' bytes."""
    sources = [path.read_bytes() for path in sorted(Path(__file__).parent.rglob("*.py"))]
    whole = hashlib.sha256(numba.__version__.encode() + b"".join(sources)).hexdigest()[:16]
    kept = base / "mcstudy" / "sources" / whole
    with contextlib.suppress(OSError):
        return kept.read_text()
    found = digest_of(sources)
    if is_usable(kept.parent):
        # A process that reads it at the same time sees no file or the complete one.
        with tempfile.NamedTemporaryFile("w", dir=kept.parent, delete=False) as file:
            file.write(found)
        Path(file.name).replace(kept)
    return found


def is_usable(folder: Path) -> bool:
    """Return whether a folder exists or can be created, and is writable."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
        # Compiled code that another user may have put there is not run.
        return not hasattr(os, "getuid") or folder.stat().st_uid == os.getuid()
    except OSError:
        return False


def user_cache() -> Path | None:
    """Return the user's cache folder, or None if no home folder can be found."""
    try:
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    except RuntimeError:
        return None


def _cache_folder() -> Path | None:
    """Return the folder of compiled kernels: in the user's cache, else in the temporary folder.

    None if neither is writable: the kernels are then compiled again in every process.
    """
    name = f"kernels-{_DIGEST}"
    wanted = None if _BASE is None else _BASE / "mcstudy" / name
    if wanted is not None and is_usable(wanted):
        return wanted
    user = os.getuid() if hasattr(os, "getuid") else "user"
    why = "there is no home folder" if wanted is None else f"{wanted} cannot be written"
    try:
        other = Path(tempfile.gettempdir()) / f"mcstudy-{user}-{name}"
    except OSError:
        other = None
    if other is not None and is_usable(other):
        print(f"mcstudy: {why}: compiled kernels are kept in {other}", file=sys.stderr)
        return other
    print(f"mcstudy: {why}: kernels are compiled anew in every process", file=sys.stderr)
    return None


_BASE = user_cache()
_DIGEST = _package_digest(_BASE or Path(tempfile.gettempdir()))
_CACHED = True
if "NUMBA_CACHE_DIR" not in os.environ:
    _folder = _cache_folder()
    _CACHED = _folder is not None
    if _folder is not None:
        numba.config.CACHE_DIR = str(_folder)  # type: ignore[attr-defined]
        if _folder.name.startswith("mcstudy-"):
            # Worker processes inherit the folder and print no message.
            os.environ["NUMBA_CACHE_DIR"] = str(_folder)


MERGED_FLAGS: Any = {
    "error_model": "numpy",
    "fastmath": {"contract"},
    "forceinline": True,
    "_nrt": False,
}
"""Numba flags of functions that are inlined into a kernel without being kernels."""


def _compile(
    function: Callable[..., Any], *, inline: bool = False, fuse: bool = True
) -> Callable[..., Any]:
    flags: dict[str, Any] = {
        "cache": _CACHED,
        "error_model": "numpy",
        "fastmath": {"contract"} if fuse else False,
        "forceinline": inline,
        "_nrt": False,
        "no_cfunc_wrapper": True,
        # A run of a minute can be watched from another thread.
        "nogil": True,
    }
    compiled: Any = numba.njit(**flags)(function)
    if _CACHED:
        # The cache key is the code, not the file's date or the line of the function.
        place = f"{function.__module__}.{function.__qualname__}"
        file: Callable[..., Any] = IndexDataCacheFile
        compiled._cache._cache_file = file(compiled._cache.cache_path, place, _DIGEST)
    dispatcher: Callable[..., Any] = compiled
    return dispatcher


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function in nopython mode, cached on disk.

    Kernels allocate nothing, so Numba's reference counting is left out: counting the arrays of the
    named tuples at every call cost ten times the arithmetic. Of the fast-math options only the
    contraction of a product and a sum (fused multiply-add) is allowed: it is decided at compile
    time, so a batch row gives the same bits in every process.
    """
    return _compile(function)


def inlined_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile like ``kernel`` and inline the code into its callers.

    Used for what the step loop calls: passing a named tuple of arrays to a function that is not
    inlined copies some hundred words.
    """
    return _compile(function, inline=True)


def unfused_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile like ``kernel`` with every product rounded: the same bits as the NumPy expression."""
    return _compile(function, fuse=False)
