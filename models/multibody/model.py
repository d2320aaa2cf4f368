"""The multibody crash model behind the model protocol."""

import math
from typing import Any

import numpy as np

from models import data
from models.crash import outcome
from models.crash.model import FRAME_INTERVAL, TIME_LIMIT, CrashModel
from models.crash.record import Summary
from models.crash.scenario import Scenario
from models.declaration import read_channels, read_inputs, read_outputs
from models.effects.registry import effects_of
from models.multibody.setup import Crash, build_crash
from models.multibody.simulation import CoreModel, Settings, empty_data, simulate
from models.multibody.stability import STABLE, joint_rate, stable_ticks, surface_mobility
from models.pedestrian.anthropometry import HEAD, TRUNK

COARSE, SLIDE, FLIGHT = 3, 6, 6
"""Ticks per step in quiet contact with the car, on the road alone, and in free flight."""

_TABLE = data.load("multibody.toml")


class MultibodyModel(CrashModel):
    """Fifteen ellipsoid segments with spherical joints against a braking car.

    See ``CrashModel`` for the parameters.
    """

    name = "multibody"
    version = str(_TABLE["version"])
    outputs = read_outputs(_TABLE)
    effects: tuple[str, ...] = effects_of("multibody")
    _own_inputs = read_inputs(_TABLE)
    channels = read_channels(_TABLE)
    isomme_device = str(_TABLE["isomme_device"])
    cost = float(_TABLE["cost"])
    coarse = COARSE

    def _step(self, values: dict[str, float]) -> outcome.Raw | None:
        crash = build_crash(values, self.vehicle, self._chain, self.front_of)
        return None if crash is None else self.follow(crash, values)

    def front_of(self, scenario: Scenario) -> Any:
        """Return the geometry of the car's front, one of the types of ``models.crash.front``."""
        return scenario.zones

    def follow(self, crash: Crash, values: dict[str, float]) -> outcome.Raw:
        """Return the raw results of an assembled crash, whose state is changed.

        Parameters
        ----------
        crash : Crash
            As returned by ``build_crash``.
        values : mapping of str to float
            All inputs from which it was built.
        """
        scenario = crash.scenario
        rate = joint_rate(crash.tree, scenario.joints, crash.motion)
        # A light body with stiff joints needs a finer step than the one requested.
        tick = self.tick / max(1, math.ceil(rate * self.tick / STABLE))
        record = self._record
        if tick < self.tick:
            record = np.empty((int(TIME_LIMIT / tick) + 2, record.shape[1]))
        settings = Settings(
            tick=tick,
            coarse=stable_ticks(rate, tick, self.coarse),
            slide=stable_ticks(rate, tick, SLIDE),
            flight=stable_ticks(rate, tick, FLIGHT),
            time_limit=TIME_LIMIT,
            step_limit=record.shape[0] - 1,
            frame_every=round(FRAME_INTERVAL / tick),
            head=HEAD,
            trunk=max(TRUNK),
            mobility=surface_mobility(crash.tree, scenario.body.semi_axes),
        )
        model = CoreModel(
            crash.tree, scenario.joints, scenario.ellipsoids, crash.front, scenario.road,
            scenario.car_motion, settings,
        )  # fmt: skip
        pairs = len(scenario.ellipsoids.pairs)
        data = empty_data(crash.motion, len(self.vehicle.zones), pairs, record, self._frames)
        simulate(model, data)
        summary = data.summary
        return outcome.Raw(
            scenario=scenario,
            classes=self.classes,
            chain=self._chain,
            values=values,
            record=record[: int(summary[Summary.RECORDS])],
            frames=self._frames[: int(summary[Summary.FRAMES])],
            work=data.work,
            head_contact=data.head_contact,
            summary=summary,
            primary_end=float(summary[Summary.GROUND_TIME]),
        )
