"""Speeds by hand from a throw distance, as reconstruction offices compute them."""

from dataclasses import dataclass

import numpy as np

from mcstudy.typed_json import Real
from studies.throw_formulae import happer_wrap, searle, toor_wrap
from studies.throw_formulae import toor_forward as toor_forward_of

FRICTIONS = (0.45, 0.66, 0.80)
"""Friction of a clothed body on a road: low, usual (Searle and Searle 1983) and high [recalled]."""
KMH = 3.6


@dataclass(frozen=True)
class HandSpeed:
    """A speed by a formula: name and source, low, middle and high (m/s)."""

    name: str
    source: str
    low: Real
    middle: Real
    high: Real


def hand_speeds(throw: float) -> list[HandSpeed]:
    """Return the speeds by hand formulae from a throw distance (m).

    Parameters
    ----------
    throw : float
        From first contact to rest, m.
    """
    ends = [searle(np.array(throw), friction) for friction in FRICTIONS]
    least, most = ([float(end[k]) for end in ends] for k in (0, 1))
    length = np.array(throw)
    toor, toor_forward, happer = (
        float(relation(length)) / KMH for relation in (toor_wrap, toor_forward_of, happer_wrap)
    )
    band = 7.0 / KMH
    return [
        HandSpeed(
            "Searle, least speed of projection",
            "Searle 1993, friction 0.45, 0.66 and 0.80",
            *least,
        ),
        HandSpeed(
            "Searle, greatest speed without upward projection",
            "Searle 1993, the same frictions",
            *most,
        ),
        HandSpeed(
            "Toor and Araszewski, wrap",
            "2003, 9.84 s^0.57 km/h, 15 to 85 % about 7 km/h [recalled]",
            toor - band, toor, toor + band,
        ),
        HandSpeed(
            "Toor and Araszewski, forward projection",
            "2003, 8.25 s^0.61 km/h, the same band [recalled]",
            toor_forward - band, toor_forward, toor_forward + band,
        ),
        HandSpeed(
            "Happer and others, wrap",
            "2000, 13.3 s^0.5 - 4.6 km/h [recalled]; band of the former",
            happer - band, happer, happer + band,
        ),
    ]  # fmt: skip
