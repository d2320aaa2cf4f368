"""Hood inertia: the headform accelerates a mass of the hood over the first millimetres.

The mass moved up to penetration x, ``mass * (1 - exp(-(x / depth)^2))``, has the headform's speed,
so the headform loses momentum to it (an inelastic impact, spread over the penetration). The mass
stays with the headform until they separate. In the free form it is picked up at a rate per
penetration that is linear between places, with weights of its own at each. Behind a local spring
and damper the mass moves on its own.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from models.contact.headform import HeadformContact

REACH, KNOTS = 4.0, 33
"""Penetration over the depth up to which mass is picked up, and places of its table."""
PLACES = (0.0, 0.002, 0.004, 0.006, 0.008, 0.01, 0.012, 0.015, 0.02)
"""Penetrations (m) of the weights of the free form: 1 at the first, 0 at the last."""
WEIGHTS = tuple(f"at_{round(1000 * place)}_mm" for place in PLACES[1:-1])


def apply(contact: HeadformContact, parameters: Mapping[str, float]) -> HeadformContact:
    """Return the contact with the effect."""
    mass, depth = parameters["mass"], parameters["depth"]
    if parameters["stiffness"] > 0.0:
        critical = 2.0 * np.sqrt(parameters["stiffness"] * mass)
        return replace(
            contact,
            part_mass=mass,
            part_stiffness=parameters["stiffness"],
            part_damping=parameters["damping_ratio"] * critical,
        )
    weights = [parameters[name] for name in WEIGHTS]
    if any(weights):
        places = np.array(PLACES)
        growth = np.array([1.0, *weights, 0.0])
    else:
        places = depth * np.linspace(0.0, REACH, KNOTS)
        growth = places * np.exp(-((places / depth) ** 2))
        growth[-1] = 0.0
    growth = mass * growth / np.trapezoid(growth, places)
    return replace(contact, pickup=np.stack([places, growth], axis=1))
