"""Parts of the planar model against closed forms and the spatial model's own kernels."""

import ctypes
import math

import numpy as np
import pymunk
import pytest
from builders import GRAVITY, Array, quiet
from hypothesis import given
from hypothesis import strategies as st

from models.contact.road import Road
from models.crash.ellipsoids import Ellipsoids, build_ellipsoids
from models.multibody.joints import apply_joint_torques
from models.multibody.kinematics import update_kinematics
from models.multibody.setup import build_tree, place
from models.multibody.tree import empty_loads
from models.pedestrian.anthropometry import SEGMENTS, build_body
from models.pedestrian.joints import build_joints, elastic_energy
from models.pedestrian.posture import Posture, running_posture
from models.pedestrian.tissue import build_tissue
from models.planar.body import hold_in_plane, outline, surfaces_in_plane
from models.planar.chipmunk import EACH_BODY
from models.planar.joints import CELLS, joints_in_plane
from models.planar.space import PlanarSpace
from models.registry import load_model
from models.rotation import axis_rotation, matrix_of, multiply
from models.vehicle.profile import load_vehicle

BODY = build_body(7.5, 1.18, 21.8, 3.26)
JOINTS, TREE, N = build_joints(BODY), build_tree(BODY), len(SEGMENTS)


def posture_of(facing: float, phase: float = 0.3) -> Posture:
    return running_posture(BODY, gait_phase=phase, facing_angle=facing, running_speed=2.8)


def surfaces() -> Ellipsoids:
    zones = [zone.corridor.curve(0.5) for zone in load_vehicle("family_car_1990s").zones]
    return build_ellipsoids(BODY, build_tissue(BODY), zones)


def spatial_torques(orientation: Array) -> Array:
    """Return the joint torques (n,) about y of a body at rest, by the spatial model's kernel."""
    loads = empty_loads(N)
    motion = place(Posture(np.zeros(3), np.zeros(3), orientation, np.zeros((N, 3))))
    update_kinematics(TREE, motion)
    apply_joint_torques(TREE, JOINTS, motion, loads, np.zeros(2))
    return np.asarray(loads.joint_torque[:, 1])


@pytest.mark.parametrize("facing", [0.0, 0.9, math.pi / 2.0, -2.2])
def test_a_planar_joint_is_the_spatial_one_turning_about_y(facing: float) -> None:
    posture, grid = posture_of(facing), np.linspace(-math.pi, math.pi, CELLS + 1)
    plane = joints_in_plane(JOINTS, hold_in_plane(BODY, posture))
    for turn in (-0.5, -0.2, 0.0, 0.13, 0.45):
        # Every segment is turned by as many times the angle as it has joints above it.
        orientation, depth = posture.orientation.copy(), np.zeros(N)
        for i in range(1, N):
            depth[i] = depth[TREE.parent[i]] + 1.0
            orientation[i] = multiply(axis_rotation(1, -turn * depth[i]), orientation[i])
        found = np.array([np.interp(turn, grid, row) for row in plane.torque[1:]])
        # A stop's kink lies inside a cell of 1.4 degrees.
        expected = -spatial_torques(orientation)[1:]
        np.testing.assert_allclose(found, expected, rtol=0.02, atol=0.05)


def test_the_energy_of_a_joint_is_the_work_of_its_torque() -> None:
    # One component inside and beyond the range, integrated by hand from the law of the sheet.
    joints = JOINTS
    knee, stop = SEGMENTS.index("shank_left"), math.radians(10.0)
    assert joints.stiffness_high[knee, 1] == 0.0
    K, half = joints.stop_high[knee, 1], joints.half_range[knee, 1]
    for excess in (0.0, 0.1, stop, 0.3):
        inside = min(excess, stop)
        beyond = max(excess - stop, 0.0)
        work = K * (inside**3 / (6.0 * stop) + 0.5 * stop * beyond + 0.5 * beyond**2)
        found = elastic_energy(joints, knee, np.array([[0.0, half + excess, 0.0]]))
        assert found[0] == pytest.approx(work, rel=1e-12, abs=1e-12)


@quiet(30)
@given(facing=st.floats(-3.1, 3.1), phase=st.floats(0.0, 1.0))
def test_the_body_in_the_plane_keeps_mass_place_and_inertia(facing: float, phase: float) -> None:
    posture = posture_of(facing, phase)
    plane, motion = hold_in_plane(BODY, posture), place(posture)
    update_kinematics(TREE, motion)
    np.testing.assert_allclose(plane.centre, motion.centre[:, ::2], atol=1e-12)
    for i in range(N):
        R = matrix_of(posture.orientation[i])
        assert plane.inertia[i] == pytest.approx((R @ np.diag(BODY.inertia[i]) @ R.T)[1, 1])
        top = motion.centre[i, 2] + (R @ (BODY.ellipsoid[i] - BODY.centre[i]))[2]
        assert plane.centre[i, 1] + plane.offset[i, 1] == pytest.approx(top)
        p = plane.parent[i]
        if p >= 0:
            # Both sides of a joint move alike.
            one, two = (
                plane.velocity[k] + plane.spin[k] * np.array([-arm[1], arm[0]])
                for k in (p, i) for arm in (plane.joint[i] - plane.centre[k],)
            )  # fmt: skip
            np.testing.assert_allclose(one, two, atol=1e-12)


def test_along_the_plane_the_start_is_that_of_the_spatial_body() -> None:
    posture = posture_of(0.0)
    plane, motion = hold_in_plane(BODY, posture), place(posture)
    update_kinematics(TREE, motion)
    np.testing.assert_allclose(plane.velocity, motion.velocity[:, ::2], atol=1e-12)


