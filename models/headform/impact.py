"""A rigid headform on one zone of a car: the compiled step loop.

The hood is a plane with a force-penetration law along its normal and Coulomb friction along it.
Unknowns are the penetration, the speed along the hood and the angular velocity that friction gives
to the headform. Gravity is neglected: a contact lasts some 20 ms, and the forces are two orders of
magnitude above the weight.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.compilation import inlined_kernel, kernel
from models.contact.friction import friction_coefficient
from models.contact.law import FORCE, RECOVERY, contact_force, interpolate_law

Array = NDArray[np.float64]

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
    guide_force : float
        Force of a guide of the rig against its motion at the reference rate, N.
    guide_exponent : float
        Exponent of the speed in that force, 0 for dry friction.
    """

    mass: float
    inertia: float
    radius: float
    guide_force: float = 0.0
    guide_exponent: float = 0.0


GUIDE_SLIP = 0.02
"""Speed (m/s) below which the friction of a guide fades, so that it has no jump (assumed)."""
REFERENCE_RATE = 8.0
"""Rate (m/s) at which a rate's share of the force is given: that of a headform test."""
REFERENCE_DEPTH = 0.03
"""Largest penetration (m) at which the unloading slope is given."""
LOCAL_ONSET = 0.001
"""m over which the damping of a local spring tapers in (assumed: some tenths of the 2 to 4 mm of
its largest deflection, so that the force has no jump at first touch)."""


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
    rate_force : (k, 2) array
        Penetrations (m) and the force (N) that the reference rate adds there while loading.
    pickup : (k, 2) array
        Penetrations (m), rising from 0, and the mass of the hood per penetration (kg/m) that is
        brought to the headform's speed there; it ends with 0.
    unloading_growth : float
        Exponent with which the excess of the unloading slope over the secant slope grows with the
        largest penetration.
    unloading_curvature : float
        Exponent of the force along the unloading line, 1 for a straight line.
    """

    friction: float
    damping: float
    onset: float
    rate_share: float
    rate_exponent: float
    rate_force: Array
    pickup: Array
    unloading_growth: float
    unloading_curvature: float


def plain_surface() -> Surface:
    """Return a surface without friction, whose force depends on penetration alone."""
    return Surface(0.0, 0.0, 0.0, 0.0, 1.0, np.zeros((1, 2)), np.zeros((1, 2)), 0.0, 1.0)


@inlined_kernel
def _at(table, x):
    """Return the value of a table (k, 2) at a place and its slope there, constant beyond it."""
    last = table.shape[0] - 1
    if x >= table[last, 0]:
        return table[last, 1], 0.0
    low, k = 0, last
    while k - low > 1:
        middle = (low + k) // 2
        if x > table[middle, 0]:
            low = middle
        else:
            k = middle
    slope = (table[k, 1] - table[k - 1, 1]) / (table[k, 0] - table[k - 1, 0])
    return table[k - 1, 1] + slope * (x - table[k - 1, 0]), slope


@inlined_kernel
def hood_force(surface, laws, count, depth, rate, deepest):
    """Return the hood's force (N) at a penetration (m), a rate (m/s) and a largest penetration (m).

    Parameters
    ----------
    surface : Surface
    laws : (1, KNOTS, 4) array
        Combined law.
    count : int
        Number of knots used.
    depth, rate, deepest : float
        Penetration, its rate and its largest value, m and m/s.
    """
    elastic, viscous = contact_force(
        laws, 0, count, surface.damping, surface.onset, max(depth, 0.0), rate, deepest
    )
    curvature, growth = surface.unloading_curvature, surface.unloading_growth
    if depth < deepest and (curvature != 1.0 or growth != 0.0):
        top = interpolate_law(laws, 0, count, FORCE, deepest)
        recovery = interpolate_law(laws, 0, count, RECOVERY, deepest)
        if growth != 0.0:
            excess = deepest / recovery - 1.0
            recovery = deepest / (1.0 + excess * (deepest / REFERENCE_DEPTH) ** growth)
        share = (max(depth, 0.0) - deepest + recovery) / recovery
        elastic = top * share**curvature if share > 0.0 else 0.0
    if rate > 0.0:
        relative = (rate / REFERENCE_RATE) ** surface.rate_exponent
        if surface.rate_share > 0.0:
            elastic *= 1.0 + surface.rate_share * relative
        if surface.rate_force.shape[0] > 1:
            added, _ = _at(surface.rate_force, max(depth, 0.0))
            viscous += added * relative
    return elastic + viscous


@inlined_kernel
def _guide_drag(impactor, rate):
    """Return the force (N) of the guide against the way into the hood at a rate (m/s)."""
    if impactor.guide_force == 0.0:
        return 0.0
    speed = abs(rate)
    size = impactor.guide_force * min(1.0, speed / GUIDE_SLIP)
    if impactor.guide_exponent != 0.0 and speed > 0.0:
        size *= (speed / REFERENCE_RATE) ** impactor.guide_exponent
    return size if rate > 0.0 else -size


@kernel
def write_guide_drag(impactor, rates, drag):
    """Write the force of the guide against the way into the hood.

    Parameters
    ----------
    impactor : Impactor
    rates : (n,) array
        Speeds into the hood, m/s.
    drag : (n,) array
        Filled, N.
    """
    for k in range(rates.size):
        drag[k] = _guide_drag(impactor, rates[k])


@kernel
def strike(impactor, surface, laws, count, rate, slide, step, stride, record, summary):
    """Step from first contact until the headform leaves the surface.

    The energy that is absorbed includes that of a guide.

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
    force, drag, power, guide = 0.0, 0.0, 0.0, 0.0
    moved, last_growth, last_deepest = 0.0, 0.0, 0.0
    samples = 0
    summary[END_TIME] = math.nan
    steps = record.shape[0] * stride
    for k in range(steps + 1):
        if k > 0:
            old_force, old_drag, old_power = force + guide, drag, power
            depth += step * rate - 0.5 * step * step * old_force / mass
            old_rate, old_slide, old_spin = rate, slide, spin
            rate -= step * old_force / mass
            slide -= step * old_drag / mass
            spin += step * old_drag * radius / impactor.inertia
        deepest = max(deepest, depth)
        force = hood_force(surface, laws, count, depth, rate, deepest)
        guide = _guide_drag(impactor, rate)
        if surface.pickup.shape[0] > 1:
            # Mass of the hood reaches the headform's speed when it is picked up, and keeps it.
            if rate > 0.0 and depth >= deepest:
                growth, _ = _at(surface.pickup, max(deepest, 0.0))
                moved += 0.5 * (last_growth + growth) * (depth - last_deepest)
                last_growth, last_deepest = growth, depth
                force += growth * rate * rate
            if force > 0.0:
                # The guide slows the mass that moves along, too.
                force = mass / (mass + moved) * (force + guide) - guide
        slip = slide - radius * spin
        drag = friction_coefficient(surface.friction, force, slip * slip, mass) * slip
        if k > 0:
            half = 0.5 * step
            rate = old_rate - half * (old_force + force + guide) / mass
            slide = old_slide - half * (old_drag + drag) / mass
            spin = old_spin + half * (old_drag + drag) * radius / impactor.inertia
        power = (force + guide) * rate + drag * (slide - radius * spin)
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


