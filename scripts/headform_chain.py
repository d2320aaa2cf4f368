"""The case's chain from the headform test to the crash models, with its figure 5.

Run as ``python -m scripts.headform_chain``. A headform strikes the hood of finite elements as the
case's did (2.5 kg, 30 km/h, perpendicular, 580 mm behind the edge, 120 mm from the fender); the
force-penetration curve of its acceleration is fitted, and multibody (plane), facet and
finite-element headforms repeat the test with it; then both crash models run the nominal case. The
pulse of the case's own test is not published as numbers.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np

from mcstudy.figures import style
from mcstudy.figures.panels import Curve, Panel, draw_panels
from models.criteria import clip_level, head_injury_criterion
from models.criteria.units import STANDARD_GRAVITY
from models.headform.facet_target import FacetTarget
from models.headform.identification import StiffnessFit, fit_stiffness
from models.headform.model import HeadformModel
from models.protocol import History, Run
from models.registry import load_model
from models.vehicle.surface.wrap import leading_edge_distance, section

FOLDER = Path("results/headform_chain")
SPEED, MASS = 30.0 / 3.6, 2.5
BEHIND, BESIDE = 0.58, 0.12
"""Place of the head's dent: behind the hood's edge and from the fender, m [found]."""
CHANNEL_CLASS = 1000.0
OUTPUTS = ("hic15", "clip_3ms", "wad", "throw_distance", "head_impact_angle", "hood_intrusion")


def place() -> dict[str, float]:
    """Return the inputs of the case's headform test."""
    surface = load_model("headform", {"surface": "facet"})
    assert isinstance(surface, HeadformModel)
    target = surface.target
    assert isinstance(target, FacetTarget)
    side = target.vehicle.hood_side - BESIDE
    edge = leading_edge_distance(section(target.mesh, side))
    point = target.impact_point(edge + BEHIND, side)
    assert point is not None
    return {
        "impact_speed": SPEED,
        "wrap_around_distance": edge + BEHIND,
        "lateral_position": side,
        "impact_elevation": math.atan2(point.normal[2], point.normal[0]),
    }


def pulse(run: Run) -> History:
    """Return the head's history of a run."""
    assert run.status in ("ok", "hourglass"), run.status
    return run.histories["head"]


def fit(history: History) -> StiffnessFit:
    """Return the force-penetration law of a headform's recorded acceleration."""
    signal = history.channels["acceleration_normal"]
    return fit_stiffness(history.time, signal, SPEED, MASS, channel_class=CHANNEL_CLASS, draws=50)


def numbers(history: History) -> list[str]:
    """Return peak, 3 ms, HIC15 and rebound of a pulse for a table."""
    g, time = history.channels["acceleration"], history.time
    hic = head_injury_criterion(time, g, 0.015)[0]
    change = STANDARD_GRAVITY * float(np.trapezoid(history.channels["acceleration_normal"], time))
    return [f"{g.max():.0f} g", f"{clip_level(time, g):.0f} g", f"{hic:.0f}",
            f"{change - SPEED:.1f} m/s"]  # fmt: skip


def main() -> None:
    """Run the chain, print its tables and write its figure and curve."""
    inputs = place()
    shells = load_model("headform", {"surface": "fem"}).run(inputs)
    law = fit(pulse(shells))
    knots = law.curve.knots
    plane = load_model("headform", {"hood_curve": knots})
    facet = load_model("headform", {"surface": "facet", "hood_curve": knots})
    ratio = {"hood_unloading_ratio": law.curve.unloading_ratio}
    runs: dict[str, Run] = {
        "finite elements": shells,
        "plane (multibody), fitted curve": plane.run({"impact_speed": SPEED, **ratio}),
        "facets, fitted curve": facet.run(inputs),
    }
    print(f"{'headform, 30 km/h':34} {'peak':>8} {'3 ms':>8} {'HIC15':>8} {'rebound':>9}")
    for label, run in runs.items():
        print(f"{label:34} " + " ".join(f"{v:>8}" for v in numbers(pulse(run))))
    print(f"\nfitted curve, m and N: {[[round(d, 4), round(f)] for d, f in knots]}")
    print(f"unloading ratio {law.curve.unloading_ratio:.1f}\n")
    print(f"{'nominal case':34} " + " ".join(f"{name:>18}" for name in OUTPUTS))
    for name in ("multibody", "facet"):
        for label, options in (("data file", {}), ("fitted curve", {"hood_curve": knots})):
            found: dict[str, Any] = dict(load_model(name, options).run({}).outputs)
            row = " ".join(f"{found[output]:>18.4g}" for output in OUTPUTS)
            print(f"{name + ', ' + label:34} {row}")
    curves = [
        Curve(1000.0 * pulse(run).time, pulse(run).channels["acceleration"], label, colour)
        for (label, run), colour in zip(runs.items(), style.PALETTE, strict=False)
    ]
    depth = np.linspace(0.0, knots[-1][0], 100)
    panels = [
        Panel("time after first contact [ms]", "head acceleration [g]", curves,
              title="2.5 kg, 30 km/h, on the place of the head's dent", xlim=(-1.0, 20.0)),
        Panel("penetration [mm]", "force [kN]",
              [Curve(1000.0 * depth, 1e-3 * law.curve.at(depth), "fitted to finite elements")],
              title="fitted loading curve"),
    ]  # fmt: skip
    style.save({"pulses": draw_panels(panels)}, FOLDER)
    print(f"\npicture: {FOLDER / 'pulses.png'}")


if __name__ == "__main__":
    main()
