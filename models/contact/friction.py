"""Coulomb friction, regularised so that it is defined at rest."""

import math

from models.compilation import inlined_kernel

SLIP_VELOCITY = 0.1
"""Slip (m/s) at which Coulomb friction reaches 71 % of its bound (regularisation, assumed)."""
SLIP_RATE = 600.0
"""Largest friction coefficient per mass (1/s): keeps the regularised friction of a light body
in a hard impact slower than the step (assumed)."""

STICKING = 0.2
"""Largest share of a node's momentum along a sheet of shells that friction takes in a step
(assumed): keeps a light node from being thrown back and forth."""


@inlined_kernel
def friction_coefficient(mu, normal, slip_square, mass):
    """Return regularised Coulomb friction as force over slip velocity (N s/m).

    Parameters
    ----------
    mu : float
        Coefficient of friction.
    normal : float
        Normal force, N.
    slip_square : float
        Square of the slip velocity, m2/s2.
    mass : float
        Mass of the segment, kg; bounds the coefficient by ``SLIP_RATE``.
    """
    c = mu * normal / math.sqrt(slip_square + SLIP_VELOCITY * SLIP_VELOCITY)
    return min(c, SLIP_RATE * mass)
