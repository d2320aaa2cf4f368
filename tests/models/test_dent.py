"""Where a deep contact's pressure acts, and what resists sliding in a dent, against integrals."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models.compilation import kernel
from models.contact.dent import PLOUGHING, ploughing_coefficient, pressure_share
from models.crash.surfaces import PLOUGHING as PLOUGHING_CHANNEL
from models.crash.surfaces import WORK_CHANNELS
from models.multibody.model import MultibodyModel


@kernel
def _share(flesh, dent, support):
    return pressure_share(flesh, dent, support)


@kernel
def _coefficient(A, support, dent, tx, ty, tz):
    return ploughing_coefficient(A, support, dent, tx, ty, tz)


def six(matrix: np.ndarray) -> tuple[float, ...]:
    return tuple(float(matrix[i, j]) for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)))


def cap(radius: float, depth: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return places (x, y) over a sphere's pressed patch and heights over the deepest point."""
    a = math.sqrt(2.0 * radius * depth - depth**2)
    grid = np.linspace(-a, a, 2001)
    x, y = np.meshgrid(grid, grid)
    inside = x**2 + y**2 <= a**2
    return x[inside], y[inside], radius - np.sqrt(radius**2 - x[inside] ** 2 - y[inside] ** 2)


@pytest.mark.parametrize("depth", [0.002, 0.01])
def test_an_even_pressure_acts_at_half_the_dent(depth: float) -> None:
    radius = 0.09
    _, _, height = cap(radius, depth)
    # A shallow cap is a paraboloid to depth over radius.
    assert _share(0.0, depth, radius) * radius == pytest.approx(
        height.mean(), rel=2.0 * depth / radius
    )


def test_flattened_flesh_lies_in_the_plane_of_contact() -> None:
    assert _share(0.012, 0.0, 0.04) == pytest.approx(0.3)
    # Never beyond the centre.
    assert _share(0.06, 0.05, 0.04) == 1.0


@pytest.mark.parametrize("depth", [0.0005, 0.004])
def test_ploughing_is_the_groove_over_the_loaded_half(depth: float) -> None:
    radius = 0.09
    x, _, _ = cap(radius, depth)
    a = x.max()
    cell = (2.0 * a / 2000.0) ** 2
    loaded = cell * np.count_nonzero(x > 0.0)
    across = np.linspace(-a, a, 4001)
    groove = np.trapezoid(np.sqrt(radius**2 - across**2) - (radius - depth), across)
    ours = _coefficient(six(np.eye(3) * radius**2), radius, depth, 1.0, 0.0, 0.0)
    assert ours == pytest.approx(groove / loaded, rel=2.0 * depth / radius + 1e-3)


def test_a_body_ploughs_by_its_curvature_along_the_slip() -> None:
    # At the pole of an ellipsoid the radius of curvature along an axis a is a^2 / c.
    a, b, c, depth = 0.16, 0.05, 0.04, 0.003
    turn = Rotation.random(random_state=3).as_matrix()
    A = six(turn @ np.diag([a * a, b * b, c * c]) @ turn.T)
    for axis, square in ((0, a * a), (1, b * b)):
        t = turn[:, axis]
        expected = PLOUGHING * math.sqrt(2.0 * depth * c / square)
        assert _coefficient(A, c, depth, *t) == pytest.approx(expected, rel=1e-12)


def test_ploughing_is_bounded_by_the_width_of_the_body() -> None:
    assert _coefficient(six(np.eye(3) * 0.01), 0.1, 0.5, 0.0, 1.0, 0.0) == pytest.approx(PLOUGHING)


def test_panels_plough_and_rolls_do_not() -> None:
    model = MultibodyModel()
    names = {zone.name: zone.ploughing for zone in model.vehicle.zones}
    assert {name for name, share in names.items() if share > 0.0} == {
        "hood", "fender_side", "windscreen",
    }  # fmt: skip
    run, without = model.run({}), model.run({"ploughing": 0.0})
    name = WORK_CHANNELS[PLOUGHING_CHANNEL]
    assert name == "ploughing"
    # It takes the body along with the car, and the balance of energy holds it.
    assert run.histories["work"].channels[name][0] > 5.0
    assert without.histories["work"].channels[name][0] == 0.0
    assert run.outputs["launch_speed"] > without.outputs["launch_speed"]
    assert abs(run.outputs["energy_residual"]) < 5e-3


def test_an_adult_is_taken_along_by_the_windscreen() -> None:
    adult = {"age": 30.0, "stature": 1.74, "body_mass": 75.7, "head_mass": 4.54,
             "running_speed": 1.4, "yaw_rate": 0.0, "lateral_offset": 0.0}  # fmt: skip
    model = MultibodyModel()
    launched = [
        [model.run({**adult, "ploughing": p, "gait_phase": g}).outputs["launch_speed"]
         for g in (0.0, 0.3, 0.6)]
        for p in (0.0, 1.0)
    ]  # fmt: skip
    assert np.mean(launched[1]) > 1.05 * np.mean(launched[0])
