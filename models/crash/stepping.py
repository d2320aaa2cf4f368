"""Detection of the head's impact on the car, which is stepped finely."""

import math

from models.compilation import inlined_kernel
from models.crash.front import is_near, patch_count

HEAD_NEAR = 0.03
"""Distance (m) from a car zone within which a closing head is stepped finely (assumed)."""
HEAD_SPEED = 1.5
"""Rearward speed (m/s) relative to the car at which a head near it counts as closing (assumed)."""
HEAD_FALL = 0.3
"""Downward speed (m/s) at which a head near car or road counts as closing (assumed)."""
HEAD_FORCE = 300.0
"""Head force (N) on car or road above which its contact is stepped finely (assumed)."""


@inlined_kernel
def head_meets_car(head, ellipsoids, front, car, motion, contacts):
    """Return whether the head is loaded by the car, or near and closing on it.

    Parameters
    ----------
    head : int
        Row of the head.
    ellipsoids : Ellipsoids
        Surfaces of the segments and their contact laws.
    front : named tuple
        Geometry of the car's front, one of the types in ``FRONTS``.
    car : (6,) array
        x, y (m) and yaw (rad) of the car's frame and their rates.
    motion : Motion
        Positions and velocities of the segments.
    contacts : Contacts
        State and results of the contacts.
    """
    reach = ellipsoids.reach[head]
    cosine, sine = math.cos(car[2]), math.sin(car[2])
    wx, wy = contacts.centre[head, 0] - car[0], contacts.centre[head, 1] - car[1]
    x, y = cosine * wx + sine * wy, cosine * wy - sine * wx
    z = contacts.centre[head, 2]
    ux = motion.velocity[head, 0] - car[3] + car[5] * wy
    uy = motion.velocity[head, 1] - car[4] - car[5] * wx
    # Closing on the car: downwards onto hood or windscreen, or rearwards into its front.
    closing = -motion.velocity[head, 2] > HEAD_FALL or cosine * ux + sine * uy < -HEAD_SPEED
    for j in range(patch_count(front)):
        if contacts.segment_force[head, j] > HEAD_FORCE:
            return True
        margin = reach + HEAD_NEAR
        if closing and is_near(front, j, margin, x, y, z):
            return True
    return False
