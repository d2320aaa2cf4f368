"""Assembly of a crash: body, car and initial state as the compiled core takes them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from models import data
from models.compilation import kernel
from models.contact.geometry import ellipsoid_direction
from models.contact.law import KNOTS, ForceCurve, combine_curves
from models.effects.chain import EffectChain
from models.multibody.car_contact import zone_separation
from models.multibody.road import Road
from models.multibody.surfaces import Ellipsoids, empty_contacts, shape_of, update_surfaces
from models.multibody.tree import Motion, Tree, empty_motion, update_kinematics
from models.pedestrian.anthropometry import PARENTS, SEGMENTS, Body, build_body, region_of
from models.pedestrian.joints import Joints, build_joints
from models.pedestrian.posture import Posture, running_posture, standing_posture
from models.pedestrian.tissue import build_tissue, self_contact_pairs
from models.vehicle.motion import CarMotion, braking_motion
from models.vehicle.profile import Vehicle, build_zones
from models.vehicle.zones import Zones

Array = NDArray[np.float64]

HOOD = "hood"
"""Zone whose forces ``hood_force_scale`` multiplies."""
SEARCH_AHEAD = 1.5
"""m ahead of the car from which the body is brought back until it touches."""
SEARCH_BEHIND = -0.6
"""m behind the car's foremost point where the search for a first contact gives up."""


@dataclass(frozen=True)
class Crash:
    """Everything that the step loop needs; ``motion`` is the state at first contact."""

    body: Body
    vehicle: Vehicle
    tree: Tree
    joints: Joints
    ellipsoids: Ellipsoids
    zones: Zones
    road: Road
    car_motion: CarMotion
    motion: Motion


def build_tree(body: Body) -> Tree:
    """Return the tree of a body."""
    n = len(SEGMENTS)
    reference = body.joint.copy()
    reference[0] = body.centre[0]
    joint_in_parent = np.zeros((n, 3))
    for i, parent in enumerate(PARENTS):
        if parent >= 0:
            joint_in_parent[i] = reference[i] - reference[parent]
    return Tree(
        parent=np.array(PARENTS, dtype=np.int64),
        joint_in_parent=joint_in_parent,
        centre_from_joint=body.centre - reference,
        mass=body.mass.copy(),
        inertia=body.inertia.copy(),
    )


def place(posture: Posture) -> Motion:
    """Return the motion of a body in a posture."""
    motion = empty_motion(posture.orientation.shape[0])
    motion.root_position[:] = posture.root_position
    motion.root_velocity[:] = posture.root_velocity
    motion.orientation[:] = posture.orientation
    motion.angular_velocity[:] = posture.angular_velocity
    return motion


@kernel
def pair_separations(tree, ellipsoids, motion, contacts, out):
    """Write the separation (m) of every self-contact pair."""
    update_kinematics(tree, motion)
    update_surfaces(ellipsoids, motion, contacts)
    for k in range(ellipsoids.pairs.shape[0]):
        i, j = ellipsoids.pairs[k, 0], ellipsoids.pairs[k, 1]
        _, _, _, out[k] = ellipsoid_direction(
            contacts.centre[i, 0] - contacts.centre[j, 0],
            contacts.centre[i, 1] - contacts.centre[j, 1],
            contacts.centre[i, 2] - contacts.centre[j, 2],
            shape_of(contacts, i),
            shape_of(contacts, j),
            0.0,
            0.0,
            0.0,
        )


@kernel
def _touches(zones, ellipsoids, contacts, shift):
    for i in range(ellipsoids.reach.shape[0]):
        x, y, z = contacts.centre[i, 0] + shift, contacts.centre[i, 1], contacts.centre[i, 2]
        for j in range(zones.radius.shape[0]):
            found = zone_separation(zones, ellipsoids, contacts, j, i, x, y, z, 1.0, 0.0)
            if found[0] < 0.0 and found[7] > 0.0:
                return True
    return False


@kernel
def first_contact_shift(tree, zones, ellipsoids, motion, contacts, ahead, behind):
    """Return the shift in x (m) that makes the body just touch the car, or NaN."""
    update_kinematics(tree, motion)
    update_surfaces(ellipsoids, motion, contacts)
    clear, step = ahead, 0.02
    while not _touches(zones, ellipsoids, contacts, clear - step):
        clear -= step
        if clear < behind:
            return np.nan
    low, high = clear - step, clear
    for _ in range(40):
        middle = 0.5 * (low + high)
        if _touches(zones, ellipsoids, contacts, middle):
            low = middle
        else:
            high = middle
    return high


@kernel
def _combine_all(
    surface_d, surface_f, surface_n, surface_r, body_d, body_f, body_n, body_r, laws, counts
):
    bodies = body_n.shape[0]
    for j in range(surface_n.shape[0]):
        for i in range(bodies):
            k = j * bodies + i
            counts[k] = combine_curves(
                surface_d[j, : surface_n[j]], surface_f[j, : surface_n[j]], surface_r[j],
                body_d[i, : body_n[i]], body_f[i, : body_n[i]], body_r[i], laws[k],
            )  # fmt: skip


def _stack(curves: list[ForceCurve]) -> tuple[Array, Array, NDArray[np.int64], Array]:
    depth, force = np.zeros((len(curves), KNOTS)), np.zeros((len(curves), KNOTS))
    for row, curve in enumerate(curves):
        depth[row, : curve.penetration.size] = curve.penetration
        force[row, : curve.force.size] = curve.force
    sizes = np.array([curve.penetration.size for curve in curves], dtype=np.int64)
    return depth, force, sizes, np.array([curve.unloading_ratio for curve in curves])


