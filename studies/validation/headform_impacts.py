"""Headform impacts against computed ones and closed forms, and HIC from corridors."""

import numpy as np
from numpy.typing import NDArray

from mcstudy.figures.panels import Curve, Panel, draw_panels
from mcstudy.figures.stiffness import draw_corridor
from mcstudy.figures.style import PALETTE
from models.contact.corridor import Corridor, load_corridors
from models.registry import load_model
from models.vehicle.profile import load_vehicle
from studies.stiffness_fit.analysis import COORDINATES, hic_corridor
from studies.validation.check import Part, check, references

Array = NDArray[np.float64]

SPEEDS = np.linspace(4.0, 14.0, 11)
"""m/s, of the exponents and the figure."""
FAR = 1.0
"""m, end of the curves of the table, beyond the penetration of all its impacts."""


def validate(workers: int) -> Part:
    """Return the part on headform impacts."""
    linear = {"hood_curve": [[0.0, 0.0], [FAR, 1e5]], "channel_class": 0.0}
    stiffness = 1e5 / FAR
    model = load_model("headform", linear)
    hic = [model.run({"impact_speed": v}).outputs["hic15"] for v in SPEEDS]
    masses = np.linspace(1.5, 5.0, 8)
    by_mass = [model.run({"headform_mass": m}).outputs["hic15"] for m in masses]
    once = model.run({})
    peak = once.inputs["impact_speed"] * np.sqrt(stiffness * once.inputs["headform_mass"])
    checks = [
        check("headform_table", 100.0 * _table_gap()),
        check("headform_speed_exponent", np.polyfit(np.log(SPEEDS), np.log(hic), 1)[0]),
        check("headform_mass_exponent", np.polyfit(np.log(masses), np.log(by_mass), 1)[0]),
        check("headform_peak", once.outputs["peak_force"] / peak),
        check("headform_energy", _largest_residual()),
        check("drop_on_steel", _drop()),
    ]
    hoods = {
        "working curves": load_corridors("working_curves")["hood"],
        "the case's hood": _zone("family_car_1990s", "hood"),
    }
    panels = [
        Panel(
            "impact speed [km/h]",
            "HIC15 [–]",
            [
                Curve(3.6 * SPEEDS, _over_speed(corridor, at), f"{word} of {name}", PALETTE[2 * k],
                      line)
                for k, (name, corridor) in enumerate(hoods.items())
                for at, word, line in (
                    (0.0, "lower", ":"), (0.5, "median", "-"), (1.0, "upper", "--")
                )
            ],
            ylim=(0.0, 4000.0),
            title="child headform 2.5 kg, perpendicular",
        ),
        Panel(
            "impact speed [km/h]",
            "HIC15 [–]",
            [
                Curve(3.6 * SPEEDS, np.array(hic), "100 kN/m, ours"),
                Curve(3.6 * SPEEDS, hic[0] * (SPEEDS / SPEEDS[0]) ** 2.5, "v to the power 2.5",
                      "black", "", "o"),
            ],
            title="linear hood",
        ),
    ]  # fmt: skip
    figures = {
        "HIC15 of the headform test over speed: corridors of hoods, and the power law of a linear "
        "one.": draw_panels(panels),
    }
    for name, corridor in hoods.items():
        figures[
            f"Corridors of {name}: stiffness (left) and the resulting HIC15 (right) "
            "in the case's test (30 km/h) and in the regulation's (child 2.5 kg, "
            "40 km/h; 3.5 kg, 35 km/h)."
        ] = draw_corridor(
            {k: (getattr(corridor, k).penetration, getattr(corridor, k).force)
             for k in ("lower", "median", "upper")},
            [],
            COORDINATES,
            {f"{3.6 * v:.0f} km/h, {m} kg": hic_corridor(corridor, v, m)
             for v, m in ((30 / 3.6, 2.5), (40 / 3.6, 2.5), (35 / 3.6, 3.5))},
        )  # fmt: skip
    return Part(
        "Headform impacts",
        (
            "A free headform on one zone of the car, by the law that the crash core uses for the "
            "head on the hood.",
        ),
        checks,
        figures,
    )


def _table_gap() -> float:
    """Return the largest relative deviation from the computed table."""
    table = references()["headform_table"]
    worst = 0.0
    for row in table["rows"]:
        model = load_model("headform", {"hood_curve": row["curve"], "channel_class": 0.0})
        for (mass, speed), expected in zip(table["conditions"], row["expected"], strict=True):
            outputs = model.run(
                {"headform_mass": mass, "impact_speed": speed, "hood_unloading_ratio": 8.0}
            ).outputs
            ours = [outputs["peak_head_acceleration"], outputs["clip_3ms"], outputs["hic15"],
                    1e3 * outputs["hood_intrusion"]]  # fmt: skip
            # The table is rounded to whole numbers: half a unit is no deviation.
            gaps = np.maximum(np.abs(np.array(ours) - expected) - 0.5, 0.0) / expected
            worst = max(worst, float(gaps.max()))
    return worst


def _largest_residual() -> float:
    residuals = [
        abs(model.run({"impact_speed": v, "impact_angle": a}).outputs["energy_residual"])
        for zone in ("hood", "hood_edge", "windscreen")
        for model in (load_model("headform", {"zone": zone}),)
        for v in (2.0, 8.0, 20.0)
        for a in (0.0, 0.4, 1.0)
    ]
    return max(residuals)


def _drop() -> float:
    model = load_model("headform", {"hood_curve": [[0.0, 0.0], [0.001, 1e6]], "skin": "vinyl",
                                    "headform": "gtr_child"})  # fmt: skip
    outputs = model.run({"impact_speed": float(np.sqrt(2.0 * 9.80665 * 0.376))}).outputs
    return outputs["peak_head_acceleration"]


def _over_speed(corridor: Corridor, at: float) -> Array:
    curve = corridor.curve(at)
    model = load_model("headform", {"hood_curve": curve.knots})
    ratio = curve.unloading_ratio
    return np.array(
        [model.run({"impact_speed": float(v), "hood_unloading_ratio": ratio}).outputs["hic15"]
         for v in SPEEDS]
    )  # fmt: skip


def _zone(vehicle: str, zone: str) -> Corridor:
    car = load_vehicle(vehicle)
    return car.zones[car.zone_index(zone)].corridor
