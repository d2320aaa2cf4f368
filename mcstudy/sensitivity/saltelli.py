"""Saltelli's design: base points and copies in which one input or group is exchanged.

SALib lays the design; a *dummy* input rides along. It nudges all inputs by a ten-thousandth of
their range: an output that follows its inputs smoothly does not feel it, a chaotic one does. The
dummy's total index is thus the share of the variance that no input explains, and the noise line of
every ranking.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy import seeds

Array = NDArray[np.float64]

DUMMY = "dummy"
"""Name of the input that stands for none."""
NUDGE = 1e-4
"""By how much of its range in probability the dummy moves an input (assumed)."""
_TURN = 0.6180339887498949
"""Share of a turn between the nudges of two inputs (golden ratio: no two go together)."""


@dataclass(frozen=True)
class Saltelli:
    """A design in the unit cube.

    Attributes
    ----------
    uniforms : (n * block, d) of the inputs, the dummy's nudge applied.
    factors : names of what is exchanged, inputs or groups, the dummy last.
    block : rows of one base point.
    """

    uniforms: Array
    factors: tuple[str, ...]
    block: int


def factors_of(inputs: Sequence[str], groups: Mapping[str, Sequence[str]]) -> tuple[str, ...]:
    """Return what is exchanged: groups at the place of their first input, single inputs, dummy."""
    member = {name: group for group, names in groups.items() for name in names}
    return tuple(dict.fromkeys([member.get(name, name) for name in inputs] + [DUMMY]))


def block_size(factors: Sequence[str], *, second_order: bool) -> int:
    """Return the rows of one base point."""
    return (2 if second_order else 1) * len(factors) + 2


def draw_saltelli(
    inputs: Sequence[str],
    groups: Mapping[str, Sequence[str]],
    n: int,
    seed: int,
    *,
    second_order: bool = False,
) -> Saltelli:
    """Return Saltelli's design.

    Parameters
    ----------
    inputs : d names. groups : names of inputs by group.
    n : base points, a power of two; the design for n is the first half of that for 2 n.
    seed : of the scramble. second_order : whether to add the rows that second order takes.
    """
    from SALib.sample import sobol

    member = {name: group for group, names in groups.items() for name in names}
    names = [*inputs, DUMMY]
    problem = {
        "num_vars": len(names),
        "names": names,
        "bounds": [[0.0, 1.0]] * len(names),
        "groups": [member.get(name, name) for name in names],
    }
    with warnings.catch_warnings():
        # The design starts where the sequence starts; it is scrambled.
        warnings.simplefilter("ignore")
        rows = sobol.sample(
            problem,
            n,
            calc_second_order=second_order,
            seed=seeds.generator(seed, seeds.SALTELLI),
        )
    factors = factors_of(inputs, groups)
    turns = rows[:, -1:] + _TURN * np.arange(len(inputs))
    nudged = rows[:, :-1] + NUDGE * np.sin(2.0 * np.pi * turns)
    # Reflected at the borders of the cube.
    nudged = np.abs(nudged)
    nudged = 1.0 - np.abs(1.0 - nudged)
    return Saltelli(nudged, factors, block_size(factors, second_order=second_order))
