"""Candidate measurements, and simulations that predict them."""

import tomllib
from importlib.resources import files

from mcstudy.diagnosis.power import Extra
from mcstudy.diagnosis.problem import Problem
from studies.diagnosis.emulator import Emulator
from studies.diagnosis.simulation import Simulation

_CLASS = 1000.0
"""Channel frequency class of an added signal of force."""


def extras_of(
    problem: Problem, simulation: Simulation | Emulator
) -> list[tuple[Extra, Simulation | Emulator]]:
    """Return the measurements that the tests lack, each with a simulation that predicts it."""
    text = files("studies.diagnosis").joinpath("measurements.toml").read_text(encoding="utf-8")
    test = problem.tests[0]
    channels = {signal.name for signal in test.signals}
    scalars = {scalar.name for scalar in test.scalars}
    found = []
    for row in tomllib.loads(text).get(simulation.name, ()):
        extra = Extra(
            row["title"],
            {name: float(sd) for name, sd in row.get("signals", {}).items()},
            {name: float(sd) for name, sd in row.get("scalars", {}).items()},
            {name: float(sd) for name, sd in row.get("inputs", {}).items()},
        )
        if isinstance(simulation, Emulator) and (
            extra.signals or not set(extra.scalars) <= set(simulation.outputs)
        ):
            continue
        if set(extra.signals) & channels or set(extra.scalars) & scalars:
            continue
        if any(sd >= test.doubtful.get(name, 0.0) for name, sd in extra.inputs.items()):
            continue
        filters = {name: _CLASS if name.endswith("_force") else 0.0 for name in extra.signals}
        found.append((extra, simulation.widened(filters, tuple(extra.scalars))))
    return found
