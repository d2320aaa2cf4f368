"""Hub impacts on thorax, abdomen and pelvis of adults, compared with measured ones.

Lateral and oblique impacts of 14 donors by a pendulum of 23.4 kg (D. Viano, SAE 892432, 1989;
digitised data that are not part of the project) are simulated one by one: the body has the age,
stature and mass of the donor, and the speed is the test's. Frontal impacts: the corridors of
Lebarbe 2012 and a median man.
"""

import math
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mcstudy.errors import UserError
from mcstudy.figures import style
from mcstudy.figures.panels import Curve, Panel, draw_panels
from mcstudy.tables import read_csv
from mcstudy.text import number
from models.component.blunt_impact import strike_region
from models.pedestrian.anthropometry import build_body
from models.pedestrian.joints import build_joints
from studies.validation.check import Check, Part, check

Array = NDArray[np.float64]

FILE = "viano1989_pmhs_lateral_hub_summary.csv"
HUB = 23.4
"""kg [found: Viano 1989]."""
REGIONS = {
    "thorax_oblique_30deg": ("thorax", "chest", math.radians(60.0)),
    "abdomen_oblique_30deg": ("abdomen", "abdomen", math.radians(60.0)),
    "pelvis_lateral": ("pelvis", "hip", math.radians(90.0)),
}
"""By region of the file its name, our segment, and the side that the hub comes from: 30 degrees
forward of lateral, and lateral [found]."""
SPEEDS = {
    "thorax": (4.4, 6.5, 9.5),
    "abdomen": (4.8, 6.8, 9.4),
    "pelvis": (5.2, 9.8),
}
"""Nominal speeds (m/s) of the groups of tests."""
COLUMNS = ("nominal_speed_m_s", "speed_used_m_s", "age_y", "stature_m", "mass_kg", "peak_force_kN")
MEDIAN_MAN = (50.0, 1.74, 75.7)
"""Years, m, kg."""


def validate(workers: int, measured: Path) -> Part:
    """Return the part on trunk impacts.

    Raises
    ------
    UserError
        If the file is there but cannot be read.
    """
    man = build_body(*MEDIAN_MAN)
    frontal = {v: strike_region(man, build_joints(man), "chest", HUB, v) for v in (4.3, 6.7)}
    checks = [
        check("frontal_hub_slow", 1e-3 * frontal[4.3].force.max()),
        check("frontal_hub_fast", 1e-3 * frontal[6.7].force.max()),
    ]
    path = measured / FILE
    if not path.exists():
        missing = f"Lateral hubs not run: {FILE} is not in the folder of measured data."
        lateral = [
            check(_key(name, v), math.nan) for name, speeds in SPEEDS.items() for v in speeds
        ]
        return Part("Trunk impacts", (missing,), [*checks, *lateral])
    table = _simulate(_read(path))
    lateral = [
        check(_key(name, v), _group(table, name, v)["ours"].median())
        for name, speeds in SPEEDS.items()
        for v in speeds
    ]
    caption = (
        "Peak force of hub impacts over speed: 32 donors (Viano 1989) and our body of each "
        "donor's age, stature and mass."
    )
    return Part(
        "Trunk impacts", _words(table, lateral), [*checks, *lateral], {caption: _draw(table)}
    )


def _key(name: str, speed: float) -> str:
    return f"hub_{name}_{10.0 * speed:.0f}"


def _read(path: Path) -> pd.DataFrame:
    text = read_csv(path, text=("region", "cadaver", "sex"))
    numbers = pd.DataFrame({name: text.numbers(name) for name in COLUMNS})
    try:
        region = [REGIONS[name][0] for name in text.fields("region")]
    except KeyError as error:
        raise UserError(
            f"{path}: column 'region': {error} is none of {', '.join(REGIONS)}"
        ) from None
    if not np.isfinite(numbers.to_numpy()).all():
        raise UserError(f"{path}: {', '.join(COLUMNS)} must be numbers in every row")
    return numbers.assign(region=region)


def _simulate(table: pd.DataFrame) -> pd.DataFrame:
    """Return the tests with our peak force (kN) of each."""
    places = {name: (segment, side) for name, segment, side in REGIONS.values()}
    peaks = []
    columns = ["age_y", "stature_m", "mass_kg", "speed_used_m_s"]
    for region, row in zip(table["region"], table[columns].to_numpy(dtype=float), strict=True):
        age, stature, mass, speed = (float(value) for value in row)
        body = build_body(age, stature, mass)
        segment, side = places[region]
        impact = strike_region(body, build_joints(body), segment, HUB, speed, side)
        peaks.append(1e-3 * float(impact.force.max()))
    return table.assign(ours=peaks)


def _group(table: pd.DataFrame, name: str, speed: float) -> pd.DataFrame:
    return table[(table["region"] == name) & np.isclose(table["nominal_speed_m_s"], speed)]


def _words(table: pd.DataFrame, checks: list[Check]) -> list[str]:
    ratio = (table["ours"] / table["peak_force_kN"]).to_numpy()
    low, middle, high = (float(q) for q in np.quantile(ratio, [0.05, 0.5, 0.95]))
    inside = sum(c.verdict == "inside" for c in checks)
    return [
        "A flat hub of 23.4 kg strikes the free, upright body; each of the 32 tests is simulated "
        "with a body of the donor's age, stature and mass at the test's speed. Median peak forces "
        "must lie within the tests' range and within 25 % of their median: "
        f"{inside} of {len(checks)} do. Over single tests ours is {number(middle, 2)} times the "
        f"measured peak (median; {number(low, 2)} to {number(high, 2)} in nine of ten).",
        "The curves of chest, abdomen and hip were fitted by eye to these medians, the dummy's "
        "and the child donors' tests: for them this is a calibration, not a prediction.",
    ]


def _draw(table: pd.DataFrame) -> Figure:
    panels = []
    for name in SPEEDS:
        rows = table[table["region"] == name]
        speed = rows["speed_used_m_s"].to_numpy()
        panels.append(
            Panel(
                "impact speed [m/s]",
                "peak force [kN]",
                [
                    Curve(speed, rows["peak_force_kN"].to_numpy(), "donors", "black", "", "o"),
                    Curve(speed, rows["ours"].to_numpy(), "ours", style.BLUE, "", "s"),
                ],
                (),
                name,
                (0.0, None),
                (0.0, None),
            )
        )
    return draw_panels(panels, columns=3, width=3.6, height=3.2)
