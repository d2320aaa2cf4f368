"""The extended model as a study file for ``mcstudy run``."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from scipy import special

from mcstudy.diagnosis.problem import Problem
from mcstudy.measurement.measured_data import Measured
from mcstudy.statistics import REACH
from mcstudy.studyfile.schema import CommonStudy
from models.crash.outcome import ANGULAR_CLASS, LINEAR_CLASS
from models.registry import load_model
from studies.diagnosis.model_choice import ModelChoice
from studies.injury.schema import InjuryStudy
from studies.kinds import parse_study
from studies.monte_carlo.schema import MonteCarloStudy
from studies.sobol.schema import SobolStudy

LEAST = 1e-3
"""Share of a posterior outside the model's range from which on it is said."""
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


Ranges = Mapping[str, tuple[float, float]]
"""Lowest and highest value of inputs of the extended model."""
EVERYWHERE = (-math.inf, math.inf)
"""Range of an input that has none."""


def ranges_of(text: str, parameters: Parameters) -> dict[str, tuple[float, float]]:
    """Return the ranges of the inputs that the causes add to the model of a study.

    Parameters
    ----------
    text : str
        Study file of the base model (TOML).
    parameters : mapping
        By cause its fitted parameters, as in ``diagnosis.json``.
    """
    if not parameters:
        return {}
    study = parse_study(text, "base model")
    assert isinstance(study, CommonStudy)
    effects: dict[str, Any] = dict(study.effects) | {cause: {} for cause in parameters}
    model = load_model(study.model.name, study.model.options, effects)
    wanted = {name for name, _ in _uncertain(parameters)}
    return {item.name: (item.low, item.high) for item in model.inputs if item.name in wanted}


def cut_shares(parameters: Parameters, ranges: Ranges) -> dict[str, float]:
    """Return by input the share of its posterior outside the model's range, where there is any.

    Parameters
    ----------
    parameters : mapping
        By cause its fitted parameters, as in ``diagnosis.json``.
    ranges : mapping
        From ``ranges_of``.
    """
    found = {}
    for name, row in _uncertain(parameters):
        low, high = ranges.get(name, EVERYWHERE)
        centre, spread, take = _normal_form(row)
        inside = special.ndtr((take(high) - centre) / spread) - special.ndtr(
            (take(low) - centre) / spread
        )
        if inside < 1.0 - LEAST:
            found[name] = float(1.0 - inside)
    return found


def _uncertain(parameters: Parameters) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield input name and row of each parameter that is not fixed."""
    for cause, rows in parameters.items():
        for row in rows:
            if not row["fixed"]:
                yield f"{cause}_{row['name']}", row


def _normal_form(
    row: Mapping[str, Any],
) -> tuple[float, float, Callable[[float], float]]:
    """Return centre and spread of a fitted parameter where it is normal, and how it gets there."""
    value, low, high = (float(row[key]) for key in ("value", "low", "high"))
    if row["family"] == "lognormal":
        spread = max(math.log(high / low) / (2.0 * REACH), 1e-6)
        return math.log(value), spread, lambda x: math.log(x) if x > 0.0 else -math.inf
    return value, max((high - low) / (2.0 * REACH), _narrow(value)), float


def _narrow(value: float) -> float:
    """Return the smallest spread of a parameter at a value."""
    return 1e-6 * abs(value) + 1e-12


def extend(text: str, parameters: Parameters) -> str:
    """Return a study file with causes switched on and their fitted parameters uncertain.

    What of a posterior lies outside the model's range is cut off; see ``cut_shares``.

    Parameters
    ----------
    text : str
        Study file of the base model (TOML).
    parameters : mapping
        By cause its fitted parameters, as in ``diagnosis.json``.
    """
    ranges = ranges_of(text, parameters)
    lines = ["", "# Added by the diagnosis: effects, and the posterior of their parameters."]
    for cause, rows in parameters.items():
        lines += ["", f"[effects.{cause}]"]
        lines += [f"{row['name']} = {float(row['value'])!r}" for row in rows]
    for name, row in _uncertain(parameters):
        table = _distribution(row, ranges.get(name, EVERYWHERE))
        lines += _input(name, table, row["unit"])
    return text.rstrip("\n") + "\n" + "\n".join(lines) + "\n"


def _distribution(row: Mapping[str, Any], within: tuple[float, float]) -> dict[str, Any]:
    """Return the distribution of a fitted parameter, cut to a range, as a table of a study file."""
    centre, spread, take = _normal_form(row)
    low, high = within
    # A fit may rest on the edge of the range with its centre beyond.
    centre = min(max(centre, take(low)), take(high))
    table: dict[str, Any]
    if row["family"] == "lognormal":
        table = {"distribution": "lognormal", "median": math.exp(centre), "sigma": spread}
        low = low if low > 0.0 else -math.inf
    else:
        table = {"distribution": "normal", "mean": centre, "sd": spread}
    if row["family"] == "uniform":
        # Its prior ends where the interval does, unless that lies outside the range.
        narrow = _narrow(centre)
        own = float(row["low"]) - narrow, float(row["high"]) + narrow
        if own[0] < high and own[1] > low:
            low, high = max(low, own[0]), min(high, own[1])
    if math.isfinite(low):
        table["low"] = low
    if math.isfinite(high):
        table["high"] = high
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
