"""Assembly of a crash: the scenario as the tree of the compiled core at first contact."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.compilation import kernel
from models.crash.first_contact import first_contact_shift, widen_gaps
from models.crash.scenario import Scenario, build_scenario
from models.crash.surfaces import empty_contacts, update_surfaces
from models.effects.chain import EffectChain
from models.multibody.kinematics import seat_joints
from models.multibody.tree import Motion, Tree, empty_motion
from models.pedestrian.anthropometry import PARENTS, SEGMENTS, Body
from models.pedestrian.posture import Posture, standing_posture
from models.vehicle.profile import Vehicle
from models.vehicle.zones import Zones


@dataclass(frozen=True)
class Crash:
    """Input of the step loop.

    Attributes
    ----------
    scenario : Scenario
    front : named tuple
        Geometry of the car's front, one of the types of ``models.crash.front``.
    tree : Tree
    motion : Motion
        State at first contact.
    """

    scenario: Scenario
    front: Any
    tree: Tree
    motion: Motion


def build_tree(body: Body, yields: NDArray[np.bool_] | None = None) -> Tree:
    """Return the tree of a body.

    Parameters
    ----------
    body : Body
    yields : (n,) array of bool, optional
        Joints that yield, as in ``Joints``; by default none.
    """
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
        yields=np.zeros(n, dtype=np.bool_) if yields is None else yields,
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
def _update(tree, ellipsoids, motion, contacts):
    seat_joints(tree, motion)
    update_surfaces(ellipsoids, motion, contacts)


def zones_of(scenario: Scenario) -> Zones:
    """Return the zones of a scenario as the front."""
    return scenario.zones


def build_crash(
    inputs: Mapping[str, float],
    vehicle: Vehicle,
    chain: EffectChain | None = None,
    front_of: Callable[[Scenario], Any] = zones_of,
) -> Crash | None:
    """Return the crash for one set of inputs, or None if the body never touches the car.

    Parameters
    ----------
    inputs : mapping of str to float
        By name, in SI units; see ``data/multibody.toml``.
    vehicle : Vehicle
    chain : EffectChain, optional
        Effects that are switched on.
    front_of : callable
        Scenario to the geometry of the car's front; by default the zones.
    """
    scenario = build_scenario(inputs, vehicle, chain)
    front = front_of(scenario)
    ellipsoids = scenario.ellipsoids
    tree = build_tree(scenario.body, scenario.joints.yields)
    motion = place(scenario.posture)
    scratch = empty_contacts(len(SEGMENTS), len(vehicle.zones), len(ellipsoids.pairs))
    for state in (place(standing_posture(scenario.body)), motion):
        _update(tree, ellipsoids, state, scratch)
        widen_gaps(ellipsoids, scratch)
    motion.root_position[1] += scenario.lateral_offset
    _update(tree, ellipsoids, motion, scratch)
    shift = first_contact_shift(front, ellipsoids, motion, scratch)
    if np.isnan(shift):
        return None
    motion.root_position[0] += shift
    seat_joints(tree, motion)
    return Crash(scenario, front, tree, motion)
