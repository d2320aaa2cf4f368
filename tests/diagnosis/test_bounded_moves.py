"""Moves of a fit that are bounded in length: badly known directions are cut first."""

import numpy as np
import pytest

from mcstudy.diagnosis.normal_equations import NormalEquations, Scores


def equations() -> NormalEquations:
    rng = np.random.default_rng(3)
    own = [rng.normal(size=(30, 2)) for _ in range(4)]
    shared = [rng.normal(size=(30, 3)) * [10.0, 1.0, 0.02] for _ in range(4)]
    return NormalEquations(own, shared)


def test_a_short_move_is_left_alone() -> None:
    move = Scores(np.array([0.1, -0.2, 0.3]), (np.ones(2),) * 4)
    assert equations().within(move, 1.0) is move


def test_a_long_move_is_cut_along_what_the_data_know_badly() -> None:
    move = Scores(np.array([0.5, 0.5, 6.0]), (np.zeros(2),) * 4)
    held = equations().within(move, 1.5)
    assert np.abs(held.shared).max() == pytest.approx(1.5, rel=1e-3)
    assert held.shared[0] == pytest.approx(0.5, rel=0.05)
    assert held.shared[1] == pytest.approx(0.5, rel=0.2)


def test_nuisances_follow_the_shared_latents() -> None:
    """Beside given shared latents the nuisances of the move are the most probable ones."""
    rng = np.random.default_rng(4)
    own = [rng.normal(size=(20, 2))]
    shared = [rng.normal(size=(20, 1))]
    residual = rng.normal(size=20) + 9.0 * shared[0][:, 0]
    system = NormalEquations(own, shared)
    start = Scores(np.zeros(1), (np.zeros(2),))
    held = system.within(system.solve([residual], start).move, 2.0)
    rest = residual - shared[0] @ held.shared
    expected = np.linalg.solve(np.eye(2) + own[0].T @ own[0], own[0].T @ rest)
    assert held.own[0] == pytest.approx(expected)
