"""Measured data and a model as the problem of a diagnosis."""

import numpy as np

from mcstudy import units
from mcstudy.diagnosis.noise import estimate_noise
from mcstudy.diagnosis.problem import Problem, Scalar, Signal, Test, Unknown
from mcstudy.errors import UserError
from mcstudy.measured import Measured
from models.protocol import Model
from studies.diagnosis.simulation import DERIVED, Simulation

BIN = 5e-5
"""s: finer samples of a signal are averaged."""


def build_problem(data: Measured, simulation: Simulation) -> Problem:
    model = simulation.model(())
    inputs = {item.name: item for item in model.inputs}
    header = data.header
    unknowns = []
    for name, distribution in header.uncertain.items():
        scale = units.factor(distribution.unit, inputs[name].unit)
        unknowns.append(
            Unknown(name, lambda u, d=distribution, s=scale: s * float(d.quantile(np.array([u]), {})[0]))
        )
    tests = []
    fixed = {n: float(v) for n, v in header.fixed.items() if isinstance(v, (int, float))}
    derived = {o for s in header.signals for o in DERIVED.get(s, ())}
    for k, name in enumerate(data.tests["test"]):
        rec, doubt = {}, {}
        for column in header.inputs:
            value, sd = data.input_value(column, k, inputs[column].unit)
            rec[column] = value
            if sd > 0: doubt[column] = sd
        signals = []
        for s, entry in header.signals.items():
            time, values = data.signal(name, s, {"head_acceleration": "g", "hood_force": "N"}[s])
            signals.append(Signal(s, time, values, entry.sd, 0.0))
        scal = [Scalar(s, float(data.tests[s].iloc[k]), e.sd) for s, e in header.scalars.items()]
        tests.append(Test(name, fixed | rec, doubt, tuple(signals),
            tuple(x for x in scal if x.name not in derived), tuple(x for x in scal if x.name in derived),
            {"order": float(k)}))
    return Problem(tuple(tests), tuple(unknowns), simulation, {n: (i.low, i.high) for n, i in inputs.items()})
