"""BrIC against hand-computed values."""

import math

import numpy as np
import pytest

from models.criteria import brain_injury_criterion


@pytest.mark.parametrize(
    ("axis", "critical", "quotient"), [(0, 66.25, 1.03), (1, 56.45, 1.20), (2, 42.87, 1.59)]
)
def test_rotation_about_one_axis(axis: int, critical: float, quotient: float) -> None:
    # Critical values of Takhounts et al. 2013 (average of CSDM and MPS); the quotients of 68 rad/s
    # are printed in the data sheet, 2.2.
    velocity = np.zeros((50, 3))
    velocity[:, axis] = 68.0 * np.sin(np.linspace(0.0, math.pi, 50)) ** 2
    velocity[20, axis] = 68.0
    value = brain_injury_criterion(velocity)
    assert value == pytest.approx(68.0 / critical, rel=1e-12)
    assert value == pytest.approx(quotient, abs=0.005)


def test_peaks_need_not_be_simultaneous_and_their_sign_does_not_matter() -> None:
    velocity = np.zeros((10, 3))
    velocity[2, 0], velocity[5, 1], velocity[8, 2] = -66.25, 56.45, -42.87
    assert brain_injury_criterion(velocity) == pytest.approx(math.sqrt(3.0), rel=1e-12)
    assert brain_injury_criterion(-velocity[::-1]) == pytest.approx(math.sqrt(3.0), rel=1e-12)


def test_criterion_is_proportional_to_the_velocity() -> None:
    velocity = np.random.default_rng(2).normal(0.0, 30.0, (200, 3))
    one = brain_injury_criterion(velocity)
    assert brain_injury_criterion(2.5 * velocity) == pytest.approx(2.5 * one, rel=1e-12)


@pytest.mark.parametrize("shape", [(3,), (10, 2), (10, 3, 1), (3, 10)])
def test_wrong_shape_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="shape"):
        brain_injury_criterion(np.zeros(shape))
