"""The scene of a crash: contact forces against momentum and histories, tape against WAD."""

from typing import Any

import numpy as np
import pytest

from models.criteria.units import STANDARD_GRAVITY
from models.protocol import Run, Scene
from models.registry import load_model

METHODS = ("multibody", "planar", "facet")


@pytest.fixture(scope="module", params=METHODS)
def run(request: pytest.FixtureRequest) -> Run:
    # Without dive the diving car is the car at rest.
    return load_model(request.param).run({"dive_angle": 0.0, "impact_speed": 11.0})


def scene_of(run: Run) -> Any:
    assert isinstance(run.scene, Scene)
    assert run.scene.forces is not None
    return run.scene


def test_the_head_s_arrow_is_the_recorded_force(run: Run) -> None:
    scene = scene_of(run)
    head = scene.names.index("head")
    history = run.histories["head"]
    force = np.linalg.norm(scene.forces.force[:, head], axis=1)
    until = scene.time < min(history.time[-1], 0.2)
    recorded = np.interp(scene.time[until], history.time, history.channels["car_force"])
    assert recorded.max() > 1000.0
    np.testing.assert_allclose(force[until], recorded, rtol=1e-6, atol=1.0)


def test_the_car_s_forces_change_the_body_s_momentum(run: Run) -> None:
    scene = scene_of(run)
    time, mass = scene.time, run.inputs["body_mass"]
    # The impact on the car: nothing but a foot touches the road.
    end = int(np.searchsorted(time, 0.15))
    centre = run.histories["centre_of_gravity"]
    speed = {k: np.gradient(centre.channels[k], centre.time) for k in "xz"}
    total = scene.forces.force[:end].sum(axis=1)
    impulse = np.trapezoid(total, time[:end], axis=0)
    for k, axis in ((0, "x"), (2, "z")):
        first, last = (np.interp(t, centre.time, speed[axis]) for t in (2e-4, time[end - 1]))
        gained = mass * (last - first)
        gained += mass * STANDARD_GRAVITY * time[end - 1] if axis == "z" else 0.0
        assert impulse[k] == pytest.approx(gained, abs=0.06 * mass * 11.0), axis


def test_arrows_begin_on_the_surface_of_what_they_push(run: Run) -> None:
    scene = scene_of(run)
    place = scene.forces.place[:, : len(scene.names)]
    shown = np.isfinite(place).all(axis=2)
    assert shown.any()
    f, i = np.nonzero(shown)
    w, x, y, z = scene.orientation[f, i].T
    away = place[f, i] - scene.centre[f, i]
    # Into the segment's axes, by q* v q.
    axis = np.stack([-x, -y, -z], axis=1)
    twice = 2.0 * np.cross(axis, away)
    local = away + w[:, None] * twice + np.cross(axis, twice)
    size = np.linalg.norm(local / scene.semi_axes[i], axis=1)
    # Facets act on joints' caps and beside ellipsoids too.
    assert np.quantile(np.abs(size - 1.0), 0.8) < 0.05
    assert size.max() < 3.0


def test_the_tape_is_as_long_as_the_wrap_around_distance(run: Run) -> None:
    tape = scene_of(run).tape
    assert tape[0, 2] == 0.0
    assert np.ptp(tape[:, 1]) == 0.0
    length = np.linalg.norm(np.diff(tape, axis=0), axis=1).sum()
    assert length == pytest.approx(run.outputs["wad"], abs=1e-6)


def test_a_head_that_meets_no_car_leaves_no_tape() -> None:
    run = load_model("multibody").run({"impact_speed": 2.0, "lateral_offset": -0.95})
    assert np.isnan(run.outputs["wad"])
    assert scene_of(run).tape is None
