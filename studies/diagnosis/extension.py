"""The extended model as a study file that ``mcstudy run`` takes."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mcstudy.config import InjuryStudy, MonteCarloStudy, SobolStudy, parse_study
from mcstudy.diagnosis.fit import Fit
from mcstudy.diagnosis.problem import Problem
from mcstudy.measured import Measured
from models.registry import load_model
from studies.diagnosis.model_choice import ModelChoice
from studies.diagnosis.posterior import posteriors

RUNS, REPLICATE = 1000, 100
"""Runs of a study file that is made from data alone."""


def base_study(data: Measured, choice: ModelChoice, problem: Problem, name: str) -> str:
    """Return the study file of the model as it stands.

    The study file that the model came from, or one that samples the tested impact speeds and the
    shared unknowns.
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
    options = {k: v for k, v in choice.options.items() if k != "channel_class" or v != 1000.0}
    if options:
        lines.append(f"options = {_toml(options)}")
    lines += ["", "[design]", 'method = "latin-hypercube"', f"n = {RUNS}"]
    lines += [f"replicate_size = {REPLICATE}"]
    sampled = set(data.header.inputs) | set(data.header.uncertain)
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
    for key, distribution in data.header.uncertain.items():
        table = distribution.model_dump(mode="json", exclude_none=True)
        unit = table.pop("unit")
        lines += _input(key, table, unit)
    return "\n".join(lines) + "\n"


def extend(text: str, problem: Problem, fitted: Fit) -> str:
    """Return a study file with the causes of a fit switched on, their parameters uncertain."""
    lines = ["", "# What the diagnosis added: effects, and what the tests say of their parameters."]
    for form in fitted.forms:
        lines += [f"[effects.{form.cause}]"]
        lines += [f"{name} = {value!r}" for name, value in form.fixed.items()]
        lines += [
            f"{entry.parameter.name} = {entry.median!r}"
            for entry in posteriors(problem, fitted)
            if entry.cause == form.cause
        ]
        lines += [""]
    for entry in posteriors(problem, fitted):
        name = f"{entry.cause}_{entry.parameter.name}"
        lines += [*_input(name, entry.distribution(), entry.parameter.unit)[1:], ""]
    return text.rstrip("\n") + "\n" + "\n".join(lines).rstrip("\n") + "\n"


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
