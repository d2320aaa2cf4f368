"""Contact stiffness of body regions, scaled from the 7-year-old reference."""

import functools

import numpy as np

from models import data
from models.contact.law import ForceCurve
from models.pedestrian.anthropometry import SEGMENTS, Body
from models.pedestrian.scaling import Scale, scale_between


@functools.cache
def _reference_curves() -> dict[str, ForceCurve]:
    curves = {}
    for region, row in data.load("pedestrians/tissue.toml")["regions"].items():
        knots = np.array(row["curve"])
        curves[region] = ForceCurve(knots[:, 0].copy(), knots[:, 1].copy(), row["unloading_ratio"])
    return curves


def build_tissue(body: Body) -> dict[str, ForceCurve]:
    """Return the force-penetration curve of every body region."""
    reference = data.load("pedestrians/segments.toml")["child_7y"]
    scale = scale_between(body.stature, body.age, reference["stature"], reference["age"])
    even = Scale(scale.length)
    rows = data.load("pedestrians/tissue.toml")["regions"]
    scaled = {}
    for region, curve in _reference_curves().items():
        by = even if rows[region].get("same_modulus", False) else scale
        scaled[region] = curve.scaled(force=by.force, penetration=by.length)
    return scaled


@functools.cache
def self_contact_pairs() -> tuple[tuple[int, int], ...]:
    """Return the pairs of segments (rows of ``SEGMENTS``) that can touch each other."""
    pairs = []
    for first, second in data.load("pedestrians/tissue.toml")["self_contact"]["pairs"]:
        sides = ("left", "right") if "side" in first + second else ("",)
        for side in sides:
            names = [name.replace("side", side) for name in (first, second)]
            pairs.append((SEGMENTS.index(names[0]), SEGMENTS.index(names[1])))
    return tuple(pairs)
