"""The scene of a finished run: poses, outlines of the car, contact forces, tape."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from models.crash.outcome import Raw
from models.crash.record import SEGMENT_ENTRIES, Frame, HeadContact, SegmentFrame, Summary
from models.crash.tape import Measured
from models.pedestrian.anthropometry import SEGMENTS
from models.protocol import ContactForces, Mesh, Scene
from models.vehicle.profile import diving_points
from models.vehicle.zones import ROLL

Array = NDArray[np.float64]

LEAST_FORCE = 1.0
"""N below which a contact force is left out."""


def build_scene(raw: Raw, measured: Measured, meshes: Sequence[Mesh] = ()) -> Scene:
    """Return the scene of a run.

    Parameters
    ----------
    raw : Raw
    measured : callable
        What a tape on the car measures; see ``models.crash.tape.tape_on_zones``.
    meshes : sequence of Mesh
        Surfaces of facets, in the frames of their bodies.
    """
    frames = raw.frames
    segments = frames[:, Frame.POSES :].reshape(len(frames), len(SEGMENTS), SEGMENT_ENTRIES)
    centre = segments[..., SegmentFrame.CENTRE : SegmentFrame.ORIENTATION].copy()
    orientation = segments[..., SegmentFrame.ORIENTATION : SegmentFrame.CAR_FORCE].copy()
    axes = np.sqrt(raw.scenario.ellipsoids.square)
    return Scene(
        time=frames[:, Frame.TIME].copy(),
        names=SEGMENTS,
        semi_axes=axes,
        centre=centre,
        orientation=orientation,
        car=frames[:, Frame.CAR : Frame.POSES].copy(),
        outline=_side_view(raw),
        plan=_plan_view(raw),
        meshes=meshes,
        forces=_contact_forces(segments, centre, _rotations(orientation), axes),
        tape=_tape(raw, measured),
    )


def _side_view(raw: Raw) -> list[Array]:
    zones, lines = raw.scenario.zones, []
    for j in range(zones.radius.size):
        if zones.kind[j] == ROLL:
            angle = np.linspace(0.0, 2.0 * math.pi, 61)
            ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
            lines.append(zones.origin[j] + zones.radius[j] * ring)
        else:
            lines.append(
                np.array([zones.origin[j], zones.origin[j] + zones.length[j] * zones.direction[j]])
            )
    return lines


def _plan_view(raw: Raw) -> Array:
    zones = raw.scenario.zones
    width = zones.half_width.max()
    y = np.linspace(-width, width, 41)
    bumper = raw.scenario.vehicle.zone_index("bumper")
    nose = -0.5 * zones.curvature[bumper] * y**2
    rear = np.full(2, zones.box[:, 0].min())
    return np.stack(
        [np.concatenate([nose, rear, nose[:1]]), np.concatenate([y, [width, -width], y[:1]])],
        axis=1,
    )


def _rotations(quaternion: Array) -> Array:
    """Return the rotation matrices (..., 3, 3) of quaternions (..., 4)."""
    w, x, y, z = np.moveaxis(quaternion, -1, 0)
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def _contact_forces(segments: Array, centre: Array, rotation: Array, axes: Array) -> ContactForces:
    """Return the resultants of the car and of the road on each segment, (f, 2 n, 3)."""
    force = segments[..., SegmentFrame.CAR_FORCE : SegmentFrame.CAR_TORQUE]
    torque = segments[..., SegmentFrame.CAR_TORQUE : SegmentFrame.ROAD_FORCE]
    road = np.zeros_like(force)
    road[..., 2] = segments[..., SegmentFrame.ROAD_FORCE]
    # The lowest point of an ellipsoid x' A^-1 x = 1 lies at -A z / sqrt(z' A z).
    shape = np.einsum("fnij,nj,fnkj->fnik", rotation, axes**2, rotation)
    lowest = centre - shape[..., 2] / np.sqrt(shape[..., 2, 2])[..., None]
    places = np.concatenate([_entry(force, torque, centre, rotation, axes), lowest], axis=1)
    forces = np.concatenate([force, road], axis=1)
    absent = np.linalg.norm(forces, axis=2) < LEAST_FORCE
    return ContactForces(np.where(absent[..., None], np.nan, places), forces)


def _entry(force: Array, torque: Array, centre: Array, rotation: Array, axes: Array) -> Array:
    """Return where the lines of action of forces enter ellipsoids, (f, n, 3), m.

    Where a line passes an ellipsoid by, its point nearest to the centre is returned, in a frame in
    which the ellipsoid is a sphere.

    Parameters
    ----------
    force, torque : (f, n, 3) array
        N, and N m about the centres.
    centre : (f, n, 3) array
    rotation : (f, n, 3, 3) array
    axes : (n, 3) array
        Semi-axes, m.
    """
    size = np.linalg.norm(force, axis=2, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        along = force / size
        foot = np.cross(force, torque) / size**2
        u = np.einsum("fnij,fni->fnj", rotation, foot) / axes
        d = np.einsum("fnij,fni->fnj", rotation, along) / axes
        square, product = np.sum(d * d, axis=2), np.sum(u * d, axis=2)
        inside = product**2 - square * (np.sum(u * u, axis=2) - 1.0)
        way = (-product - np.sqrt(np.maximum(inside, 0.0))) / square
    return np.asarray(centre + foot + way[..., None] * along)


def _tape(raw: Raw, measured: Measured) -> Array | None:
    """Return the corners (k, 3) of the tape on the diving car, if the head met the car."""
    contact, zone = raw.head_contact, int(raw.summary[Summary.HEAD_REGION])
    if not math.isfinite(contact[HeadContact.TIME]) or zone < 0:
        return None
    point = contact[HeadContact.POINT : HeadContact.POINT + 3]
    path = measured(raw.scenario, zone, point).path.copy()
    if not len(path):
        return None
    vehicle, dive = raw.scenario.vehicle, raw.scenario.dive_angle
    path[1:, [0, 2]] = diving_points(vehicle, dive, path[1:, [0, 2]])
    return path
