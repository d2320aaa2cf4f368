"""Prescribed motion of the car: braking on an arc until it stops.

A point of the car's axis (``rotation_centre`` behind the front, near the centre of gravity) moves
on a circle whose radius is the impact speed over the yaw rate, the radius of curvature of the skid
marks; the car's axis stays tangent to it, so the yaw rate falls with the speed.
"""

import math
from typing import NamedTuple

from models.compilation import inlined_kernel
from models.criteria.units import STANDARD_GRAVITY


class CarMotion(NamedTuple):
    """Prescribed motion.

    Attributes
    ----------
    speed : float
        Speed at impact, m/s.
    deceleration : float
        m/s2.
    curvature : float
        Curvature of the path, 1/m.
    pivot : float
        Distance of the point that follows the path behind the front, m.
    onset : float
        Time from impact to braking, s.
    """

    speed: float
    deceleration: float
    curvature: float
    pivot: float
    onset: float = 0.0


def braking_motion(
    impact_speed: float,
    friction_tyre_road: float,
    yaw_rate: float,
    rotation_centre: float,
    downhill_gravity: float = 0.0,
) -> CarMotion:
    """Return the motion of a car that brakes with all wheels at the friction limit.

    Parameters
    ----------
    impact_speed : float
        m/s.
    friction_tyre_road : float
        Coefficient of friction.
    yaw_rate : float
        Yaw rate at impact, positive to the left, rad/s.
    rotation_centre : float
        Distance behind the front, m.
    downhill_gravity : float
        Gravity component along the travel of a car on a falling road, m/s2.

    Notes
    -----
    On a road too steep for the tyres a tenth of the braking is kept, so that the car still stops.
    """
    braking = friction_tyre_road * STANDARD_GRAVITY
    curvature = yaw_rate / impact_speed if impact_speed > 0.0 else 0.0
    return CarMotion(
        impact_speed, max(braking - downhill_gravity, 0.1 * braking), curvature, rotation_centre
    )


def stopping_distance(motion: CarMotion) -> float:
    """Return the path (m) from impact to standstill."""
    return motion.speed * motion.onset + motion.speed**2 / (2.0 * motion.deceleration)


@inlined_kernel
def car_state(motion, time, car):
    """Write position, yaw and their rates at a time.

    Parameters
    ----------
    motion : CarMotion
    time : float
        Time after impact, s.
    car : (6,) array
        Filled: x, y (m) and yaw (rad) of the car's frame and their rates (m/s, m/s, rad/s).
    """
    stop = motion.speed / motion.deceleration
    coast = min(time, motion.onset)
    t = min(time - coast, stop)
    speed = motion.speed - motion.deceleration * t
    path = motion.speed * (coast + t) - 0.5 * motion.deceleration * t * t
    yaw = motion.curvature * path
    cosine, sine = math.cos(yaw), math.sin(yaw)
    if abs(yaw) > 1e-6:
        x, y = sine / motion.curvature, (1.0 - cosine) / motion.curvature
    else:
        x, y = path, 0.5 * path * yaw
    rate = motion.curvature * speed
    car[0] = x - motion.pivot + motion.pivot * cosine
    car[1] = y + motion.pivot * sine
    car[2] = yaw
    car[3] = speed * cosine - rate * motion.pivot * sine
    car[4] = speed * sine + rate * motion.pivot * cosine
    car[5] = rate
