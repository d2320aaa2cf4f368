"""Throw distance over speed against formulas of the accident literature."""

from collections.abc import Callable

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy.figures import style
from mcstudy.figures.panels import Band, Curve, Panel, draw_panels
from mcstudy.text import number
from models.criteria.units import STANDARD_GRAVITY
from studies.throw_formulae import happer_wrap, toor_forward, toor_wrap, wood_simms
from studies.validation.check import Part, check
from studies.validation.separation import median_searle_ratio, separations, share_within_searle
from studies.validation.sweep import sweep
from studies.validation.walkers import ADULT, CENTRAL, CHILD, SIDES

Array = NDArray[np.float64]

SPEEDS = np.arange(20.0, 71.0, 10.0)
"""km/h."""
FRICTIONS = (0.5, 0.6, 0.7)
PHASES = (0.0, 0.17, 0.33, 0.5, 0.67, 0.83)


def validate(workers: int) -> Part:
    """Return the part on throw distance."""
    tables = {
        name: sweep(
            [
                {**CENTRAL, **person, "impact_speed": speed / 3.6, "facing_angle": side,
                 "gait_phase": phase, "friction_body_road": friction}
                for speed in SPEEDS
                for friction in FRICTIONS
                for phase in PHASES
                for side in SIDES
            ],
            workers=workers,
        )
        for name, person in (("child", CHILD), ("adult", ADULT))
    }  # fmt: skip
    child, adult = tables["child"], tables["adult"]
    left = {
        name: separations(
            [
                {**CENTRAL, **person, "impact_speed": speed / 3.6, "facing_angle": side,
                 "gait_phase": phase}
                for speed in SPEEDS
                for phase in PHASES
                for side in SIDES
            ],
            workers=workers,
        )
        for name, person in (("child", CHILD), ("adult", ADULT))
    }  # fmt: skip
    checks = [
        check("throw_child_40", _at_forty(child[child["friction_body_road"] == 0.6])),
        check("throw_child_separation", 100.0 * share_within_searle(left["child"])),
        check("throw_adult_separation", 100.0 * share_within_searle(left["adult"])),
        check("throw_child_relation", median_searle_ratio(left["child"])),
        check("throw_adult_relation", median_searle_ratio(left["adult"])),
        check("throw_child_wood", 100.0 * _within_wood(child)),
        check("throw_adult_wood", 100.0 * _within_wood(adult)),
        check("throw_adult_toor", _worst(_medians(adult), toor_wrap)),
        check("throw_adult_happer", _worst(_medians(adult), happer_wrap)),
        check("throw_child_forward", _worst(_medians(child), toor_forward)),
        check("throw_efficiency", float(_at(child, 40.0)["launch_speed"].median() * 3.6 / 40.0)),
    ]
    caption = (
        "Throw distance over impact speed: every run (points), their median, and published "
        "relations. Friction 0.5 to 0.7, six phases of the gait, both sides."
    )
    figure = draw_panels([_panel(name, table) for name, table in tables.items()], height=4.2)
    words = [_words(name, table, left[name]) for name, table in tables.items()]
    return Part("Throw distance", words, checks, {caption: figure})


def _at(table: pd.DataFrame, speed: float) -> pd.DataFrame:
    return table[np.isclose(3.6 * table["impact_speed"], speed)]


def _medians(table: pd.DataFrame) -> Array:
    """Return the median throw (m) at each of ``SPEEDS``."""
    return np.array([_at(table, v)["throw_distance"].median() for v in SPEEDS])


def _at_forty(table: pd.DataFrame) -> float:
    """Return the median throw (m) at 40 km/h."""
    return float(_at(table, 40.0)["throw_distance"].median())


def _within_wood(table: pd.DataFrame) -> float:
    throw, speed = table["throw_distance"].to_numpy(), table["impact_speed"].to_numpy()
    return float(np.mean((wood_simms(throw, 2.5) <= speed) & (speed <= wood_simms(throw, 4.5))))


def _worst(medians: Array, relation: Callable[[Array], Array]) -> float:
    """Return the largest error (km/h) of a relation's speed for our medians, 30 to 60 km/h."""
    middle = (SPEEDS >= 30.0) & (SPEEDS <= 60.0)
    errors = (relation(medians) - SPEEDS)[middle]
    return float(errors[np.argmax(np.abs(errors))])


def _words(name: str, table: pd.DataFrame, left: pd.DataFrame) -> str:
    """Return sentences on the runs compared with the published relations."""
    errors = toor_wrap(_medians(table)) - SPEEDS
    side = "lower" if errors.mean() < 0.0 else "higher"
    rising = int((left["up"] >= 0.0).sum())
    share = f", {100.0 * share_within_searle(left):.0f} % of them within the bounds"
    inside = share if rising else ""
    return (
        f"The {name}. Searle's bounds hold from the state in which a body leaves the car, not from "
        "first contact at the car's speed, and for bodies that leave it upwards: "
        f"{rising} of {len(left)} runs at friction 0.6 do{inside}. With each run's own angle the "
        f"relation gives {number(median_searle_ratio(left), 3)} times its speed (median). The "
        f"centre of gravity reaches {_efficiency(table):.2f} of the car's speed at first contact "
        "(median), as the car brakes and the body turns over its hood. "
        "From our median throws Toor's and Araszewski's wrap regression would give speeds that "
        f"are {number(abs(float(errors.mean())), 2)} km/h {side} than the true ones on average "
        f"({number(float(errors.min()), 2)} to {number(float(errors.max()), 2)} km/h); our throw "
        f"at 40 km/h, all frictions, is {number(_at_forty(table))} m."
    )


def _efficiency(table: pd.DataFrame) -> float:
    return float((table["launch_speed"] / table["impact_speed"]).median())


def _panel(name: str, table: pd.DataFrame) -> Panel:
    s = np.linspace(1.0, 60.0, 200)
    rng = np.random.default_rng(0)
    shown = 3.6 * table["impact_speed"].to_numpy() + rng.uniform(-0.8, 0.8, len(table))
    curves = [
        Curve(shown, table["throw_distance"].to_numpy(), "runs", style.SKY, "", "."),
        Curve(SPEEDS, _medians(table), "median of the runs", style.BLUE, "-", "o"),
        Curve(toor_wrap(s), s, "Toor, Araszewski: wrap", style.ORANGE),
        Curve(toor_forward(s), s, "Toor, Araszewski: forward", style.ORANGE, "--"),
        Curve(happer_wrap(s), s, "Happer: wrap", style.PURPLE),
        Curve(3.6 * wood_simms(s), s, "Wood, Simms", "black", "-"),
        Curve(3.6 * wood_simms(s, 2.5), s, None, "black", ":"),
        Curve(3.6 * wood_simms(s, 4.5), s, "Wood, Simms, limits", "black", ":"),
    ]
    grid = np.linspace(15.0, 75.0, 100) / 3.6
    reach = grid**2 / (2.0 * 0.6 * STANDARD_GRAVITY)
    band = Band(3.6 * grid, reach, reach * (1.0 + 0.6**2), "Searle, friction 0.6", style.GREEN)
    return Panel(
        "impact speed [km/h]", "throw distance [m]", curves, [band], name,
        (15.0, 75.0), (0.0, 55.0), "upper left",
    )  # fmt: skip
