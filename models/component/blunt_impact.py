"""A flat rigid impactor against one region of the free, upright body, from any side.

Thorax and abdomen impacts of child donors (Ouyang 2006, 2015) and of dummies (49 CFR 572.124),
lateral and oblique hub impacts of adults (Viano 1989), frontal ones (Lebarbe 2012). Gravity is
neglected: the impact is over before the body has begun to fall. The arms do not touch the impactor.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.compilation import kernel
from models.contact.dent import pressure_share
from models.contact.law import KNOTS, contact_force, law_of
from models.crash.ellipsoids import build_ellipsoids
from models.crash.surfaces import empty_contacts, push, shape_of, update_surfaces
from models.multibody.bushings import apply_bushings
from models.multibody.integration import correct, empty_memory, predict
from models.multibody.joints import apply_joint_torques
from models.multibody.kinematics import seat_joints, update_kinematics
from models.multibody.setup import build_tree, place
from models.multibody.sweeps import solve_accelerations
from models.multibody.tree import empty_loads
from models.pedestrian.anthropometry import SEGMENTS, Body
from models.pedestrian.joints import Joints
from models.pedestrian.posture import standing_posture
from models.pedestrian.tissue import build_tissue

Array = NDArray[np.float64]

STEP = 2e-5
"""s."""
DURATION = 0.12
"""s of impact at most."""


@dataclass(frozen=True)
class BluntImpact:
    """Histories of an impact.

    Attributes
    ----------
    time : (n,) array
        s.
    force : (n,) array
        N.
    deflection : (n,) array
        Penetration of the impactor's face into the region, m.
    """

    time: Array
    force: Array
    deflection: Array

    @property
    def hysteresis(self) -> float:
        """Share of the loading work that unloading does not return."""
        power = np.diff(self.deflection) * 0.5 * (self.force[1:] + self.force[:-1])
        loading = float(power[power > 0.0].sum())
        return float(power.sum()) / loading if loading > 0.0 else math.nan


@kernel
def _strike(
    tree, joints, ellipsoids, motion, loads, contacts, memory, power,
    laws, count, segment, mass, speed, nx, ny, step, out,
):  # fmt: skip
    """Step until the record ``out`` (n, 2) of force (N) and deflection (m) is full.

    The impactor comes from the horizontal direction ``(nx, ny)``.
    """
    face, rate, force, deepest = 0.0, speed, 0.0, 0.0
    for k in range(out.shape[0]):
        old_force = force
        if k > 0:
            face -= step * rate - 0.5 * step * step * old_force / mass
            predict(tree, motion, loads, memory, step)
        update_kinematics(tree, motion)
        update_surfaces(ellipsoids, motion, contacts)
        for i in range(tree.mass.shape[0]):
            for j in range(3):
                loads.force[i, j] = 0.0
                loads.torque[i, j] = 0.0
        xx, xy, xz, yy, yz, _ = shape_of(contacts, segment)
        ax, ay, az = xx * nx + xy * ny, xy * nx + yy * ny, xz * nx + yz * ny
        reach = math.sqrt(ax * nx + ay * ny)
        cx, cy, cz = (
            contacts.centre[segment, 0],
            contacts.centre[segment, 1],
            contacts.centre[segment, 2],
        )
        front = cx * nx + cy * ny + reach
        if k == 0:
            face = front
        depth = max(front - face, 0.0)
        deepest = max(deepest, depth)
        elastic, viscous = contact_force(laws, 0, count, 0.0, 0.0, depth, 0.0, deepest)
        force = elastic + viscous
        left = (1.0 - pressure_share(depth, 0.0, reach)) / reach
        push(
            motion, loads, segment, cx + left * ax, cy + left * ay, cz + left * az,
            -force * nx, -force * ny, 0.0,
        )  # fmt: skip
        apply_joint_torques(tree, joints, motion, loads, power)
        apply_bushings(tree, joints, motion, loads, power)
        solve_accelerations(tree, motion, loads)
        if k > 0:
            correct(tree, motion, loads, memory, step)
            rate -= 0.5 * step * (old_force + force) / mass
        out[k, 0] = force
        out[k, 1] = depth


def strike_region(
    body: Body,
    joints: Joints,
    region: str,
    impactor_mass: float,
    speed: float,
    side: float = 0.0,
) -> BluntImpact:
    """Simulate an impact on a region of the upright body.

    Parameters
    ----------
    body : Body
    joints : Joints
    region : str
        A segment of the trunk or the head, e.g. ``chest``.
    impactor_mass : float
        kg.
    speed : float
        m/s.
    side : float
        Direction from which the impactor comes, rad: 0 from the front, pi / 2 from the left.

    Returns
    -------
    BluntImpact
    """
    n, segment = len(SEGMENTS), SEGMENTS.index(region)
    laws = np.zeros((1, KNOTS, 4))
    count = law_of(build_tissue(body)[region], laws[0])
    ellipsoids = build_ellipsoids(body, build_tissue(body), [])
    out = np.zeros((round(DURATION / STEP), 2))
    tree, motion = build_tree(body, joints.yields), place(standing_posture(body))
    seat_joints(tree, motion)
    _strike(
        tree, joints, ellipsoids, motion, empty_loads(n),
        empty_contacts(n, 0, len(ellipsoids.pairs)), empty_memory(n), np.zeros(2), laws, count,
        segment, impactor_mass, speed,
        math.cos(side), math.sin(side), STEP, out,
    )  # fmt: skip
    over = np.flatnonzero((out[:, 0] == 0.0) & (np.arange(len(out)) > np.argmax(out[:, 0])))
    end = int(over[0]) + 1 if over.size else len(out)
    time: Array = np.arange(end, dtype=np.float64) * STEP
    return BluntImpact(time, out[:end, 0].copy(), out[:end, 1].copy())
