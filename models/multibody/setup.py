"""Assembly of a crash: the scenario as the tree of the compiled core, at first contact."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.compilation import kernel
from models.contact.geometry import ellipsoid_direction
from models.crash.car_contact import zone_separation
from models.crash.scenario import SEARCH_AHEAD, SEARCH_BEHIND, Scenario, build_scenario
from models.crash.surfaces import empty_contacts, shape_of, update_surfaces
from models.effects.chain import EffectChain
from models.multibody.tree import Motion, Tree, empty_motion, update_kinematics
from models.pedestrian.anthropometry import PARENTS, SEGMENTS, Body
from models.pedestrian.posture import Posture, standing_posture
from models.vehicle.profile import Vehicle

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Crash:
    """Everything that the step loop needs; ``motion`` is the state at first contact."""

    scenario: Scenario
    tree: Tree
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
    scenario = build_scenario(inputs, vehicle, chain)
    ellipsoids = scenario.ellipsoids
    tree = build_tree(scenario.body)
    motion = place(scenario.posture)
    scratch = empty_contacts(len(SEGMENTS), len(vehicle.zones), len(ellipsoids.pairs))
    # Neighbouring ellipsoids overlap at rest; only what goes beyond that is contact.
    for state in (place(standing_posture(scenario.body)), motion):
        separation = np.empty(len(ellipsoids.pairs))
        pair_separations(tree, ellipsoids, state, scratch, separation)
        np.maximum(ellipsoids.pair_gap, -separation, out=ellipsoids.pair_gap)
    motion.root_position[1] += scenario.lateral_offset
    shift = first_contact_shift(
        tree, scenario.zones, ellipsoids, motion, scratch, SEARCH_AHEAD, SEARCH_BEHIND
    )
    if np.isnan(shift):
        return None
    motion.root_position[0] += shift
    return Crash(scenario, tree, motion)
