"""The standing reference child: mass, centre of gravity, inertia, shares of the segments."""

import numpy as np
from numpy.typing import NDArray

from mcstudy.figures import style
from mcstudy.figures.panels import Curve, Panel, draw_panels
from models.pedestrian.anthropometry import SEGMENTS, Body, build_body, region_of
from studies.validation.check import Part, check
from studies.validation.head_impact import STATURES
from studies.validation.walkers import child_of_stature

Array = NDArray[np.float64]

GROUPS = {
    "head": ("head", "neck"),
    "torso": ("chest", "abdomen", "hip"),
    "legs": ("thigh", "shank", "foot"),
    "arms": ("upper_arm", "forearm"),
}
REFERENCE = (7.0, 1.22, 23.20, 3.26)
"""Age, stature (m), body and head mass (kg) of the data sheet's body."""


def validate(workers: int) -> Part:
    """Return the part on the standing child."""
    body = build_body(*REFERENCE)
    share = {name: 100.0 * _share(body, regions) for name, regions in GROUPS.items()}
    checks = [
        check("body_mass", body.mass.sum()),
        check("centre_of_gravity", _centre(body) / body.stature),
        check("gyration", _gyration(body) / body.stature),
        *(check(f"share_{name}", value) for name, value in share.items()),
    ]
    children = [child_of_stature(float(h)) for h in STATURES]
    bodies = [build_body(c["age"], c["stature"], c["body_mass"], 3.26) for c in children]
    panels = [
        Panel("stature [m]", "centre of gravity over stature [–]",
              [Curve(STATURES, np.array([_centre(b) / b.stature for b in bodies]), "ours"),
               Curve(STATURES, np.full(STATURES.size, 0.572), "data sheet", "black", "--")],
              ylim=(0.54, 0.60)),
        Panel("stature [m]", "radius of gyration over stature [–]",
              [Curve(STATURES, np.array([_gyration(b) / b.stature for b in bodies]), "ours"),
               Curve(STATURES, np.full(STATURES.size, 0.2415), "data sheet", "black", "--")],
              ylim=(0.22, 0.26)),
        Panel("stature [m]", "share of body mass [%]",
              [Curve(STATURES, np.array([100.0 * _share(b, regions) for b in bodies]), name,
                     style.PALETTE[k]) for k, (name, regions) in enumerate(GROUPS.items())],
              ylim=(0.0, 50.0)),
    ]  # fmt: skip
    caption = "Median boys of 1.10 to 1.40 m with the case's head mass."
    return Part(
        "Standing child",
        ("The body from which every pedestrian is scaled, upright.",),
        checks,
        {caption: draw_panels(panels, columns=3, width=3.6, height=3.0)},
    )


def _share(body: Body, regions: tuple[str, ...]) -> float:
    rows = [region_of(name) in regions for name in SEGMENTS]
    return float(body.mass[rows].sum() / body.mass.sum())


def _centre(body: Body) -> float:
    """Return the height (m) of the centre of gravity."""
    return float(body.mass @ body.centre[:, 2] / body.mass.sum())


def _gyration(body: Body) -> float:
    """Return the radius of gyration (m) about the transverse axis through the centre."""
    away = body.centre[:, [0, 2]] - np.array(
        [body.mass @ body.centre[:, 0] / body.mass.sum(), _centre(body)]
    )
    inertia = body.inertia[:, 1].sum() + body.mass @ (away**2).sum(axis=1)
    return float(np.sqrt(inertia / body.mass.sum()))
