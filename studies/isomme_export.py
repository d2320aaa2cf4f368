"""Runs written as ISO-MME, for other programs to read."""

from pathlib import Path

import numpy as np

from mcstudy.measurement import isomme
from models.protocol import Model, Run

MIN_COUNT = 8
"""Minimum samples of an impact with the road."""

CAR, ROAD = "car", "road"
"""Phases of a crash: up to the body's first contact with the road, and from it on."""
_PHASES = {
    CAR: "Impact with the car: ends when trunk or head first meet the road; the impact with the "
    "road is a test of its own.",
    ROAD: "Impact with the road: begins when trunk or head first meet it; the impact with the car "
    "is a test of its own.",
}


def write_isomme(run: Run, model: Model, folder: Path, *, name: str, title: str) -> list[Path]:
    """Write the head signals of a run as ISO-MME tests and return their ``.mme`` files.

    A crash is two tests, the impact with the car and that with the road: a single
    head signal would give only the criteria of the harder impact.

    Parameters
    ----------
    run : Run
        With histories.
    model : Model
        Model of the run.
    folder : path
        Folder in which each test has a folder of its name.
    name : str
        Name of the test; the impact with the road has ``_road`` behind it.
    title : str
        Title of the test.

    Returns
    -------
    list of Path
        Empty if the model has no code in the format or the run no such history.
    """
    if not model.isomme_device or "head" not in run.histories:
        return []
    time = run.histories["head"].time
    landing = run.outputs.get("ground_time", np.inf)
    split = int(np.searchsorted(time, landing)) if np.isfinite(landing) else time.size
    if "ground_time" not in run.outputs:
        return [_write(run, model, folder / name, slice(0, None), name, title, "")]
    files = [_write(run, model, folder / name, slice(0, split), name, title, _PHASES[CAR])]
    if time.size - split >= MIN_COUNT:
        name = f"{name}_{ROAD}"
        files.append(
            _write(run, model, folder / name, slice(split, None), name, title, _PHASES[ROAD])
        )
    return files


def _write(
    run: Run, model: Model, folder: Path, phase: slice, name: str, title: str, comment: str
) -> Path:
    channels = {}
    head = run.histories["head"].time
    for measured, traits in model.channels.items():
        group, _, channel = measured.partition("_")
        history = run.histories.get(group)
        if traits.code and history is not None and channel in history.channels:
            values = history.channels[channel][phase]
            code = traits.code.format(model.isomme_device)
            channels[code] = (values, history.units[channel])
    return isomme.write_test(
        folder,
        name,
        channels,
        start=float(head[phase][0]),
        interval=float(np.diff(head).mean()),
        title=title,
        comment=comment,
        velocity=run.inputs.get("impact_speed", np.nan),
        mass=run.inputs.get("headform_mass", np.nan),
    )
