"""Simulated tests: a model of the registry, reduced to the measured channels."""

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcstudy.diagnosis.problem import Observation
from models.criteria.filters import filter_cfc
from models.effects.registry import load_effect
from models.protocol import Channel, Model, Run, complete_status
from models.registry import load_model

Array = NDArray[np.float64]

ACCELERATION, GAIN = "head_acceleration", "sensor_gain_factor"
"""Signal that the effects on readings change, and the input that scales what its sensor feels."""
STEP = 0.005
"""Relative change of it in a finite difference."""
PLAIN = Channel()
"""Of a channel that the model declares nothing about."""


def channel_units(model: Model, names: Collection[str]) -> dict[str, str]:
    """Return the units of channels ``<group>_<channel>`` of a model's histories."""
    if not names:
        return {}
    run = model.run({})
    return {
        f"{group}_{channel}": unit
        for group, history in run.histories.items()
        for channel, unit in history.units.items()
    }


class Simulation:
    """Simulates tests: runs of a model reduced to the measured channels.

    Parameters
    ----------
    name : str
        Name of the model.
    options : mapping
        Options of the model.
    filters : mapping
        Channel frequency class by signal, 0 for none.
    scalars : collection of str
        Measured outputs.
    effects : mapping, optional
        Effects switched on from the start, with their parameters.

    Attributes
    ----------
    stepped : int
        Runs whose crash was stepped, not recalled.
    """

    def __init__(
        self,
        name: str,
        options: Mapping[str, Any],
        filters: Mapping[str, float],
        scalars: Collection[str],
        effects: Mapping[str, Mapping[str, float]] | None = None,
    ) -> None:
        self.name, self._options = name, dict(options)
        self._filters, self._scalars = dict(filters), tuple(scalars)
        self._effects = {k: dict(v) for k, v in (effects or {}).items()}
        self._models: dict[tuple[str, ...], Model] = {}
        self.stepped = 0

    def __getstate__(self) -> dict[str, Any]:
        """Leave the models out: a worker loads its own in milliseconds."""
        return self.__dict__ | {"_models": {}}

    def model(self, effects: Collection[str]) -> Model:
        """Return the model with effects switched on."""
        key = tuple(sorted(effects))
        if key not in self._models:
            chosen = self._effects | {name: {} for name in key}
            self._models[key] = load_model(self.name, self._options, chosen)
        return self._models[key]

    def _seen_as(self, name: str, inputs: Mapping[str, float]) -> str:
        """Return the model's channel for a measured one.

        In a straight impact one axis is measured, with its sign: an offset may be negative.
        """
        channel = self.model(()).channels.get(name, PLAIN)
        straight = channel.straight and inputs.get("impact_angle", 0.0) == 0.0
        return channel.straight if straight else name

    def widened(self, filters: Mapping[str, float], scalars: Collection[str]) -> "Simulation":
        """Return the simulation with more channels and scalars."""
        return Simulation(
            self.name,
            self._options,
            {**self._filters, **filters},
            (*self._scalars, *scalars),
            self._effects,
        )

    def __call__(
        self, inputs: Mapping[str, float], effects: Mapping[str, Mapping[str, float]]
    ) -> Observation | None:
        """Return a simulated test, or None if the run fails."""
        nonlinear = ACCELERATION in self._filters and any(
            load_effect(name).nonlinear for name in {*self._effects, *effects}
        )
        model = self.model({*effects, "sensor_gain"} if nonlinear else effects)
        values = dict(inputs)
        for cause, parameters in effects.items():
            values |= {f"{cause}_{name}": value for name, value in parameters.items()}
        seen = {self._seen_as(name, values) for name in self._filters}
        run = model.observe(values, seen, self._scalars)
        self.stepped += not run.recalled
        if run.status not in complete_status(model):
            return None
        scalars = {name: run.outputs[name] for name in self._scalars}
        signals = self._signals(model, run)
        if not nonlinear:
            return Observation(signals, scalars)
        # A gain acts on what the sensor feels.
        usual = next(i.nominal for i in model.inputs if i.name == GAIN)
        values[GAIN] = (1.0 + STEP) * values.get(GAIN, usual)
        more = self._signals(model, model.observe(values, seen, ()))
        response = (more[ACCELERATION][1] - signals[ACCELERATION][1]) / STEP
        return Observation(signals, scalars, responses={ACCELERATION: response})

    def _signals(self, model: Model, run: Run) -> dict[str, tuple[Array, Array]]:
        """Return time and values of the measured signals of a run."""
        signals = {}
        for name, channel_class in self._filters.items():
            group, _, channel = self._seen_as(name, run.inputs).partition("_")
            history = run.histories[group]
            signal = history.channels[channel]
            # Channels that the model filters already have the measured class.
            filtered = model.channels.get(name, PLAIN).filter_option
            if channel_class > 0.0 and not filtered:
                rate = 1.0 / float(history.time[1] - history.time[0])
                signal = filter_cfc(signal, rate, channel_class)
            signals[name] = (history.time, signal)
        return signals
