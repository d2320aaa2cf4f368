"""Where, when and how the head meets the car, over speed and stature."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mcstudy.figures import style
from mcstudy.figures.panels import Band, Curve, Panel, draw_panels
from mcstudy.text import number
from models.registry import load_model
from models.vehicle.profile import load_vehicle
from studies.validation.check import Part, check, references
from studies.validation.sweep import sweep
from studies.validation.walkers import CENTRAL, CHILD, SIDES, child_of_stature

Array = NDArray[np.float64]

SPEEDS = np.arange(20.0, 61.0, 5.0)
"""km/h."""
STATURES = np.arange(1.10, 1.401, 0.05)
"""m."""
PHASES = (0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875)
P6 = {"age": 6.0, "stature": 1.17, "body_mass": 22.0, "running_speed": 0.0}
"""The P6 dummy [found: Schejbalova 2012], standing."""


def validate(workers: int) -> Part:
    """Return the part on head impact."""
    postures = [{"gait_phase": p, "facing_angle": side} for p in PHASES for side in SIDES]
    by_speed = sweep(
        [{**CENTRAL, **CHILD, **posture, "impact_speed": v / 3.6}
         for v in SPEEDS for posture in postures],
        workers=workers,
    )  # fmt: skip
    by_stature = sweep(
        [{**CENTRAL, **child_of_stature(float(h)), **posture}
         for h in STATURES for posture in postures],
        workers=workers,
    )  # fmt: skip
    slow = sweep(
        [{**CENTRAL, **P6, **posture, "impact_speed": v / 3.6}
         for v in (10.0, 20.0, 30.0) for posture in postures[::2]],
        workers=workers,
    )  # fmt: skip
    for table in (by_speed, by_stature):
        table["speed_ratio"] = table["head_impact_speed"] / table["impact_speed"]
        table["normal_speed"] = table["head_impact_speed"] * np.sin(table["head_impact_angle"])
        # A horizontal blow meets the hood at the hood's own slope.
        table["angle"] = np.degrees(table["head_impact_angle"] - hood_slope())
        table["wad_ratio"] = table["wad"] / table["stature"]
        table["mass_ratio"] = table["effective_head_mass"] / table["head_mass"]
        table["time_ms"] = 1e3 * table["head_impact_time"]
    at_forty = by_speed[np.isclose(by_speed["impact_speed"], 40.0 / 3.6)]
    nominal = load_model("multibody").run({})
    worst = slow.groupby("impact_speed")[["hic15", "clip_3ms"]].median().max()
    tall = {h: by_stature[np.isclose(by_stature["stature"], h)] for h in (1.10, 1.40)}
    checks = [
        check("head_impact_time", at_forty["time_ms"].median()),
        check("head_speed_ratio", at_forty["speed_ratio"].median()),
        check("head_normal_speed", at_forty["normal_speed"].median()),
        check("head_angle_ihra", at_forty["angle"].median()),
        check("head_angle_case", np.degrees(nominal.outputs["head_impact_angle"])),
        check("wad_ratio", at_forty["wad_ratio"].median()),
        check("wad_ratio_short", tall[1.10]["wad_ratio"].median()),
        check("wad_ratio_tall", tall[1.40]["wad_ratio"].median()),
        check(
            "effective_mass_ratio",
            nominal.outputs["effective_head_mass"] / nominal.inputs["head_mass"],
        ),
        check("effective_mass_case", nominal.outputs["effective_head_mass"]),
        check("effective_mass_postures", at_forty["mass_ratio"].median()),
        check("angular_velocity_case", nominal.outputs["head_angular_velocity"]),
        check("angular_acceleration_case", nominal.outputs["head_angular_acceleration"]),
        check("clip_case", nominal.outputs["clip_3ms"]),
        check("hood_case", 1e-3 * _hood_slope()),
        check("pelvis_speed", _pelvis_speed()),
        check("low_speed_hic", worst["hic15"]),
        check("low_speed_3ms", worst["clip_3ms"]),
    ]
    caption = (
        "Head impact of the child over speed (left) and at 40 km/h over stature (right): "
        "every run (points: eight phases of the gait, both sides), median, and the reference."
    )
    return Part(
        "Head impact",
        _words(by_speed, by_stature),
        checks,
        {caption: _draw(by_speed, by_stature)},
    )


def hood_slope() -> float:
    """Return the slope (rad) of the nominal car's hood with its dive."""
    vehicle = load_vehicle("family_car_1990s")
    direction = vehicle.zones[vehicle.zone_index("hood")].direction
    dive = load_model("multibody").inputs
    angle = next(item.nominal for item in dive if item.name == "dive_angle")
    return float(np.arctan2(direction[1], -direction[0])) - angle


