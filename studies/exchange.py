"""Runs written as ISO-MME, for other programs to read."""

from pathlib import Path

import numpy as np

from mcstudy import isomme
from models.protocol import Run

# Dummy or impactor without a seat; child headform and virtual child of six in the code list of
# ISO/TS 13499, which knows no pedestrian of seven.
_DEVICE = {"headform": "PC", "multibody": "V6"}
_CODES = {
    ("head", "acceleration"): "D0HEADCG00{}ACRA",
    ("head", "angular_velocity_x"): "D0HEADCG00{}AVXC",
    ("head", "angular_velocity_y"): "D0HEADCG00{}AVYC",
    ("head", "angular_velocity_z"): "D0HEADCG00{}AVZC",
    ("head", "angular_acceleration"): "D0HEADCG00{}AARC",
    ("head", "car_force"): "D0HEAD0000{}FOR0",
    ("hood", "force"): "D0HEAD0000{}FOR0",
}
"""Channel codes by history group and channel."""


def write_isomme(run: Run, model: str, folder: Path, *, name: str, title: str) -> Path | None:
    """Write the head signals of a run as an ISO-MME test and return its ``.mme`` file.

    Parameters
    ----------
    run : Run with histories. model : name of the model. folder : the test's folder, created.
    name, title : of the test.

    Returns
    -------
    Path or None
        None if the model has no code in the format or the run no such history.
    """
    if model not in _DEVICE or "head" not in run.histories:
        return None
    channels = {}
    time = run.histories["head"].time
    for (group, channel), code in _CODES.items():
        history = run.histories.get(group)
        if history is not None and channel in history.channels:
            values = history.channels[channel]
            channels[code.format(_DEVICE[model])] = (values, history.units[channel])
    return isomme.write_test(
        folder,
        name,
        channels,
        start=float(time[0]),
        interval=float(np.diff(time).mean()),
        title=title,
        velocity=run.inputs.get("impact_speed", np.nan),
        mass=run.inputs.get("headform_mass", np.nan),
    )
