"""Tables, figures and report of a method comparison."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mcstudy.figures import crash
from mcstudy.figures.dents import draw_dents
from mcstudy.report import Section, Table
from mcstudy.text import capital, quantity
from models.protocol import Model, Run
from studies.method_comparison.schema import MethodComparison
from studies.published_tables import PublishedTable, as_table, compare_methods_with_table
from studies.reconstruction.study import PRIMARY
from studies.viewing import VIEWER_CAPTION, VIEWS, view_runs

MARGIN = 0.03
"""s of acceleration that is shown around the impacts of the head."""


def units_of(models: Mapping[str, Model]) -> dict[str, str]:
    """Return the unit of each output that any of the models has."""
    return {item.name: item.unit for model in models.values() for item in model.outputs}


def compare(
    study: MethodComparison, models: Mapping[str, Model], ours: Mapping[str, Mapping[str, float]]
) -> list[PublishedTable]:
    """Return the published tables with rows of the methods, and means.

    Parameters
    ----------
    study : MethodComparison
        Checked study file.
    models : mapping
        Models by label.
    ours : mapping
        Outputs by label.

    Raises
    ------
    UserError
        If a unit of a table does not fit.
    """
    si = units_of(models)
    return [compare_methods_with_table(table, ours, si) for table in study.tables]


def summarise(
    study: MethodComparison, models: Mapping[str, Model], ours: Mapping[str, Mapping[str, float]]
) -> list[Table]:
    """Return the tables in brief: the methods, the mean of the published ones, the observations.

    Parameters
    ----------
    study : MethodComparison
        Checked study file.
    models : mapping
        Models by label.
    ours : mapping
        Outputs by label.
    """
    brief = []
    for table, whole in zip(study.tables, compare(study, models, ours), strict=True):
        single = {row.label for row in table.rows if row.kind == "simulated"}
        rows = [row for row in whole.rows if row[0] not in single]
        brief.append(as_table(replace(whole, rows=rows)))
    return brief


def draw(study: MethodComparison, runs: Mapping[str, Run]) -> dict[str, Any]:
    """Return the figures by file name: those for which all the runs have histories.

    Parameters
    ----------
    study : MethodComparison
        Checked study file.
    runs : mapping
        Runs by label.
    """
    figures: dict[str, Any] = {}
    scenes = {label: run.scene for label, run in runs.items() if run.scene is not None}
    if scenes:
        figures["kinematics"] = crash.draw_strips(scenes, study.strip_times)
    hits = {
        label: float(run.outputs.get("head_impact_time", np.nan)) for label, run in runs.items()
    }
    for name, view in VIEWS.items():
        (channel,) = view.channels.values()
        curves = {}
        for label, run in runs.items():
            history = run.histories.get(view.group)
            if history is not None and channel in history.channels:
                curves[label] = (history.time, history.channels[channel])
        if len(curves) < len(runs):
            continue
        known = [hit for hit in hits.values() if np.isfinite(hit)]
        # An acceleration says something around the impact only.
        near = name != "head_velocity" and bool(known)
        figures[name] = crash.draw_curves(
            curves,
            ylabel=view.ylabel,
            since=max(min(known) - MARGIN, 0.0) if near else 0.0,
            until=max(known) + MARGIN if near else PRIMARY,
            points=hits,
        )
    for label, scene in scenes.items():
        dents = draw_dents(scene)
        if dents is not None:
            figures[f"dents_{label}"] = dents
    return figures


def sections_of(
    study: MethodComparison,
    models: Mapping[str, Model],
    runs: Mapping[str, Run],
    tables: Sequence[PublishedTable],
    figures: Mapping[str, Any],
) -> list[Section]:
    """Return the sections of the report.

    Parameters
    ----------
    study : MethodComparison
        Checked study file.
    models, runs : mapping
        Models and runs by label.
    tables : sequence of PublishedTable
        From ``compare``.
    figures : mapping
        From ``draw``.
    """
    captions = {name: f"{view.caption[:-1]}; a point marks its impact." for name, view in
                VIEWS.items()} | {
        "kinematics": "The body from the side, in the car's frame: a row a method.",
    } | {
        f"dents_{label}": f"{capital(label)}: displacement of the car's shells from above."
        for label in models
    }  # fmt: skip
    said = [
        f"{capital(label)}: model {model.name}, version {model.version}; the run ended with "
        f"{runs[label].end_reason.replace('_', ' ')}."
        for label, model in models.items()
    ]
    said.append("All methods have one set of inputs; none was adjusted to the published tables.")
    for label, model in models.items():
        ignored = {item.name: item.ignored for item in model.inputs if item.ignored}
        said += [
            f"{capital(label)} ignores {name.replace('_', ' ')}: {why}."
            for name, why in ignored.items()
            if name in study.fixed
        ]
    shown = {captions[name]: figure for name, figure in figures.items()}
    page = view_runs(study.title, runs)
    viewer = {VIEWER_CAPTION: page} if page else {}
    kinematics = captions["kinematics"]
    return [
        Section("Comparison with the published tables", said, [as_table(t) for t in tables]),
        Section("In three dimensions", pages=viewer),
        Section("Kinematics", (), (),
                {kinematics: shown.pop(kinematics)} if "kinematics" in figures else {}),
        Section("Histories", (), (), shown),
        Section("Numbers", (), [_outputs_table(models, runs)]),
    ]  # fmt: skip


def _outputs_table(models: Mapping[str, Model], runs: Mapping[str, Run]) -> Table:
    """Return every output of every method."""
    meanings = {item.name: item.meaning for m in models.values() for item in m.outputs}
    rows = [
        [
            name,
            *(quantity(run.outputs[name], unit, 4) if name in run.outputs else ""
              for run in runs.values()),
            meanings[name],
        ]
        for name, unit in units_of(models).items()
    ]  # fmt: skip
    return Table("Outputs", ["output", *runs, "meaning"], rows)