class Part(NamedTuple):
    """A part of the hood with a mass of its own, struck through a local spring and damper.

    Attributes
    ----------
    mass : float
        kg.
    stiffness : float
        N/m.
    damping : float
        N s/m.
    """

    mass: float
    stiffness: float
    damping: float


@kernel
def strike_part(
    impactor, surface, part, laws, count, rate, slide, step, stride, least, record, summary
):
    """Step from first contact until the headform has left a part of the hood that has mass.

    The hood's law acts between the part and the car, the local spring between headform and part.

    Parameters
    ----------
    impactor : Impactor
    surface : Surface
    part : Part
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
    least : float
        Time (s) without contact after which the headform has left: the part may come after it.
    record, summary
        See ``strike``; the penetration is the headform's, the deepest one is the part's.
    """
    mass, radius = impactor.mass, impactor.radius
    depth, hood, hood_rate, deepest = 0.0, 0.0, 0.0, 0.0
    spin, absorbed, free, ended = 0.0, 0.0, 0.0, math.nan
    samples = 0
    summary[END_TIME] = math.nan
    for k in range(record.shape[0] * stride + 1):
        deepest = max(deepest, hood)
        below = hood_force(surface, laws, count, hood, hood_rate, deepest)
        if hood <= 0.0:
            below = 0.0
        press = 0.0
        if depth >= hood:
            spring = part.stiffness * (depth - hood)
            damper = part.damping * (rate - hood_rate) * min((depth - hood) / LOCAL_ONSET, 1.0)
            press = max(0.0, spring + damper)
        slip = slide - radius * spin
        drag = friction_coefficient(surface.friction, press, slip * slip, mass) * slip
        if k % stride == 0 and samples < record.shape[0]:
            record[samples, NORMAL] = press
            record[samples, TANGENTIAL] = drag
            record[samples, PENETRATION] = depth
            record[samples, RATE] = rate
            record[samples, SLIDE] = slide
            record[samples, SPIN] = spin
            samples += 1
        guide = _guide_drag(impactor, rate)
        absorbed += step * ((press + guide) * rate + drag * slip)
        if press > 0.0:
            free, ended = 0.0, k * step
        else:
            free += step
        if free > least:
            summary[END_TIME] = ended
            break
        rate -= step * (press + guide) / mass
        slide -= step * drag / mass
        spin += step * drag * radius / impactor.inertia
        hood_rate += step * (press - below) / part.mass
        depth += step * rate
        hood += step * hood_rate
    summary[SAMPLES] = float(samples)
    summary[DEEPEST] = deepest
    summary[REBOUND] = -rate
    summary[END_SLIDE] = slide
    summary[END_SPIN] = spin
    summary[ABSORBED] = absorbed