def test_a_polygon_has_the_extent_of_the_shadow() -> None:
    plane = hold_in_plane(BODY, posture_of(0.7))
    for i in range(N):
        corners = np.array(outline(plane, i, 16)) - plane.offset[i]
        xx, xz, zz = plane.projection[i]
        form = np.linalg.inv(np.array([[xx, xz], [xz, zz]]))
        reach = np.sqrt(np.einsum("ki,ij,kj->k", corners, form, corners))
        np.testing.assert_allclose(reach, 1.0, atol=0.011)


def test_segments_that_are_apart_across_the_plane_pass_through_each_other() -> None:
    across, along = (
        surfaces_in_plane(
            surfaces(), hold_in_plane(BODY, posture_of(facing)), ("upper_arm", "forearm")
        )
        for facing in (math.pi / 2.0, 0.0)
    )
    legs = {i for i, name in enumerate(SEGMENTS) if name.startswith(("thigh", "shank", "foot"))}
    assert len(across.pairs) > len(along.pairs)
    assert set(across.pairs[:, :2].ravel().tolist()) <= legs
    for i, segment in enumerate(SEGMENTS):
        assert (across.surface_law[i, 0] < 0) == ("arm" in segment)
        assert across.surface_law[i, -1] >= 0


def flying(road: Road, height: float = 3.0) -> PlanarSpace:
    plane = hold_in_plane(BODY, posture_of(0.0))
    plane.centre[:, 1] += height
    plane.joint[:, 1] += height
    return PlanarSpace(plane, joints_in_plane(JOINTS, plane), road, surfaces(), 10.0)


def step(space: PlanarSpace, steps: int, length: float) -> None:
    """Step a space without loads, as the compiled loop does, through Pymunk's own interface."""
    for _ in range(steps):
        space.given[:N, :2] = space.state[:N, 3:5]
        link = space.link
        link.write_place[0] = 0
        _each(link.space, link.writer, link.write_data)
        space.space.step(length)
        link.read_place[0] = 0
        _each(link.space, link.reader, link.read_data)


def _each(space: int, function: int, data: int) -> None:
    kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p)
    kind(EACH_BODY.__wrapper_address__())(space, function, data)


def test_in_free_flight_the_centre_falls_and_the_spin_stays() -> None:
    space, plane = flying(Road(0.6)), hold_in_plane(BODY, posture_of(0.0))

    def momenta() -> Array:
        s, m = space.state[:N], BODY.mass
        centre, speed = m @ s[:, :2] / m.sum(), m @ s[:, 3:5] / m.sum()
        r, v = s[:, :2] - centre, s[:, 3:5] - speed
        spin = m @ (r[:, 0] * v[:, 1] - r[:, 1] * v[:, 0]) + plane.inertia @ s[:, 5]
        return np.array([*centre, *speed, spin])

    start = momenta()
    step(space, 2000, 1e-4)
    end = momenta()
    assert end[2] == pytest.approx(start[2], abs=1e-9)
    assert end[3] == pytest.approx(start[3] - GRAVITY * 0.2, abs=1e-9)
    assert end[0] == pytest.approx(start[0] + 0.2 * start[2], abs=1e-6)
    # Chipmunk's Euler steps lag by half a step: 0.2 s * 1e-4 s * g / 2.
    fall = start[1] + 0.2 * start[3] - 0.5 * GRAVITY * 0.2**2
    assert end[1] == pytest.approx(fall, abs=2e-4)
    assert end[4] == pytest.approx(start[4], abs=2e-3 * abs(start[4]) + 1e-3)


def test_a_slope_pulls() -> None:
    road, mass = Road(0.6, gravity_along=1.0, gravity_down=9.0), BODY.mass / BODY.mass.sum()
    space = flying(road)
    before = mass @ space.state[:N, 3:5]
    step(space, 100, 1e-3)
    np.testing.assert_allclose(mass @ space.state[:N, 3:5] - before, [0.1, -0.9], atol=1e-9)


def test_flesh_gives_back_on_pymunks_road_what_its_law_gives_back() -> None:
    # Restitution is the root of the energy that comes back: 1 / unloading ratio of a straight
    # curve, 11 for the head.
    space = flying(Road(0.6))
    shapes = [s for s in space.space.shapes if s.body.body_type == pymunk.Body.DYNAMIC]
    found = {s.body.id: s.elasticity for s in shapes}
    ids = [b.id for b in space.space.bodies if b.body_type == pymunk.Body.DYNAMIC]
    assert found[ids[SEGMENTS.index("head")]] == pytest.approx(math.sqrt(1.0 / 11.0), rel=1e-3)


def test_a_road_that_changes_has_two_frictions() -> None:
    for road, expected in (
        (Road(0.6), [0.6]),
        (Road(0.6, wet_from=8.0, wet_friction=0.2), [0.2, 0.6]),
        (Road(0.6, wet_from=-1e9, wet_friction=0.2), [0.2]),
    ):
        shapes = flying(road).space.static_body.shapes
        assert sorted(shape.friction for shape in shapes) == expected


def test_the_pulse_follows_the_speed_without_jumps() -> None:
    """A begin of a contact that waits for a longer step moves the pulse of neighbouring speeds."""
    model = load_model("planar", {})
    time = np.arange(0.0, 0.12, 1e-4)
    pulses = []
    for speed in np.arange(9.93, 9.97, 0.002):
        head = model.run({"impact_speed": float(speed)}).histories["head"]
        pulses.append(np.interp(time, head.time, head.channels["acceleration"]))
    change = np.abs(np.diff(pulses, axis=0)).max(axis=1)
    # 2 mm/s apart they differ by 0.6 g where a flank is steepest.
    assert change.max() < 4.0 * np.median(change)
