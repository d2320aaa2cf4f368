"""A rigid headform on one zone of a car: the compiled step loop.

The hood is a plane with a force-penetration law along its normal and Coulomb friction along it.
Unknowns are the penetration, the speed along the hood and the spin that friction gives to the
headform. Gravity is neglected: a contact lasts some 20 ms, the forces are two orders above weight.
"""

import math
from typing import NamedTuple

from models.compilation import kernel
from models.contact.friction import friction_coefficient
from models.contact.law import contact_force

# Columns of the record.
NORMAL, TANGENTIAL, PENETRATION, RATE, SLIDE, SPIN = range(6)
COLUMNS = 6

# Entries of the summary.
SAMPLES, DEEPEST, END_TIME, REBOUND, END_SLIDE, END_SPIN, ABSORBED = range(7)
SUMMARY = 7


class Impactor(NamedTuple):
    """The headform: mass (kg), inertia (kg m2) about a transverse axis, radius (m)."""

    mass: float
    inertia: float
    radius: float


REFERENCE_RATE = 8.0
"""Rate (m/s) at which a rate's share of the force is given: that of a headform test."""


class Surface(NamedTuple):
    """What is struck, beside its law.

    Friction, damping (N s/m) and its onset (m), share by which the rate raises the force at the
    reference rate and the exponent with which it does, mass of the hood (kg) that the headform sets
    in motion and the depth (m) over which it does.
    """

    friction: float
    damping: float
    onset: float
    rate_share: float
    rate_exponent: float
    moved: float
    moved_depth: float


@kernel
def strike(impactor, surface, laws, count, rate, slide, step, stride, record, summary):
    """Step from first contact until the headform leaves the surface.

    Parameters
    ----------
    impactor, surface : Impactor, Surface
    laws : (1, KNOTS, 4), count : knots used.
    rate, slide : m/s, speeds into and along the surface at first contact.
    step : s. stride : steps a sample.
    record : (samples, COLUMNS), filled: normal and tangential force on the headform (N),
        penetration (m), its rate (m/s), speed along the surface (m/s), spin (rad/s).
    summary : (SUMMARY,), filled; END_TIME is NaN if the record is full before the contact ends.
    """
    mass, radius = impactor.mass, impactor.radius
    depth, deepest, spin, spent = 0.0, 0.0, 0.0, 0.0
    force, drag, power = 0.0, 0.0, 0.0
    samples = 0
    summary[END_TIME] = math.nan
    steps = record.shape[0] * stride
    for k in range(steps + 1):
        if k > 0:
            old_force, old_drag, old_power = force, drag, power
            depth += step * rate - 0.5 * step * step * old_force / mass
            old_rate, old_slide, old_spin = rate, slide, spin
            rate -= step * old_force / mass
            slide -= step * old_drag / mass
            spin += step * old_drag * radius / impactor.inertia
        deepest = max(deepest, depth)
        elastic, viscous = contact_force(
            laws, 0, count, surface.damping, surface.onset, max(depth, 0.0), rate, deepest
        )
        if surface.rate_share > 0.0 and rate > 0.0:
            elastic *= 1.0 + surface.rate_share * (rate / REFERENCE_RATE) ** surface.rate_exponent
        force = elastic + viscous
        if surface.moved > 0.0:
            # Mass of the hood takes up the headform's speed as it is reached, and keeps it.
            ratio = max(deepest, 0.0) / surface.moved_depth
            rest = math.exp(-ratio * ratio)
            if rate > 0.0 and depth >= deepest:
                growth = 2.0 * surface.moved * ratio * rest / surface.moved_depth
                force += growth * rate * rate
            force *= mass / (mass + surface.moved * (1.0 - rest))
        slip = slide - radius * spin
        drag = friction_coefficient(surface.friction, force, slip * slip, mass) * slip
        if k > 0:
            half = 0.5 * step
            rate = old_rate - half * (old_force + force) / mass
            slide = old_slide - half * (old_drag + drag) / mass
            spin = old_spin + half * (old_drag + drag) * radius / impactor.inertia
        power = force * rate + drag * (slide - radius * spin)
        if k > 0:
            spent += 0.5 * step * (old_power + power)
        if k % stride == 0 and samples < record.shape[0]:
            record[samples, NORMAL] = force
            record[samples, TANGENTIAL] = drag
            record[samples, PENETRATION] = depth
            record[samples, RATE] = rate
            record[samples, SLIDE] = slide
            record[samples, SPIN] = spin
            samples += 1
        if k > 0 and force == 0.0 and rate <= 0.0:
            summary[END_TIME] = k * step
            break
    summary[SAMPLES] = float(samples)
    summary[DEEPEST] = deepest
    summary[REBOUND] = -rate
    summary[END_SLIDE] = slide
    summary[END_SPIN] = spin
    summary[ABSORBED] = spent
