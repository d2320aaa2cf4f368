"""Parts of the body: neck pendulum, blunt impacts, head drop, passive joint moments."""

import math

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mcstudy.figures import style
from mcstudy.figures.panels import Band, Curve, Panel, draw_panels
from mcstudy.text import number
from models.component.blunt_impact import BluntImpact, strike_region
from models.component.joint_moment import passive_moment
from models.component.neck_pendulum import PendulumTest, swing_neck
from models.component.neck_sled import SledTest, ride_sled
from models.criteria.units import STANDARD_GRAVITY
from models.pedestrian.anthropometry import HEAD, Body, build_body
from models.pedestrian.joints import Joints, build_joints
from models.pedestrian.tissue import build_tissue
from models.registry import load_model
from studies.validation.check import Part, check, references

Array = NDArray[np.float64]

FACTORS = (1.0, 1.5, 2.2, 3.0)
"""Neck stiffness factors besides the nominal one."""
DONOR = (49.0, 1.776, 69.9, 4.5)
"""Age, stature (m), mass (kg) of the five donors of Kang 2018 on average [found]; head (kg)
[recalled]."""
SLED_FACTORS = (0.5, 0.7, 1.0, 1.5)
"""Neck stiffness of the adult on the sled."""
SHARE = 0.23
"""Child over adult passive moment: modulus times length cubed [estimated]."""


def validate(workers: int) -> Part:
    """Return the part on parts of the body."""
    nominal = {item.name: item.nominal for item in load_model("multibody").inputs}
    table = references()
    six = build_body(6.0, 1.17, 23.4, 3.47)
    child = build_body(
        nominal["age"], nominal["stature"], nominal["body_mass"], nominal["head_mass"]
    )
    joints = build_joints(child, neck_stiffness=nominal["neck_stiffness"])
    tests = {
        direction: {
            factor: swing_neck(
                six, build_joints(six, neck_stiffness=factor), direction,
                table["neck_pulses"][direction]["speed"],
                np.array(table["neck_pulses"][direction]["lost"]),
            )
            for factor in (nominal["neck_stiffness"], *FACTORS)
        }
        for direction in ("flexion", "extension")
    }  # fmt: skip
    flexion = tests["flexion"][nominal["neck_stiffness"]]
    extension = tests["extension"][nominal["neck_stiffness"]]
    thorax = strike_region(child, joints, "chest", 3.5, 6.0)
    dummy = strike_region(six, build_joints(six), "chest", 2.86, 6.71)
    abdomen = strike_region(child, joints, "abdomen", 3.5, 6.3)
    moments, gap = _joint_moments(child, joints)
    donor = build_body(*DONOR)
    rides = {
        factor: ride_sled(
            donor, build_joints(donor, neck_stiffness=factor), np.array(table["neck_sled"]["pulse"])
        )
        for factor in SLED_FACTORS
    }
    ride = rides[1.0]
    checks = [
        check("neck_sled_rotation", math.degrees(ride.rotation.max())),
        check("neck_sled_time", 1e3 * float(ride.time[np.argmax(ride.rotation)])),
        check("neck_flexion_angle", math.degrees(flexion.angle.max())),
        check("neck_flexion_moment", flexion.moment.max()),
        check("neck_flexion_decay", 1e3 * flexion.decay_time(5.0)),
        check("neck_extension_angle", math.degrees(extension.angle.max())),
        check("neck_extension_moment", extension.moment.max()),
        check("thorax_force", thorax.force.max()),
        check("thorax_dummy_force", dummy.force.max()),
        check("thorax_dummy_deflection", 1e3 * dummy.deflection.max()),
        check("thorax_hysteresis", 100.0 * dummy.hysteresis),
        check("abdomen_force", abdomen.force.max()),
        check("abdomen_deflection", 1e3 * abdomen.deflection.max()),
        check("head_drop", _head_drop(child)),
        check("joint_moments", gap),
    ]
    figures = {
        "Neck pendulum of the 6-year-old dummy's test at several neck stiffnesses; green: the "
        "dummy's corridors of rotation, moment and decay.":
        draw_panels([panel for name, entry in tests.items() for panel in _neck_panels(name, entry)],
                    height=3.1),
        "Head and neck of adult donors on a sled (Kang 2018), our adult's at several neck "
        "stiffnesses; green: the donors' range of the largest rotation and its time.":
        _draw_sled(rides),
        "Blunt impacts from the front; green: donors (Ouyang) and dummy (572.124).":
        _draw_impacts(thorax, dummy, abdomen),
        "Passive moments: ours (stops of the child's range) and adult curves times 0.23; muscle "
        "tone and friction are left out.": draw_panels(moments, columns=3, width=3.6, height=3.1),
    }  # fmt: skip
    return Part("Parts of the body", _words(tests["flexion"], flexion), checks, figures)


def _words(tests: dict[float, PendulumTest], nominal: PendulumTest) -> list[str]:
    met = [
        f for f, test in tests.items()
        if check("neck_flexion_angle", math.degrees(test.angle.max())).verdict == "inside"
        and check("neck_flexion_moment", test.moment.max()).verdict == "inside"
        and check("neck_flexion_decay", 1e3 * test.decay_time(5.0)).verdict == "inside"
    ]  # fmt: skip
    inside = ", ".join(f"{f:g}" for f in met) or "none of those tried"
    return [
        "The neck pendulum is the certification test of a dummy. Our neck has the passive "
        "stiffness measured on volunteers of 5 to 7 years and was calibrated within its spread, "
        f"so it bends further ({number(math.degrees(float(nominal.angle.max())))} deg in "
        "flexion). The dummy's "
        f"three flexion numbers are met at neck stiffness {inside}.",
        "Pulse of the pendulum: middle of the regulation's velocity corridor [recalled]. Impactor "
        "masses of Ouyang's tests and the speed of the thorax test are [recalled].",
    ]


