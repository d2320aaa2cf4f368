"""Arrays packed into text for a page: whole steps, differences, shuffled bytes, deflate, base64."""

import base64
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

KINDS = ("f4", "i4", "i2", "u4", "u1")
"""Types of numbers that a page reads, little-endian."""


class Packer:
    """Arrays of one part of a page, each held once; ``data`` is their text.

    Smooth histories are stored as whole multiples of a step and as differences from row to row:
    with their bytes sorted by significance, deflate finds little left.
    """

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._places: dict[bytes, int] = {}
        self._size = 0

    def add(self, values: NDArray[Any], kind: str = "f4", step: float = 0.0) -> dict[str, Any]:
        """Hold an array and return its place, JSON-able, for the page's program.

        Parameters
        ----------
        values : array
            Its rows are those of its first axis.
        kind : str
            One of ``KINDS``.
        step : float
            Unit of which whole multiples are stored, for a kind of signed whole numbers; NaN is
            kept. 0 stores the values themselves.

        Raises
        ------
        ValueError
            If a value is too large for kind and step.
        """
        width = int(np.prod(values.shape[1:])) if values.ndim > 1 else 1
        table = np.asarray(values).reshape(-1, width) if values.size else np.empty((0, width))
        held = _steps(table, kind, step) if step else _plain(table, kind)
        shuffled = held.view("u1").reshape(-1, held.dtype.itemsize).T.tobytes()
        key = kind.encode() + shuffled
        if key not in self._places:
            self._places[key] = self._size
            self._parts.append(shuffled)
            self._size += len(shuffled)
        return {"at": self._places[key], "count": int(table.size), "kind": kind,
                "width": width, "step": step}  # fmt: skip

    def data(self) -> str:
        """Return the text of all arrays."""
        return _pack(b"".join(self._parts))


def pack_text(text: str) -> str:
    """Return a text, deflated, as base64.

    Parameters
    ----------
    text : str
    """
    return _pack(text.encode("utf-8"))


def _pack(held: bytes) -> str:
    return base64.b64encode(zlib.compress(held, 9)).decode("ascii")


def _plain(table: NDArray[Any], kind: str) -> NDArray[Any]:
    # Numbers beyond single precision become infinite, which the pages leave out.
    with np.errstate(over="ignore", invalid="ignore"):
        return np.ascontiguousarray(table, dtype="<" + kind).ravel()


def _steps(table: NDArray[Any], kind: str, step: float) -> NDArray[Any]:
    """Return differences of whole multiples; the smallest number of the kind stands for NaN."""
    limits = np.iinfo("<" + kind)
    whole = np.round(table / step)
    gone = ~np.isfinite(table)
    if (np.abs(whole[~gone]) > limits.max).any():
        raise ValueError(
            f"values up to {np.nanmax(np.abs(table)):g} have no {kind} in steps {step:g}"
        )
    whole[gone] = limits.min
    held = whole.astype("<" + kind)
    held[1:] = np.diff(held, axis=0)
    return np.ascontiguousarray(held).ravel()
