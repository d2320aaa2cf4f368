"""Runs in the viewer: which curves of a crash it shows, and its page in a results folder."""

from collections.abc import Mapping

import numpy as np

from mcstudy.viewer import Curve, ViewedRun, render_viewer
from models.protocol import Run

HISTORIES = {
    "head acceleration [g]": ("head", "acceleration"),
    "head angular acceleration [rad/s²]": ("head", "angular_acceleration"),
    "head velocity relative to the car [m/s]": ("head", "velocity_relative_to_car"),
}
"""Group and channel of each curve, by its label."""
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
    viewed = [
        ViewedRun(
            label,
            run.scene,
            _curves(run),
            {
                name: run.outputs[output]
                for name, output in EVENTS.items()
                if np.isfinite(run.outputs.get(output, np.nan))
            },
        )
        for label, run in runs.items()
        if run.scene is not None
    ]
    return render_viewer(title, viewed) if viewed else ""


def _curves(run: Run) -> list[Curve]:
    """Return histories of the head, and the contact force of each part that was touched."""
    found = []
    for label, (group, channel) in HISTORIES.items():
        history = run.histories.get(group)
        if history is not None and channel in history.channels:
            found.append(Curve(label, history.time, history.channels[channel]))
    contact = run.histories.get("contact_force")
    if contact is not None:
        found += [
            Curve(f"contact force, {name.replace('_', ' ')} [kN]", contact.time, values / 1000.0)
            for name, values in contact.channels.items()
            if values.max() > 0.0
        ]
    return found
