"""Factors of a design: single inputs, groups of inputs, and a dummy.

The *dummy* stands for no input. It perturbs all of them by a ten-thousandth of their range: a
smooth output does not respond, a chaotic one does. The dummy's index is thus the model's noise
floor and the noise line of every ranking.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DUMMY = "dummy"
"""Name of the factor that stands for no input."""
PERTURBATION = 1e-4
"""Perturbation of an input by the dummy, in probability (assumed)."""
_TURN = 0.6180339887498949
"""Phase between the perturbations of two inputs, in turns (golden ratio: none coincide)."""


def factors_of(inputs: Sequence[str], groups: Mapping[str, Sequence[str]]) -> tuple[str, ...]:
    """Return the factors: groups at the place of their first input, single inputs, dummy."""
    return tuple(dict.fromkeys([*_memberships(inputs, groups), DUMMY]))


def salib_problem(
    inputs: Sequence[str], groups: Mapping[str, Sequence[str]]
) -> dict[str, int | list[str] | list[list[float]]]:
    """Return SALib's description of the unit cube of the inputs and the dummy."""
    names = [*inputs, DUMMY]
    return {
        "num_vars": len(names),
        "names": names,
        "bounds": [[0.0, 1.0]] * len(names),
        "groups": [*_memberships(inputs, groups), DUMMY],
    }


def perturbed(uniforms: Array, dummy: Array) -> Array:
    """Return the (n, d) uniforms perturbed by the (n,) dummy, reflected at the borders."""
    turns = dummy[:, None] + _TURN * np.arange(uniforms.shape[1])
    moved = np.abs(uniforms + PERTURBATION * np.sin(2.0 * np.pi * turns))
    return np.asarray(1.0 - np.abs(1.0 - moved))


def _memberships(inputs: Sequence[str], groups: Mapping[str, Sequence[str]]) -> list[str]:
    member = {name: group for group, names in groups.items() for name in names}
    return [member.get(name, name) for name in inputs]