def _hood_slope() -> float:
    """Return the slope (N/m) of the nominal hood's loading curve."""
    car = load_vehicle("family_car_1990s")
    curve = car.zones[car.zone_index("hood")].corridor.curve(0.5)
    return float(curve.force[1] / curve.penetration[1])


def _pelvis_speed() -> float:
    """Return the mean forward speed of the hip from 40 to 60 ms over the car's at that time."""
    scene = load_model("multibody").run({}).scene
    assert scene is not None
    hip = scene.centre[:, scene.names.index("hip"), 0]
    k = [int(np.argmin(np.abs(scene.time - t))) for t in (0.04, 0.06)]
    return float((hip[k[1]] - hip[k[0]]) / (scene.car[k[1], 0] - scene.car[k[0], 0]))


_ROWS = (
    ("time_ms", "head impact time [ms]", "head_impact_time"),
    ("speed_ratio", "head speed over car speed [–]", "head_speed_ratio"),
    ("angle", "head angle from the horizontal [deg]", "head_angle_ihra"),
    ("wad_ratio", "WAD over stature [–]", "wad_ratio"),
)


def _draw(by_speed: pd.DataFrame, by_stature: pd.DataFrame) -> Figure:
    panels = []
    for column, label, key in _ROWS:
        row = references()["checks"][key]
        for table, x, values, xlabel in (
            (by_speed, 3.6 * by_speed["impact_speed"], SPEEDS, "impact speed [km/h]"),
            (by_stature, by_stature["stature"], STATURES, "stature [m]"),
        ):
            at = x.to_numpy()
            median = np.array(
                [np.nanmedian(table[column].to_numpy()[np.isclose(at, v)]) for v in values]
            )
            # The references hold at 40 km/h.
            where = np.array([38.0, 42.0]) if xlabel.startswith("impact") else values[[0, -1]]
            panels.append(
                Panel(
                    xlabel,
                    label,
                    [
                        Curve(at, table[column].to_numpy(), "runs", style.SKY, "", "."),
                        Curve(values, median, "median", style.BLUE, "-", "o"),
                    ],
                    [Band(where, np.full(2, row["low"]), np.full(2, row["high"]),
                          f"reference [{row['label']}]", style.GREEN)],
                )
            )  # fmt: skip
    return draw_panels(panels, height=2.9)


def _words(by_speed: pd.DataFrame, by_stature: pd.DataFrame) -> list[str]:
    held = by_stature[np.isfinite(by_stature["wad"])]
    slope = np.polyfit(held["stature"], held["wad"], 1)
    times = by_speed.groupby("impact_speed")["time_ms"].median()
    return [
        "A child struck by the middle of a car that goes straight, over speed and, at 40 km/h, "
        "over the stature of median boys. Unlike the case, which is one posture at the car's "
        "corner, this is the median over postures. "
        f"Head impact time falls from {number(float(times.iloc[0]))} ms at "
        f"{SPEEDS[0]:.0f} km/h to {number(float(times.iloc[-1]))} ms at {SPEEDS[-1]:.0f} km/h; "
        f"WAD grows by {number(100.0 * float(slope[0]) / 10.0, 2)} cm for each 10 cm of stature."
    ]
