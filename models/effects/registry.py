"""The catalogue of effects: a new effect is one file, one table of data and one line here."""

from functools import cache
from importlib import import_module
from typing import Any

from models import data
from models.effects.effect import STAGES, Effect, Parameter, Prior
from models.protocol import Input

EFFECTS: tuple[str, ...] = (
    # Deviations of the set-up from the record.
    "speed_bias",
    "mass_error",
    "hood_force_scale",
    # The hood and the head's contact with it.
    "hood_bottoming",
    "hood_yield",
    "unloading_slope",
    "rate_dependent_hood",
    "hood_inertia",
    "skin_compliance",
    # The rig that guides the headform.
    "guide_friction",
    # The car, the pedestrian and the road of a crash.
    "late_braking",
    "brake_dive",
    "muscle_tone",
    "braced_posture",
    "shoulder_compliance",
    "friction_level",
    "wet_road",
    "road_slope",
    "restitution",
    # The accelerometer, in the order in which a signal passes through it.
    "sensor_gain",
    "sensor_offset",
    "sensor_saturation",
    "sensor_filter",
    "time_scale",
)
"""Effects in the order in which they act within a stage."""


@cache
def load_effect(name: str) -> Effect:
    """Return an effect of the catalogue.

    Raises
    ------
    ValueError
        If the catalogue has no effect of that name.
    """
    if name not in EFFECTS:
        raise ValueError(f"no effect {name!r}; there are {', '.join(EFFECTS)}")
    row = data.load("effects.toml")["effects"][name]
    if row["stage"] not in STAGES:
        raise ValueError(f"effect {name!r}: unknown stage {row['stage']!r}")
    if row["size"] not in row["parameters"]:
        raise ValueError(f"effect {name!r}: its size {row['size']!r} is no parameter of it")
    models = tuple(row["models"])
    return Effect(
        name=name,
        title=row["title"],
        stage=row["stage"],
        models=models,
        parameters={
            key: _parameter(key, entry, models) for key, entry in row["parameters"].items()
        },
        size=row["size"],
        forms={
            form: _fixed(entry, row["parameters"])
            for form, entry in row.get("forms", {name: {}}).items()
        },
        varies_with=tuple(row.get("varies_with", ())),
        signature=row["signature"],
        confusable=tuple(row["confusable"]),
        separated_by=row["separated_by"],
        source=row["source"],
        apply=import_module(f"models.effects.{name}").apply,
        nonlinear=bool(row.get("nonlinear", False)),
    )


def effects_of(model: str) -> tuple[str, ...]:
    """Return the effects that apply to a model."""
    return tuple(name for name in EFFECTS if model in load_effect(name).models)


def _fixed(form: dict[str, Any], parameters: dict[str, Any]) -> dict[str, float]:
    """Return the values of the parameters that a form fixes, defaults included."""
    free = form.get("free", ())
    defaults = {
        name: float(row["default"])
        for name, row in parameters.items()
        if "default" in row and name not in free
    }
    return defaults | {name: float(value) for name, value in form.items() if name != "free"}


def _parameter(name: str, row: dict[str, Any], models: tuple[str, ...]) -> Parameter:
    prior = _prior(row["prior"])
    low, high = (float(v) for v in row["range"])
    item = Input(
        name=name,
        unit=row["unit"],
        meaning=row["meaning"],
        nominal=float(row.get("default", prior.quantile(0.5))),
        low=low,
        high=high,
        source="prior of the effect",
    )
    return Parameter(
        item,
        prior,
        float(row["none"]),
        tuple(row.get("models", models)),
        _prior(row.get("prior_in_accidents", row["prior"])),
    )


def _prior(row: list[Any]) -> Prior:
    return Prior(row[0], float(row[1]), float(row[2]))
