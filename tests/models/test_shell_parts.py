"""What holds shells: gaps that keep a dent, stops; their forces and the energy they book."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from models.compilation import kernel
from models.shells.parts import Gaps, Supports, apply_gaps, apply_supports
from models.shells.state import Nodes

STIFFNESS, CLEARANCE = 2e5, 0.01


def one_node() -> Nodes:
    return Nodes(
        position=np.zeros((1, 3)), velocity=np.zeros((1, 3)), spin=np.zeros((1, 3)),
        force=np.zeros((1, 3)), moment=np.zeros((1, 3)), mass=np.ones(1), inertia=np.ones(1),
        held=np.zeros((1, 6), dtype=np.bool_),
    )  # fmt: skip


@kernel
def press(nodes, start, gaps, path, force, taken):
    """Move the node along z and fill the forces (k,) on it and the energies taken in (k,)."""
    for k in range(path.shape[0]):
        nodes.position[0, 2] = path[k]
        nodes.force[0, 2] = 0.0
        taken[k] = apply_gaps(nodes, start, gaps, 0, gaps.upper.shape[0])
        force[k] = nodes.force[0, 2]


@settings(max_examples=40, deadline=None)
@given(
    depths=st.lists(st.floats(0.0, 0.05), min_size=1, max_size=5), ratio=st.floats(1.0, 20.0)
)  # fmt: skip
def test_a_gap_takes_in_the_work_that_is_done_on_it(depths: list[float], ratio: float) -> None:
    gaps = Gaps(
        upper=np.zeros(1, dtype=np.int64), lower=np.full(1, -1), clearance=np.full(1, CLEARANCE),
        stiffness=np.full(1, STIFFNESS), unloading=np.full(1, ratio), deepest=np.zeros(1),
        normal=np.array([[0.0, 0.0, 1.0]]),
    )  # fmt: skip
    # Down to each depth and back to the start.
    turns = np.concatenate([[0.0], *([-depth, 0.0] for depth in depths)])
    path = np.concatenate([np.linspace(a, b, 4000) for a, b in pairwise(turns)])
    force, taken = np.zeros(len(path)), np.zeros(len(path))
    press(one_node(), np.zeros((1, 3)), gaps, path, force, taken)
    work = -np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(path))])
    np.testing.assert_allclose(taken, work, atol=1e-3 * max(float(taken.max()), 1e-9))
    deepest = max(max(depths) - CLEARANCE, 0.0)
    assert force.max() == pytest.approx(STIFFNESS * deepest, rel=1e-9, abs=1e-9)
    # What is left at the end: the part that unloading does not give back.
    lost = 0.5 * STIFFNESS * deepest**2 * (1.0 - 1.0 / ratio)
    assert taken[-1] == pytest.approx(lost, rel=1e-9, abs=1e-12)


def test_a_stop_carries_pressure_only() -> None:
    supports = Supports(
        node=np.zeros(2, dtype=np.int64), rest=np.zeros((2, 3)),
        stiffness=np.array([1e5, 2e5]), stop=np.array([True, False]),
        normal=np.array([[0.0, 0.0, 1.0]] * 2),
    )  # fmt: skip
    for z, expected in ((-0.01, 3e3), (0.01, -2e3)):
        nodes = one_node()
        nodes.position[0, 2] = z
        stored = apply_supports(nodes, supports, 0, 2)
        assert nodes.force[0, 2] == pytest.approx(expected)
        assert stored == pytest.approx(0.5 * abs(expected * z))
