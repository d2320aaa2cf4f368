"""A rigid headform against a car's front of facets: the compiled step loop.

The contact is that of the crash models (``models.crash.car_contact``) for a body of one sphere.
Gravity is neglected, as for a headform against a plane.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.compilation import kernel
from models.crash.car_contact import apply_car_contacts
from models.crash.surfaces import update_surfaces
from models.headform.impact import (
    ABSORBED,
    COLUMNS,
    DEEPEST,
    END_SLIDE,
    END_SPIN,
    END_TIME,
    NORMAL,
    PENETRATION,
    RATE,
    REBOUND,
    SAMPLES,
    SLIDE,
    SPIN,
    TANGENTIAL,
)
from models.vehicle.surface.field import distance_at

Array = NDArray[np.float64]

FORCE = COLUMNS
"""First of the three further columns of the record: components of the force."""
FACET_COLUMNS = COLUMNS + 3


class Sphere(NamedTuple):
    """The headform as a body of one segment.

    Attributes
    ----------
    mass, inertia : (1,) array
        kg, and kg m2 about every axis.
    """

    mass: Array
    inertia: Array


@kernel
def strike_facets(
    front, ellipsoids, sphere, motion, loads, contacts, power, old, car, axes, step,
    stride, record, summary,
):  # fmt: skip
    """Step from first contact until the headform leaves the surface.

    Parameters
    ----------
    front : FacetFront
    ellipsoids : Ellipsoids
        The sphere and its contact laws.
    sphere : Sphere
    motion : Motion
        Place and velocity at first contact; changed.
    loads : Loads
        Workspace.
    contacts : Contacts
        Workspace; keeps the largest penetration by region.
    power : (CHANNELS,) array
        Workspace.
    old : (2, 3) array
        Workspace.
    car : (6,) array
        The car at rest: zeros.
    axes : (3, 3) array
        Initial normal of the surface, direction of the slide and their normal.
    step : float
        s.
    stride : int
        Steps per sample.
    record : (samples, FACET_COLUMNS) array
        Filled: resultant of the normal and of the tangential forces (N), largest penetration (m);
        speed against the initial normal and along the slide (m/s), angular speed (rad/s);
        components of the force along the axes (N).
    summary : (SUMMARY,) array
        Filled; END_TIME is NaN if the record is full before the contact ends.
    """
    mass, inertia = sphere.mass[0], sphere.inertia[0]
    regions = front.friction.shape[0]
    centre, velocity, spin = motion.centre, motion.velocity, motion.angular_velocity
    absorbed, old_power, deepest = 0.0, 0.0, 0.0
    samples = 0
    summary[END_TIME] = math.nan
    for k in range(record.shape[0] * stride + 1):
        if k > 0:
            # Loads of the step before; velocities are corrected below.
            for a in range(3):
                centre[0, a] += step * velocity[0, a] + 0.5 * step * step * loads.force[0, a] / mass
                velocity[0, a] += step * loads.force[0, a] / mass
                spin[0, a] += step * loads.torque[0, a] / inertia
                old[0, a], old[1, a] = loads.force[0, a], loads.torque[0, a]
        update_surfaces(ellipsoids, motion, contacts)
        for a in range(3):
            loads.force[0, a] = 0.0
            loads.torque[0, a] = 0.0
        apply_car_contacts(front, ellipsoids, car, motion, loads, contacts, sphere, power, k * step)
        now = 0.0
        for a in range(3):
            if k > 0:
                half = 0.5 * step
                velocity[0, a] += half * (loads.force[0, a] - old[0, a]) / mass
                spin[0, a] += half * (loads.torque[0, a] - old[1, a]) / inertia
            now -= loads.force[0, a] * velocity[0, a] + loads.torque[0, a] * spin[0, a]
        if k > 0:
            absorbed += 0.5 * step * (old_power + now)
        old_power = now
        depth, nx, ny, nz = 0.0, 0.0, 0.0, 0.0
        for j in range(regions):
            force = contacts.segment_force[0, j]
            nx += force * contacts.normal[0, j, 0]
            ny += force * contacts.normal[0, j, 1]
            nz += force * contacts.normal[0, j, 2]
            if front.found.share[j] > 0.0:
                depth = max(depth, front.found.shared_depth[j])
        deepest = max(deepest, depth)
        fx, fy, fz = loads.force[0, 0], loads.force[0, 1], loads.force[0, 2]
        if k % stride == 0 and samples < record.shape[0]:
            rate, slide = 0.0, 0.0
            for a in range(3):
                rate -= velocity[0, a] * axes[0, a]
                slide += velocity[0, a] * axes[1, a]
                record[samples, FORCE + a] = axes[a, 0] * fx + axes[a, 1] * fy + axes[a, 2] * fz
            record[samples, NORMAL] = math.sqrt(nx * nx + ny * ny + nz * nz)
            record[samples, TANGENTIAL] = math.sqrt(
                (fx - nx) ** 2 + (fy - ny) ** 2 + (fz - nz) ** 2
            )
            record[samples, PENETRATION] = depth
            record[samples, RATE] = rate
            record[samples, SLIDE] = slide
            record[samples, SPIN] = math.sqrt(spin[0, 0] ** 2 + spin[0, 1] ** 2 + spin[0, 2] ** 2)
            samples += 1
        if k > 0 and fx == 0.0 and fy == 0.0 and fz == 0.0:
            _, gx, gy, gz = distance_at(front.field, centre[0, 0], centre[0, 1], centre[0, 2])
            if velocity[0, 0] * gx + velocity[0, 1] * gy + velocity[0, 2] * gz >= 0.0:
                summary[END_TIME] = k * step
                break
    normal, square = 0.0, 0.0
    for a in range(3):
        normal += velocity[0, a] * axes[0, a]
        square += velocity[0, a] * velocity[0, a]
    summary[SAMPLES] = float(samples)
    summary[DEEPEST] = deepest
    summary[REBOUND] = normal
    summary[END_SLIDE] = math.sqrt(max(square - normal * normal, 0.0))
    summary[END_SPIN] = math.sqrt(spin[0, 0] ** 2 + spin[0, 1] ** 2 + spin[0, 2] ** 2)
    summary[ABSORBED] = absorbed
