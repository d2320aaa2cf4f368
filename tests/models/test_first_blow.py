"""The head's speed is that of its first blow, its own arm included."""

import math

import numpy as np
import pytest

from models.compilation import kernel
from models.crash.record import S_GROUND_TIME, SUMMARY
from models.crash.surfaces import Contacts, empty_contacts
from models.multibody.model import MultibodyModel
from models.multibody.recording import B_LAST, BLOW, note_blow, note_head
from models.multibody.setup import build_crash
from models.pedestrian.anthropometry import HEAD, SEGMENTS


@kernel
def _note(time, head, ellipsoids, motion, contacts, car, blow, head_contact, summary):
    note_blow(time, head, ellipsoids, motion, contacts, car, blow)
    note_head(time, head, motion, contacts, car, blow, head_contact, summary)


@pytest.mark.parametrize(
    ("force", "began", "ended", "counts"),
    [
        (1500.0, 0.040, 0.055, True),  # on the arm until just before the car
        (1500.0, 0.020, 0.030, False),  # over long before
        (100.0, 0.040, 0.055, False),  # a touch
    ],
)
def test_the_arm_counts_if_it_braked_the_head(
    force: float, began: float, ended: float, counts: bool
) -> None:
    model = MultibodyModel()
    values = {item.name: item.nominal for item in model.inputs}
    crash = build_crash(values, model.vehicle)
    assert crash is not None
    ellipsoids, motion = crash.scenario.ellipsoids, crash.motion
    zones = crash.scenario.zones.radius.size
    contacts: Contacts = empty_contacts(len(SEGMENTS), zones, len(ellipsoids.pairs))
    pair = next(k for k, row in enumerate(ellipsoids.pairs) if HEAD in row[:2])
    blow, head_contact = np.zeros(BLOW), np.full(10, np.nan)
    summary, car = np.zeros(SUMMARY), np.zeros(6)
    blow[B_LAST], summary[S_GROUND_TIME] = -math.inf, math.inf
    met = 0.060
    for time in np.arange(0.0, met + 5e-4, 1e-3):
        # The head slows down all the time.
        motion.velocity[HEAD] = [-10.0 + 100.0 * time, 0.0, -1.0]
        contacts.pair_force[:] = 0.0
        contacts.pair_force[pair] = force if began <= time <= ended else 0.0
        contacts.segment_force[HEAD, 0] = 500.0 if time >= met - 1e-9 else 0.0
        _note(time, HEAD, ellipsoids, motion, contacts, car, blow, head_contact, summary)
    assert head_contact[0] == pytest.approx(met, abs=1e-9)
    at = began if counts else met
    assert head_contact[1] == pytest.approx(-10.0 + 100.0 * at, abs=0.11)
    assert head_contact[3] == pytest.approx(-1.0)
