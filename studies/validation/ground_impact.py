"""The head's impact on the road, compared with those of falling child dummies.

A robot ran into standing dummies, which fell and struck the ground with their heads (D.
Paez-Granados and A. Billard, 2022; digitised, not part of the project). Equal set-ups differ
up to 150-fold, so distributions are compared, not tests.
"""

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcstudy.figures import style
from mcstudy.figures.panels import Curve, Panel, draw_panels, use_log_scale
from mcstudy.tables import read_csv
from mcstudy.text import number
from models.protocol import complete_status
from models.registry import load_model
from studies.validation.check import Part, check
from studies.validation.sweep import sweep
from studies.validation.walkers import CENTRAL, SIDES

Array = NDArray[np.float64]

FILE = "dummy_ground_impact_summary.csv"
Q3 = {"age": 3.0, "stature": 0.95, "body_mass": 14.5, "head_mass": 2.8, "running_speed": 0.0}
"""A standing three-year-old, as heavy as the dummy [recalled]."""
SPEEDS = (1.0, 1.5, 3.1)
"""m/s of the robot."""
PHASES = tuple(np.arange(12) / 12.0)


def validate(workers: int, measured: Path) -> Part:
    """Return the part on the impact on the road.

    Raises
    ------
    UserError
        If the file is there but cannot be read.
    """
    path = measured / FILE
    if not path.exists():
        missing = f"Not run: {FILE} is not in the folder of measured data (option --measured)."
        keys = ("ground_hic_median", "ground_hic_range", "ground_hic_crash")
        return Part("Impact on the road", (missing,), [check(key, math.nan) for key in keys])
    table = read_csv(path, text=("dummy", "struck"))
    hic = table.numbers("hic15")
    measured_hic = np.sort(hic)
    child = hic[np.array(table.fields("dummy")) == "Q3"]
    crashes = sweep(
        [{**CENTRAL, "facing_angle": side, "gait_phase": float(phase)}
         for phase in PHASES for side in SIDES],
        workers=workers,
    )  # fmt: skip
    struck = np.sort(crashes["ground_hic15"].dropna().to_numpy())
    struck = struck[struck > 0.0]
    cases = [
        {**CENTRAL, **Q3, "impact_speed": v, "facing_angle": side, "gait_phase": float(phase)}
        for v in SPEEDS
        for phase in PHASES
        for side in SIDES
    ]
    runs = sweep(cases, workers=workers)
    complete = runs["status"].isin(complete_status(load_model("multibody")))
    ours = runs.loc[complete, "ground_hic15"].to_numpy()
    ours = np.sort(ours[ours > 0.0])
    within = [
        100.0 * float(np.mean((h >= measured_hic[0]) & (h <= measured_hic[-1])))
        for h in (ours, struck)
    ]
    low, high = (float(q) for q in np.quantile(ours, [0.05, 0.95]))
    checks = [
        check("ground_hic_median", float(np.median(ours) / np.median(child))),
        check("ground_hic_range", within[0]),
        check("ground_hic_crash", within[1]),
    ]
    words = (
        f"HIC15 of the head on the road: {len(measured_hic)} records of falling dummies from "
        f"{number(measured_hic[0])} to {number(measured_hic[-1])}, median of the three-year-old "
        f"dummy {number(float(np.median(child)))}; our {len(ours)} falls of a standing "
        "three-year-old, pushed by a car front at the robot's speeds, have a median of "
        f"{number(float(np.median(ours)))}, nine in ten {number(low)} to {number(high)}. The "
        "pushes differ (a robot's bumper, a car), and a falling person's arms protect; neither was "
        "calibrated. After a crash at 40 km/h the case's child meets the road with a median of "
        f"{number(float(np.median(struck)))}."
    )
    panel = Panel(
        "HIC15 on the road [–]",
        "share of falls below [–]",
        [
            Curve(measured_hic, _ranks(measured_hic), "17 dummy falls", "black", "", "o"),
            Curve(np.sort(child), _ranks(child), "three-year-old dummy", style.GREEN, "", "s"),
            Curve(ours, _ranks(ours), "ours, a three-year-old pushed", style.BLUE),
            Curve(struck, _ranks(struck), "ours, the case's child at 40 km/h", style.ORANGE),
        ],
        ylim=(0.0, 1.0),
        xlim=(5.0, 2e4),
        legend="upper left",
    )
    figure = draw_panels([panel], columns=1, width=6.4, height=4.2)
    use_log_scale(figure.axes[0], "x")
    return Part(
        "Impact on the road", (words,), checks, {"Distribution of HIC15 on the road.": figure}
    )


def _ranks(values: Array) -> Array:
    return (np.arange(values.size) + 0.5) / values.size
