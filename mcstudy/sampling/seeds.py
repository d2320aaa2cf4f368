"""Random streams that are a pure function of the study's seed and an index.

No stream is ever spawned from another, so a resumed or extended study draws the same numbers.
"""

import numpy as np

DESIGN = 0
BOOTSTRAP = 1
SALTELLI = 2
GIVEN_DATA = 3
MORRIS = 4
OUTCOME = 5
AGREEMENT = 6
PERTURBATION = 7
EVIDENCE = 8


def generator(seed: int, stream: int, index: int = 0) -> np.random.Generator:
    """Return the generator of one item of a named stream.

    Parameters
    ----------
    seed : int
        Of the study.
    stream : int
        One of the constants above.
    index : int
        Of the item within the stream.
    """
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(stream, index)))
