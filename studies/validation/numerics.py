"""Step convergence and energy balance over the whole range of inputs."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import qmc

from mcstudy.figures import style
from mcstudy.figures.panels import Curve, Panel, draw_panels, use_log_scale
from mcstudy.text import number
from models.crash.model import TICK
from models.protocol import complete_status
from models.registry import load_model
from studies.validation.check import Part, check
from studies.validation.sweep import sweep

Array = NDArray[np.float64]

INSIDE, CORNERS = 48, 24
"""Cases inside the declared ranges and at their corners."""
SEED = 3
WIDEST = 0.8
"""m, largest lateral offset: further out the body misses the car."""
BUILD = (11.0, 50.0)
"""Body mass index (kg/m2)."""
HEAD_SHARE = (0.05, 0.25)
"""Head mass over body mass."""


def validate(workers: int) -> Part:
    """Return the part on numerics."""
    model = load_model("multibody")
    fine = {"tick": TICK / 4.0}
    nominal = {**model.run({}).outputs}
    quarter = {**load_model("multibody", fine).run({}).outputs}
    cases = _cases()
    coarse = sweep(cases, workers=workers)
    finer = sweep(cases, options=fine, workers=workers)
    complete = complete_status(model)
    ended = coarse["status"].isin(complete) & finer["status"].isin(complete)
    hic = _change(coarse, finer, "hic15", ended)
    throw = (coarse["throw_distance"] - finer["throw_distance"])[ended].abs().to_numpy()
    left = 100.0 * finer.loc[ended, "energy_residual"].abs()
    energy = 100.0 * coarse.loc[ended, "energy_residual"].abs().to_numpy()
    checks = [
        check("nominal_hic_step", 100.0 * (nominal["hic15"] / quarter["hic15"] - 1.0)),
        check("nominal_throw_step", nominal["throw_distance"] - quarter["throw_distance"]),
        check("range_hic_median", float(np.median(hic))),
        check("range_hic_worst", float(hic.max())),
        check("range_energy_median", float(np.median(energy))),
        check("range_energy_worst", float(energy.max())),
        check("range_complete", 100.0 * float(coarse["status"].isin(complete).mean())),
    ]
    counts = ", ".join(f"{n} {name}" for name, n in coarse["status"].value_counts().items())
    words = (
        f"{INSIDE} cases inside the declared ranges of all inputs at once and {CORNERS} at their "
        f"corners, before the car, with a body mass index of {BUILD[0]:.0f} to {BUILD[1]:.0f} and "
        "heads of 5 to 25 % of the body, far beyond any study: "
        f"speeds of {_span('impact_speed', 3.6)} km/h, statures of "
        f"{_span('stature')} m, friction of {_span('friction_body_road')}. They ended: {counts}. "
        f"With a quarter of the step HIC15 changes by {number(float(np.median(hic)), 2)} % "
        f"(median), {number(float(np.quantile(hic, 0.9)), 2)} % (nine in ten) and "
        f"{number(float(hic.max()), 2)} % at worst; throw by "
        f"{number(float(np.median(throw)), 2)} m (median) and {number(float(throw.max()), 2)} m at "
        "worst, as a tumbling body multiplies small differences. Energy not accounted for is "
        f"{number(float(np.median(energy)), 2)} % (median) and {number(float(energy.max()), 2)} % "
        "at worst of the largest work of one kind; with a quarter of the step at worst "
        f"{number(float(left.max()), 2)} %, "
        "so the residual is due to the time resolution of the hardest impacts on the road."
    )
    speed = 3.6 * coarse.loc[ended, "impact_speed"].to_numpy()
    panels = [
        Panel("impact speed [km/h]", label, [Curve(speed, np.maximum(values, floor), None,
                                                   style.BLUE, "", "o")])
        for label, values, floor in (
            ("change of HIC15 [%]", hic, 1e-3),
            ("change of throw [m]", throw, 1e-4),
            ("energy residual [%]", energy, 1e-3),
        )
    ]  # fmt: skip
    figure = draw_panels(panels, columns=3, width=3.6, height=3.2)
    for axes in figure.axes:
        use_log_scale(axes, "y")
    return Part(
        "Numerics",
        (words,),
        checks,
        {"Every case over the whole range; changes are those with a quarter of the step.": figure},
    )


def _span(name: str, scale: float = 1.0) -> str:
    item = next(i for i in load_model("multibody").inputs if i.name == name)
    return f"{number(scale * item.low, 2)} to {number(scale * item.high, 3)}"


def _cases() -> list[dict[str, float]]:
    """Return cases spread over the declared ranges and at their corners."""
    inputs = load_model("multibody").inputs
    low = np.array([item.low for item in inputs])
    high = np.array([item.high for item in inputs])
    inside = qmc.Sobol(len(inputs), rng=SEED).random(64)[:INSIDE]
    corners = np.random.default_rng(SEED).integers(0, 2, (CORNERS, len(inputs))).astype(float)
    unit = np.concatenate([inside, corners])
    rows = low + (high - low) * unit
    names = [item.name for item in inputs]
    cases = [dict(zip(names, row.tolist(), strict=True)) for row in rows]
    bounds = {item.name: (item.low, item.high) for item in inputs}
    for case, share in zip(cases, unit, strict=True):
        # In front of the car, or there is no crash; a possible build and head.
        place = dict(zip(names, share.tolist(), strict=True))
        case["lateral_offset"] = _between((-WIDEST, WIDEST), place["lateral_offset"])
        index = _between(BUILD, place["body_mass"])
        case["body_mass"] = float(np.clip(index * case["stature"] ** 2, *bounds["body_mass"]))
        head = _between(HEAD_SHARE, place["head_mass"]) * case["body_mass"]
        case["head_mass"] = float(np.clip(head, *bounds["head_mass"]))
    return cases


def _between(bounds: tuple[float, float], share: float) -> float:
    return bounds[0] + (bounds[1] - bounds[0]) * share


def _change(coarse: pd.DataFrame, fine: pd.DataFrame, name: str, rows: pd.Series) -> Array:
    """Return the changes (%) of an output with the step, where its value is not negligible."""
    old, new = coarse.loc[rows, name].to_numpy(), fine.loc[rows, name].to_numpy()
    # Below HIC 10 the contact is negligible and a relative change meaningless.
    return np.asarray(100.0 * np.abs(old - new) / np.maximum(new, 10.0))