def _neck_panels(direction: str, tests: dict[float, PendulumTest]) -> list[Panel]:
    rows = references()["checks"]
    angle, moment = rows[f"neck_{direction}_angle"], rows[f"neck_{direction}_moment"]
    colours = dict(zip(tests, style.PALETTE, strict=False))
    whole = np.array([0.0, 200.0])
    panels = []
    for row, unit, label, histories in (
        (angle, "deg", "rotation of the head", [np.degrees(t.angle) for t in tests.values()]),
        (moment, "N m", "moment", [t.moment for t in tests.values()]),
    ):
        bands = [Band(whole, np.full(2, row["low"]), np.full(2, row["high"]),
                      "peak allowed", style.GREEN)]  # fmt: skip
        panels.append(
            Panel(
                "time [ms]", f"{label} [{unit}]",
                [Curve(1e3 * t.time, values, _name(f), colours[f])
                 for (f, t), values in zip(tests.items(), histories, strict=True)],
                bands, f"{direction}: {label}", (0.0, 200.0),
            )
        )  # fmt: skip
    return panels


def _draw_sled(rides: dict[float, SledTest]) -> Figure:
    rows = references()["checks"]
    when, how_far = rows["neck_sled_time"], rows["neck_sled_rotation"]
    band = Band(
        np.array([when["low"], when["high"]]), np.full(2, how_far["low"]),
        np.full(2, how_far["high"]), "donors' peak", style.GREEN,
    )  # fmt: skip
    curves = [
        Curve(1e3 * ride.time, np.degrees(ride.rotation), f"stiffness {factor:g}", colour)
        for (factor, ride), colour in zip(rides.items(), style.PALETTE, strict=False)
    ]
    panel = Panel("time [ms]", "rotation of the head [deg]", curves, [band], xlim=(0.0, 200.0))
    return draw_panels([panel], columns=1, width=5.2, height=3.4)


def _name(factor: float) -> str:
    return f"stiffness {factor:g}" + ("" if factor in FACTORS else ", nominal")


def _draw_impacts(thorax: BluntImpact, dummy: BluntImpact, abdomen: BluntImpact) -> Figure:
    rows = references()["checks"]

    def box(force: str, low: float, high: float, label: str) -> Band:
        return Band(np.array([low, high]), np.full(2, rows[force]["low"]),
                    np.full(2, rows[force]["high"]), label, style.GREEN)  # fmt: skip

    panels = [
        Panel(
            "deflection [mm]", "force [N]",
            [Curve(1e3 * impact.deflection, impact.force, "ours")], [band], title,
            (0.0, None), (0.0, None),
        )
        for title, impact, band in (
            ("thorax, donors", thorax, box("thorax_force", 0.0, 60.0, "peak force, mean ± sd")),
            ("thorax, dummy", dummy, box("thorax_dummy_force", 38.0, 46.0, "peak allowed")),
            ("abdomen, donors", abdomen, box("abdomen_force", 84.0, 114.0, "peak, mean ± sd")),
        )
    ]  # fmt: skip
    return draw_panels(panels, columns=3, width=3.6, height=3.1)


def _head_drop(child: Body) -> float:
    """Return the peak (g) of the head dropped 0.30 m on a rigid plate."""
    curve = build_tissue(child)["head"]
    model = load_model(
        "headform",
        {"hood_curve": curve.knots},
    )
    run = model.run(
        {"impact_speed": math.sqrt(2.0 * STANDARD_GRAVITY * 0.30),
         "headform_mass": float(child.mass[HEAD]), "hood_unloading_ratio": curve.unloading_ratio}
    )  # fmt: skip
    return float(run.outputs["peak_head_acceleration"])


def _joint_moments(child: Body, joints: Joints) -> tuple[list[Panel], float]:
    """Return the panels of hip, knee and ankle and the largest gap (deg) at the moments judged."""
    relaxed = joints._replace(friction=np.zeros_like(joints.friction))
    panels, gaps = [], []
    for name, row in references()["passive_moments"].items():
        k1, k2, k3, k4 = row["K"]
        first, second = row["theta"]
        first_angle, last_angle = row["degrees"]
        degrees = np.arange(float(first_angle), float(last_angle), 0.5)
        q = np.radians(degrees)
        adult = SHARE * (k1 * np.exp(k2 * (q - second)) + k3 * np.exp(k4 * (q - first)))
        ours = row["sign"] * passive_moment(child, relaxed, row["segment"], row["sign"] * q)
        for side in (-1.0, 1.0):
            level = side * row["level"]
            gaps.append(_reached(degrees, ours, level) - _reached(degrees, adult, level))
        panels.append(
            Panel(
                f"{row['positive']} [deg]", "moment [N m]",
                [Curve(degrees, ours, "ours"),
                 Curve(degrees, adult, "adult curve × 0.23", "black", "--")],
                (), name, (degrees[0], degrees[-1]), (-3.0 * row["level"], 3.0 * row["level"]),
            )
        )  # fmt: skip
    return panels, float(np.abs(gaps).max())


def _reached(degrees: Array, moment: Array, level: float) -> float:
    """Return the angle (deg) at which a moment that falls with the angle passes a level."""
    return float(np.interp(-level, -moment, degrees))
