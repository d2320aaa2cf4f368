"""A rigid headform on one zone of a car: the compiled step loop.

The hood is a plane with a force-penetration law along its normal and Coulomb friction along it.
Unknowns are the penetration, the speed along the hood and the angular velocity that friction gives
to the headform. Gravity is neglected: a contact lasts some 20 ms, and the forces are two orders of
magnitude above the weight.
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
    """The headform.

    Attributes
    ----------
    mass : float
        kg.
    inertia : float
        About a transverse axis, kg m2.
    radius : float
        m.
    """

    mass: float
    inertia: float
    radius: float


REFERENCE_RATE = 8.0
"""Rate (m/s) at which a rate's share of the force is given: that of a headform test."""


class Surface(NamedTuple):
    """Properties of the struck surface apart from its law.

    Attributes
    ----------
    friction : float
        Coefficient of friction.
    damping : float
        Damping while loading, N s/m.
    onset : float
        Penetration over which the damping tapers in, m.
    rate_share : float
        Relative increase of the force at the reference rate.
    rate_exponent : float
        Exponent of the rate in that increase.
    moved : float
        Mass of the hood that the headform accelerates, kg.
    moved_depth : float
        Penetration over which this mass is picked up, m.
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
    impactor : Impactor
    surface : Surface
    laws : (1, KNOTS, 4) array
        Combined law.
    count : int
        Number of knots used.
    rate, slide : float
        Speeds into and along the surface at first contact, m/s.
    step : float
        s.
    stride : int
        Steps per sample.
    record : (samples, COLUMNS) array
        Filled: normal and tangential force on the headform (N), penetration (m), its rate (m/s),
        speed along the surface (m/s), angular velocity (rad/s).
    summary : (SUMMARY,) array
        Filled; END_TIME is NaN if the record is full before the contact ends.
    """
    mass, radius = impactor.mass, impactor.radius
    depth, deepest, spin, absorbed = 0.0, 0.0, 0.0, 0.0
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
            # Mass of the hood reaches the headform's speed when it is picked up, and keeps it.
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
            absorbed += 0.5 * step * (old_power + power)
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
    summary[ABSORBED] = absorbed
