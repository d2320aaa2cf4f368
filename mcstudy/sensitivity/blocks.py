"""Runs of a design that comes in blocks: base points of Saltelli's, trajectories of Morris's.

A block is whole or it is lost: an index is a mean over differences within blocks, and dropping
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
    """Return outputs by block, and which blocks each output may use.

    Parameters
    ----------
    outputs : (n * block, m). complete : (n * block,) runs that did not fail.
    block : rows of a block.

    Returns
    -------
    cube : (n, block, m)
    kept : (n, m), true where the block has no failed run and a finite value in every row.
    """
    cube = outputs.reshape(-1, block, outputs.shape[1])
    whole = np.asarray(complete.reshape(-1, block).all(axis=1))
    return cube, np.asarray(np.isfinite(cube).all(axis=1)) & whole[:, None]


def is_enough(kept: Flags) -> bool:
    """Tell whether so many of an output's (n,) blocks are kept that it gets an index."""
    return int(kept.sum()) >= max(MIN_BLOCKS, (1.0 - MAX_DROPPED) * kept.size)


def outputs_alike(kept: Flags) -> Iterator[tuple[Flags, NDArray[np.intp]]]:
    """Yield (n,) blocks and the outputs that use exactly them, so that they share one estimate."""
    for pattern in np.unique(kept, axis=1).T:
        yield pattern, np.flatnonzero((kept == pattern[:, None]).all(axis=0))
