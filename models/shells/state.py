"""State of a mesh of shells: nodes and four-node elements, three nodes where two are the same."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]

GAUSS = {
    1: ([0.0], [2.0]),
    3: ([-0.7745966692414834, 0.0, 0.7745966692414834],
        [0.5555555555555556, 0.8888888888888888, 0.5555555555555556]),
    5: ([-0.9061798459386640, -0.5384693101056831, 0.0, 0.5384693101056831, 0.9061798459386640],
        [0.2369268850561891, 0.4786286704993665, 0.5688888888888889, 0.4786286704993665,
         0.2369268850561891]),
}  # fmt: skip
"""Places and weights of the points through the thickness (Gauss-Legendre)."""


class Nodes(NamedTuple):
    """Motion of ``n`` nodes, world axes.

    Attributes
    ----------
    position : (n, 3) array
        m.
    velocity, spin : (n, 3) array
        At the middle of the step, m/s and rad/s.
    force, moment : (n, 3) array
        N and N m.
    mass : (n,) array
        kg.
    inertia : (n,) array
        Rotary inertia about every axis, kg m2.
    held : (n, 6) array of bool
        Whether translations and rotations along the axes are prevented.
    """

    position: Array
    velocity: Array
    spin: Array
    force: Array
    moment: Array
    mass: Array
    inertia: Array
    held: NDArray[np.bool_]


class Shells(NamedTuple):
    """Elements: ``m`` of them with ``p`` points through the thickness.

    Attributes
    ----------
    node : (m, 4) array
        Counterclockwise; a triangle repeats its last node.
    material : (m,) array
        Row of the material.
    thickness : (m,) array
        m, changes with the strain.
    place, weight : (p,) array
        Points over half the thickness, and their weights (sum 2).
    frame : (m, 3, 3) array
        Local axes, one a row.
    local : (m, 9) array
        Local x and y of the nodes, and the height of the first over the mean plane, m.
    stress : (m, p, 3) array
        xx, yy, xy in the local axes, Pa.
    plastic : (m, p) array
        Equivalent plastic strain.
    shear : (m, 2) array
        Mean transverse shear strains xz, yz.
    bow : (m, 6) array
        Hourglass resultants: membrane x, y (N), bending about y and x (N m), shear along the two
        natural axes (N).
    drill : (m, 4) array
        Rotation of the nodes about the normal against the element, rad.
    energy : (4,) array
        Work so far, J: through the thickness, transverse shear, hourglass, drilling.
    """

    node: Index
    material: Index
    thickness: Array
    place: Array
    weight: Array
    frame: Array
    local: Array
    stress: Array
    plastic: Array
    shear: Array
    bow: Array
    drill: Array
    energy: Array


WORK_SECTION, WORK_SHEAR, WORK_BOW, WORK_DRILL = range(4)
