"""Runs of block designs: base points of Saltelli's design, trajectories of Morris's.

A block is used whole or not at all: an index is a mean over differences within blocks, and dropping
single rows would pair runs that do not belong together.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

MAX_DROPPED = 0.2
"""Share of blocks that an output may lose before it gets no index (assumed)."""
MIN_BLOCKS = 8
"""Blocks below which no index is given (assumed)."""


def whole_blocks(outputs: Array, complete: Flags, block: int) -> tuple[Array, Flags]:
    """Return outputs by block, and the usable blocks of each output.

    Parameters
    ----------
    outputs : (n * block, m) array
    complete : (n * block,) array of bool
        Runs that did not fail.
    block : int
        Rows of a block.

    Returns
    -------
    cube : (n, block, m) array
    kept : (n, m) array of bool
        True where the block has no failed run and a finite value in every row.
    """
    cube = outputs.reshape(-1, block, outputs.shape[1])
    whole = np.asarray(complete.reshape(-1, block).all(axis=1))
    return cube, np.asarray(np.isfinite(cube).all(axis=1)) & whole[:, None]


def is_enough(kept: Flags) -> bool:
    """Return whether enough of an output's (n,) blocks are kept for an index."""
    return int(kept.sum()) >= max(MIN_BLOCKS, (1.0 - MAX_DROPPED) * kept.size)


def outputs_alike(kept: Flags) -> Iterator[tuple[Flags, NDArray[np.intp]]]:
    """Yield each pattern of kept blocks (n,) with the outputs that share it."""
    for pattern in np.unique(kept, axis=1).T:
        yield pattern, np.flatnonzero((kept == pattern[:, None]).all(axis=0))
