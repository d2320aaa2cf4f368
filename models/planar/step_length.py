"""The length of the next step of the planar model."""

from models.compilation import inlined_kernel
from models.crash.front import patch_count, separation_of
from models.crash.record import HeadContact
from models.crash.stepping import HEAD_NEAR, head_meets_car
from models.planar.recording import lands

CLEAR = 0.1
"""m ahead of the car from which a segment cannot meet it within the longest step (assumed)."""

RESOLVED = 0.06
"""s after the head has met the car during which steps stay fine: a step that depends on what is in
contact moves the begin of the next contact by its length, and the acceleration by 13 g
[measured]."""


@inlined_kernel
def _head_is_near(model, data):
    """Return whether the head is within ``HEAD_NEAR`` of the car's front."""
    head, contacts = model.settings.head, data.contacts
    x, z = contacts.centre[head, 0] - data.car[0], contacts.centre[head, 2]
    for j in range(patch_count(model.front)):
        found = separation_of(model.front, model.ellipsoids, contacts, j, head, x, 0.0, z, 1.0, 0.0)
        if found[0] < HEAD_NEAR:
            return True
    return False


@inlined_kernel
def _is_near_car(ellipsoids, contacts, car):
    """Return whether a segment may meet the car within the longest step."""
    for i in range(contacts.centre.shape[0]):
        if contacts.centre[i, 0] - car[0] < ellipsoids.reach[i] + CLEAR:
            return True
    return False


@inlined_kernel
def ticks_of_next_step(model, data, time, landed):
    """Return the length of the next step in ticks.

    Parameters
    ----------
    model : PlanarCoreModel
    data : PlanarCoreData
        Motion, contacts and the head's contact.
    time : float
        s.
    landed : bool
        Whether the landing needs no short steps any more.
    """
    settings, ellipsoids = model.settings, model.ellipsoids
    car, motion, contacts = data.car, data.motion, data.contacts
    if head_meets_car(settings.head, ellipsoids, model.front, car, motion, contacts) and (
        _head_is_near(model, data)
    ):
        return 1
    # True as well while the head has not met the car.
    recorded = not time > data.head_contact[HeadContact.TIME] + RESOLVED
    if recorded and _is_near_car(ellipsoids, contacts, car):
        return 1
    for j in range(contacts.zone_force.shape[0] - 1):
        if contacts.zone_force[j] > 0.0:
            return settings.coarse
    if not landed and lands(settings, motion, contacts, 2.0 * settings.road * settings.tick, True):
        return settings.coarse
    return settings.flight if _is_near_car(ellipsoids, contacts, car) else settings.road
