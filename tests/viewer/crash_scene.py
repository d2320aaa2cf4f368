"""A scene of known motion: a ball that rolls, an ellipsoid that turns, a car that yaws."""

import numpy as np

from models.protocol import ContactForces, Mesh, Scene


def scene_of(*, film: bool = False) -> Scene:
    """Return the scene, with a sheet that bends if wanted."""
    time = np.arange(0.0, 0.6, 0.002)
    f = time.size
    centre = np.zeros((f, 2, 3))
    centre[:, 0, 0] = 10.0 * time
    centre[:, 1] = [0.0, 0.5, 1.0]
    angle = 3.0 * time
    turned = np.stack([np.cos(angle / 2), np.zeros(f), np.zeros(f), np.sin(angle / 2)], axis=1)
    still = np.tile([1.0, 0.0, 0.0, 0.0], (f, 1))
    meshes = []
    if film:
        flat = np.array([[0.0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
        shapes = np.tile(flat, (5, 1, 1))
        shapes[:, 2, 2] -= 0.01 * np.arange(5)
        meshes = [Mesh("sheet", shapes, np.array([[0, 1, 2, 3]]), "car", np.linspace(0, 0.1, 5))]
    force = np.zeros((f, 4, 3))
    force[20:40, 0, 2] = 3000.0
    place = np.where(
        np.linalg.norm(force, axis=2, keepdims=True) > 0.0, centre[:, [0, 1, 0, 1]], np.nan
    )
    return Scene(
        time=time,
        names=("head", "hip"),
        semi_axes=np.array([[0.1, 0.1, 0.1], [0.1, 0.2, 0.15]]),
        centre=centre,
        orientation=np.stack([still, turned], axis=1),
        car=np.stack([10.0 * time, 0.0 * time, 0.1 * time], axis=1),
        outline=[np.array([[-1.0, 0.9], [0.0, 0.7], [0.1, 0.2]])],
        plan=np.array([[0.0, -0.8], [0.0, 0.8], [-3.0, 0.8]]),
        meshes=meshes,
        forces=ContactForces(place, force),
        tape=np.array([[0.0, 0.1, 0.0], [0.0, 0.1, 0.35], [0.0, 0.1, 0.7], [-0.5, 0.1, 0.8]]),
    )
