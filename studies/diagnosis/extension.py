"""The extended model as a study file for ``mcstudy run``."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mcstudy.diagnosis.problem import Problem
from mcstudy.measurement.measured_data import Measured
from mcstudy.statistics import REACH
from models.crash.outcome import ANGULAR_CLASS, LINEAR_CLASS
from models.registry import load_model
from studies.diagnosis.model_choice import ModelChoice
from studies.injury.schema import InjuryStudy
from studies.kinds import parse_study
from studies.monte_carlo.schema import MonteCarloStudy
from studies.sobol.schema import SobolStudy

RUNS, REPLICATE = 1000, 100
"""Runs of a study file made from data alone."""


def base_study(data: Measured, choice: ModelChoice, problem: Problem, name: str) -> str:
    """Return the study file of the base model.

    The study file that the model came from, or one that samples the tested impact speeds and the
    shared unknowns.

    Parameters
    ----------
    data : Measured
        Measured tests.
    choice : ModelChoice
        The model that is diagnosed.
    problem : Problem
        Of the data and the model.
    name : str
        Name of the new study, used without a study file.
    """
    if isinstance(choice.study, MonteCarloStudy | SobolStudy | InjuryStudy):
        return choice.text
    lines = [
        'format = "mcstudy-study/1"',
        'kind = "monte-carlo"',
        f'name = "{name}"',
        f"title = {_toml(data.header.title)}",
        "seed = 1",
        "",
        "[model]",
        f'name = "{choice.name}"',
    ]
    usual = {"channel_class": LINEAR_CLASS, "angular_class": ANGULAR_CLASS}
    options = {k: v for k, v in choice.options.items() if usual.get(k) != v}
    if options:
        lines.append(f"options = {_toml(options)}")
    lines += ["", "[design]", 'method = "latin-hypercube"', f"n = {RUNS}"]
    lines += [f"replicate_size = {REPLICATE}"]
    sampled = set(data.header.inputs) | set(choice.uncertain)
    for key, value in choice.fixed.items():
        if key not in sampled:
            lines += ["", f"[fixed.{key}]", f"value = {value!r}", f'unit = "{_unit(choice, key)}"']
    for key in data.header.inputs:
        values = np.array([test.inputs[key] for test in problem.tests])
        if np.ptp(values) > 0.0:
            table = {"distribution": "uniform", "low": values.min(), "high": values.max()}
            lines += _input(key, table, _unit(choice, key))
        else:
            lines += ["", f"[fixed.{key}]", f"value = {float(values[0])!r}"]
            lines += [f'unit = "{_unit(choice, key)}"']
    for key, distribution in choice.uncertain.items():
        table = distribution.model_dump(mode="json", exclude_none=True)
        unit = table.pop("unit")
        lines += _input(key, table, unit)
    return "\n".join(lines) + "\n"


Parameters = Mapping[str, Sequence[Mapping[str, Any]]]
"""By cause its fitted parameters, as in ``diagnosis.json``."""


def extend(text: str, parameters: Parameters) -> str:
    """Return a study file with causes switched on and their fitted parameters uncertain.

    Parameters
    ----------
    text : str
        Study file of the base model (TOML).
    parameters : mapping
        By cause its fitted parameters, as in ``diagnosis.json``.
    """
    lines = ["", "# Added by the diagnosis: effects, and the posterior of their parameters."]
    for cause, rows in parameters.items():
        lines += ["", f"[effects.{cause}]"]
        lines += [f"{row['name']} = {float(row['value'])!r}" for row in rows]
    for cause, rows in parameters.items():
        for row in rows:
            if not row["fixed"]:
                lines += _input(f"{cause}_{row['name']}", _distribution(row), row["unit"])
    return text.rstrip("\n") + "\n" + "\n".join(lines) + "\n"


def _distribution(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return the distribution of a fitted parameter as a table of a study file."""
    value, low, high = (float(row[key]) for key in ("value", "low", "high"))
    narrow = 1e-6 * abs(value) + 1e-12
    if row["family"] == "lognormal":
        sigma = max(float(np.log(high / low)) / (2.0 * REACH), 1e-6)
        return {"distribution": "lognormal", "median": value, "sigma": sigma}
    table: dict[str, Any] = {"distribution": "normal", "mean": value}
    table["sd"] = max((high - low) / (2.0 * REACH), narrow)
    if row["family"] == "uniform":
        table |= {"low": low - narrow, "high": high + narrow}
    return table


def checked(text: str) -> str:
    """Return a study file's text after reading it as ``mcstudy run`` does."""
    parse_study(text, "extended model")
    return text


def _unit(choice: ModelChoice, name: str) -> str:
    model = load_model(choice.name, choice.options, choice.effects)
    return next(item.unit for item in model.inputs if item.name == name)


def _input(name: str, table: Mapping[str, Any], unit: str) -> list[str]:
    lines = ["", f"[inputs.{name}]"]
    lines += [f"{key} = {_toml(value)}" for key, value in table.items()]
    return [*lines, f'unit = "{unit}"']


def _toml(value: Any) -> str:
    """Return a value as TOML writes it."""
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + "".join(c if c.isprintable() else " " for c in escaped) + '"'
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{k} = {_toml(v)}" for k, v in value.items()) + " }"
    if isinstance(value, Sequence):
        return "[" + ", ".join(_toml(v) for v in value) + "]"
    return repr(float(value))