RIGID = ForceCurve(np.array([0.0, 1e-6]), np.array([0.0, 1e5]), 1.0 + 1e-9)
"""The road: 100 kN/mm, far stiffer than any tissue."""
ELASTIC = 1.000001
"""Unloading ratio of what springs back fully; a force curve takes more than one."""


def build_ellipsoids(
    body: Body,
    tissue: Mapping[str, ForceCurve],
    zone_curves: list[ForceCurve],
    returned: float = 1.0,
) -> Ellipsoids:
    """Return the surfaces of a body and their laws against zones, road and each other.

    Parameters
    ----------
    body : Body
    tissue : of its regions.
    zone_curves : list of ForceCurve
        The car's zones, in order.
    returned : factor on the share of the energy that the road gives back.
    """
    regions = list(tissue)
    bodies = [tissue[region] for region in regions]
    # Surfaces: the zones, the road, and every region as the counterpart of another.
    surfaces = [*zone_curves, RIGID, *bodies]
    laws = np.zeros((len(surfaces) * len(bodies), KNOTS, 4))
    counts = np.zeros(laws.shape[0], dtype=np.int64)
    _combine_all(*_stack(surfaces), *_stack(bodies), laws, counts)
    if returned != 1.0:
        k = len(zone_curves)
        springy = [
            replace(curve, unloading_ratio=max(curve.unloading_ratio / returned, ELASTIC))
            for curve in bodies
        ]
        rows = slice(k * len(bodies), (k + 1) * len(bodies))
        _combine_all(*_stack([RIGID]), *_stack(springy), laws[rows], counts[rows])
    damping = np.repeat([curve.damping for curve in surfaces], len(bodies))
    row = np.array([regions.index(region_of(segment)) for segment in SEGMENTS])
    zones = len(zone_curves)
    surface_law = np.arange(zones + 1)[None, :] * len(bodies) + row[:, None]
    pairs = np.array(
        [(i, j, (zones + 1 + row[j]) * len(bodies) + row[i]) for i, j in self_contact_pairs()],
        dtype=np.int64,
    )
    return Ellipsoids(
        square=body.semi_axes**2,
        reach=body.semi_axes.max(axis=1),
        offset=body.ellipsoid - body.centre,
        laws=laws,
        counts=counts,
        damping=damping,
        surface_law=surface_law.astype(np.int64),
        pairs=pairs,
        pair_gap=np.zeros(len(pairs)),
        pair_friction=float(data.load("pedestrians/tissue.toml")["self_contact"]["friction"]),
    )


def build_crash(
    inputs: Mapping[str, float], vehicle: Vehicle, chain: EffectChain | None = None
) -> Crash | None:
    """Return the crash for one set of inputs, or None if the body never touches the car.

    Parameters
    ----------
    inputs : mapping
        By name, in SI units; see ``data/multibody.toml``.
    vehicle : Vehicle
    chain : effects that are switched on.
    """
    chain = chain or EffectChain()
    given = inputs
    inputs = chain.act("inputs", given, given)
    body = build_body(inputs["age"], inputs["stature"], inputs["body_mass"], inputs["head_mass"])
    tree = build_tree(body)
    joints = build_joints(
        body, neck_stiffness=inputs["neck_stiffness"], muscle_tone=inputs["muscle_tone"]
    )
    curves = [zone.corridor.curve(inputs[zone.coordinate]) for zone in vehicle.zones]
    for k, zone in enumerate(vehicle.zones):
        if zone.name == HOOD:
            force = inputs["hood_force_scale"] * curves[k].force
            curves[k] = chain.act("curve", replace(curves[k], force=force), given)
    tissue: Mapping[str, ForceCurve] = chain.act("tissue", build_tissue(body), given)
    road = chain.act("road", Road(inputs["friction_body_road"]), given)
    ellipsoids = build_ellipsoids(body, tissue, curves, road.returned)
    zones = build_zones(
        vehicle,
        inputs["dive_angle"],
        inputs["friction_body_car"],
    )
    motion = place(
        running_posture(
            body,
            gait_phase=inputs["gait_phase"],
            facing_angle=inputs["facing_angle"],
            running_speed=inputs["running_speed"],
            braced=chain.act("posture", 0.0, given),
        )
    )
    scratch = empty_contacts(len(SEGMENTS), len(vehicle.zones), len(ellipsoids.pairs))
    # Neighbouring ellipsoids overlap at rest; only what goes beyond that is contact.
    for state in (place(standing_posture(body)), motion):
        separation = np.empty(len(ellipsoids.pairs))
        pair_separations(tree, ellipsoids, state, scratch, separation)
        np.maximum(ellipsoids.pair_gap, -separation, out=ellipsoids.pair_gap)
    motion.root_position[1] += inputs["lateral_offset"]
    shift = first_contact_shift(
        tree, zones, ellipsoids, motion, scratch, SEARCH_AHEAD, SEARCH_BEHIND
    )
    if np.isnan(shift):
        return None
    motion.root_position[0] += shift
    return Crash(
        body=body,
        vehicle=vehicle,
        tree=tree,
        joints=joints,
        ellipsoids=ellipsoids,
        zones=zones,
        road=road,
        car_motion=chain.act(
            "braking",
            braking_motion(
                inputs["impact_speed"],
                inputs["friction_tyre_road"],
                inputs["yaw_rate"],
                vehicle.rotation_centre,
                road.pull,
            ),
            given,
        ),
        motion=motion,
    )
