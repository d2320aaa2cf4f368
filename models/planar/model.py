"""The planar crash model behind the model protocol."""

from dataclasses import replace

import numpy as np

from models import data
from models.crash import outcome
from models.crash.first_contact import first_contact_shift, widen_gaps
from models.crash.model import FRAME_INTERVAL, TIME_LIMIT, CrashModel
from models.crash.record import BLOW_ENTRIES, HEAD_CONTACT_ENTRIES, Summary
from models.crash.scenario import build_scenario
from models.crash.surfaces import CHANNELS, Contacts, empty_contacts
from models.declaration import read_channels, read_inputs, read_outputs
from models.effects.registry import effects_of
from models.pedestrian.anthropometry import HEAD, SEGMENTS, TRUNK
from models.planar.body import PlanarBody, hold_in_plane, surfaces_in_plane
from models.planar.chipmunk import EACH_BODY, STEP_SPACE
from models.planar.joints import joints_in_plane
from models.planar.recording import Memory
from models.planar.space import STATE, PlanarSpace
from models.planar.stepping import (
    PlanarCoreData,
    PlanarCoreModel,
    PlanarMotion,
    PlanarSettings,
    empty_loads,
    empty_motion,
    show_surfaces,
    simulate,
)

COARSE, FLIGHT, ROAD = 3, 6, 20
"""Ticks per step in contact with the car, above it, and clear of it."""

_TABLE = data.load("planar.toml")
_SPATIAL = data.load("multibody.toml")


class PlanarModel(CrashModel):
    """The body restricted to the plane of the car's travel: Pymunk's joints, our car contact.

    See ``CrashModel`` for the parameters. Inputs and nominal values are those of the multibody
    model; inputs that this model ignores are marked.
    """

    name = "planar"
    version = f"{_SPATIAL['version']}.{_TABLE['version']}"
    outputs = tuple(item for item in read_outputs(_SPATIAL) if item.name not in _TABLE["left_out"])
    effects: tuple[str, ...] = effects_of("planar")
    _own_inputs = tuple(
        replace(item, ignored=_TABLE["ignored"].get(item.name, ""))
        for item in read_inputs(_SPATIAL)
    )

    channels = read_channels(_SPATIAL)
    isomme_device = ""
    cost = float(_TABLE["cost"])

    def _step(self, values: dict[str, float]) -> outcome.Raw | None:
        scenario = build_scenario(values, self.vehicle, self._chain)
        n, zones = len(SEGMENTS), len(self.vehicle.zones)
        body = hold_in_plane(scenario.body, scenario.posture)
        ellipsoids = surfaces_in_plane(scenario.ellipsoids, body, _TABLE["free"]["regions"])
        contacts, motion = empty_contacts(n, zones, len(ellipsoids.pairs)), empty_motion(n)
        _show(body, motion, contacts)
        widen_gaps(ellipsoids, contacts)
        shift = first_contact_shift(scenario.zones, ellipsoids, motion, contacts)
        if np.isnan(shift):
            return None
        body.centre[:, 0] += shift
        body.joint[:, 0] += shift
        car_motion = scenario.car_motion._replace(curvature=0.0)
        joints = joints_in_plane(scenario.joints, body)
        space = PlanarSpace(body, joints, scenario.road, ellipsoids, car_motion.speed)
        settings = PlanarSettings(
            tick=self.tick, coarse=COARSE, flight=FLIGHT, road=ROAD, time_limit=TIME_LIMIT,
            step_limit=self._record.shape[0] - 1, frame_every=round(FRAME_INTERVAL / self.tick),
            head=HEAD, trunk=max(TRUNK),
        )  # fmt: skip
        model = PlanarCoreModel(
            space.link, body, joints, ellipsoids, scenario.zones, scenario.road, car_motion,
            settings,
        )  # fmt: skip
        data = PlanarCoreData(
            state=space.state, given=space.given, motion=motion, loads=empty_loads(n),
            contacts=contacts, orientation=np.zeros((n, 4)), car=np.zeros(6),
            power=np.zeros(CHANNELS), memory=np.zeros(len(Memory)),
            blow=np.full(BLOW_ENTRIES, -np.inf), record=self._record, frames=self._frames,
            head_contact=np.full(HEAD_CONTACT_ENTRIES, np.nan), summary=np.zeros(len(Summary)),
        )  # fmt: skip
        data.memory[Memory.ROAD_TIME] = np.inf
        summary = data.summary
        summary[Summary.GROUND_TIME], summary[Summary.HEAD_REGION] = np.inf, -1.0
        simulate(STEP_SPACE, EACH_BODY, model, data)
        return outcome.Raw(
            scenario=replace(scenario, car_motion=car_motion, ellipsoids=ellipsoids),
            classes=self.classes,
            chain=self._chain,
            values=values,
            record=self._record[: int(summary[Summary.RECORDS])],
            frames=self._frames[: int(summary[Summary.FRAMES])],
            work=np.empty(0),
            head_contact=data.head_contact,
            summary=summary,
            primary_end=float(data.memory[Memory.ROAD_TIME]),
            rigid_road=True,
        )


def _show(body: PlanarBody, motion: PlanarMotion, contacts: Contacts) -> None:
    """Compute motion and surfaces at the start."""
    state = np.zeros((len(SEGMENTS), STATE))
    state[:, :2] = body.centre
    show_surfaces(body, state, motion, contacts)
