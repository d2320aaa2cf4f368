"""Runs in the viewer: which curves of a crash it shows, and its page in a results folder."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mcstudy.viewer import Curve, ViewedRun, pack_run, render_viewer
from models.protocol import Run


@dataclass(frozen=True)
class View:
    """A history to draw, if a run has it: channels of a group by legend label."""

    group: str
    channels: dict[str, str]
    ylabel: str
    caption: str


VIEWS = {
    "head_velocity": View(
        "head",
        {"resultant": "velocity_relative_to_car"},
        "head velocity relative to the car [m/s]",
        "Velocity of the head's centre of gravity relative to the car.",
    ),
    "head_acceleration": View(
        "head",
        {"resultant": "acceleration"},
        "head acceleration [g]",
        "Resultant acceleration of the head's centre of gravity, filtered.",
    ),
    "head_angular_acceleration": View(
        "head",
        {"resultant, CFC 180": "angular_acceleration"},
        "head angular acceleration [rad/s²]",
        "Resultant angular acceleration of the head.",
    ),
}
"""Histories of the head that are drawn, by the name of their figure."""
VIEWER_CAPTION = (
    "The run in three dimensions: drag to turn, wheel to zoom, space to play, arrow keys to step."
)
EVENTS = {"head meets the car": "head_impact_time", "landing": "ground_time"}
"""Outputs that are times of events, by their label."""


def view_runs(title: str, runs: Mapping[str, Run]) -> str:
    """Return the viewer's page of runs that have a scene; empty if none has.

    Parameters
    ----------
    title : str
    runs : mapping
        Runs by label.
    """
    packed = [scene for label, run in runs.items() if (scene := pack_scene(label, run))]
    return render_viewer(title, packed) if packed else ""


def pack_scene(label: str, run: Run) -> dict[str, Any] | None:
    """Return a run packed for the viewer, JSON-able; None if it has no scene.

    Parameters
    ----------
    label : str
    run : Run
    """
    if run.scene is None:
        return None
    events = {
        name: run.outputs[output]
        for name, output in EVENTS.items()
        if np.isfinite(run.outputs.get(output, np.nan))
    }
    wad = run.outputs.get("wad", np.nan)
    length = float(wad) if np.isfinite(wad) else None
    return pack_run(ViewedRun(label, run.scene, _curves(run), events, length))


def _curves(run: Run) -> list[Curve]:
    """Return histories of the head, and the contact force of each part that was touched."""
    found = []
    for view in VIEWS.values():
        history = run.histories.get(view.group)
        if history is not None:
            found += [
                Curve(view.ylabel, history.time, history.channels[channel])
                for channel in view.channels.values()
                if channel in history.channels
            ]
    contact = run.histories.get("contact_force")
    if contact is not None:
        found += [
            Curve(f"contact force, {name.replace('_', ' ')} [kN]", contact.time, values / 1000.0)
            for name, values in contact.channels.items()
            if values.max() > 0.0
        ]
    return found
