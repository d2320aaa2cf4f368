"""The reconstruction: one run, compared with published tables and drawn."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from mcstudy.errors import StudyError, UserError
from mcstudy.execution.progress import watch
from mcstudy.execution.results import ResultsFolder
from mcstudy.figures import crash, stiffness, style
from mcstudy.figures.dents import draw_dents
from mcstudy.figures.ranges import draw_ranges
from mcstudy.report import Section, Table, render
from mcstudy.studyfile.study_inputs import fixed_values
from mcstudy.studyfile.study_outputs import check_outputs
from mcstudy.text import quantity
from models.crash.model import CrashModel
from models.protocol import Model, Run, complete_status
from studies.isomme_export import write_isomme
from studies.published_tables import PublishedTable, as_table, compare_with_table
from studies.reconstruction.schema import Reconstruction
from studies.reconstruction.variants import VariantOutcome, variant_ranges, variant_table
from studies.runs import load_study_model
from studies.viewing import VIEWER_CAPTION, VIEWS, view_runs

LONG = 5.0
"""CPU time (s) of a run from which on its progress is shown."""
PRIMARY = 0.12
"""s after first contact that the histories show: the impact on the car."""


def reconstruct(study: Reconstruction, *, quiet: bool = True) -> tuple[Run, list[PublishedTable]]:
    """Run the study's case once.

    Parameters
    ----------
    study : Reconstruction
    quiet : bool
        Show no progress of a long run.

    Returns
    -------
    run : Run
        With histories and scene.
    tables : list of PublishedTable

    Raises
    ------
    UserError
        If the study does not fit the model.
    StudyError
        If the run failed.
    """
    model = load_study_model(study)
    values = fixed_values(study.fixed, model)
    for k, table in enumerate(study.tables):
        check_outputs(list(table.units), model, f"tables[{k}].units")
        for j, row in enumerate(table.rows):
            unknown = sorted(set(row.values) - set(table.units))
            if unknown:
                raise UserError(f"tables[{k}].rows[{j}].values.{unknown[0]}: has no unit in units")
    reached = None
    if isinstance(model, CrashModel) and model.cost > LONG:
        reached = model.reached
    run = watch(lambda: model.run(values), reached, quiet=quiet)
    if run.status not in complete_status(model):
        raise StudyError(f"the run ended with status {run.status!r}")
    si = {item.name: item.unit for item in model.outputs}
    ours = {"this run": run.outputs}
    return run, [compare_with_table(table, ours, si) for table in study.tables]


def draw(study: Reconstruction, run: Run) -> dict[str, Any]:
    """Return the figures of a run by file name: those for which it has histories."""
    hit = run.outputs.get("head_impact_time", np.nan)
    marks = {"head meets the car": hit} if np.isfinite(hit) else {}
    figures: dict[str, Any] = {}
    if run.scene is not None:
        figures["kinematics"] = crash.draw_strip(run.scene, study.strip_times)
        dents = draw_dents(run.scene)
        if dents is not None:
            figures["dents"] = dents
    for name, view in VIEWS.items():
        history = run.histories.get(view.group)
        if history is None or not set(view.channels.values()) <= set(history.channels):
            continue
        figures[name] = crash.draw_history(
            history.time,
            {label: history.channels[channel] for label, channel in view.channels.items()},
            ylabel=view.ylabel,
            until=min(PRIMARY, float(history.time[-1])),
            marks=marks,
        )
    if "contact_force" in run.histories:
        contact = run.histories["contact_force"]
        figures["contact_force"] = crash.draw_history(
            contact.time,
            {
                name.replace("_", " "): values / 1000.0
                for name, values in contact.channels.items()
                if values[contact.time <= PRIMARY].max() > 0.0
            },
            ylabel="contact force, sum over segments [kN]",
            until=PRIMARY,
        )
    if "hood" in run.histories:
        hood = run.histories["hood"].channels
        figures["force_penetration"] = stiffness.draw_force_penetration(
            {"this run": (hood["penetration"], hood["force"])}
        )
    return figures


def write_reconstruction(
    study: Reconstruction,
    text: str,
    run: Run,
    tables: list[PublishedTable],
    folder: ResultsFolder,
    variants: Sequence[VariantOutcome] = (),
) -> None:
    """Write the results folder of a reconstruction: outputs, histories, figures, GIF, report.

    Parameters
    ----------
    study : Reconstruction
        Checked study file.
    text : str
        The study file as written.
    run : Run
        With histories and scene.
    tables : list of PublishedTable
        Comparison with published tables.
    folder : ResultsFolder
        Results folder of the study.
    variants : sequence of VariantOutcome
        From ``run_variants``.
    """
    model = load_study_model(study)
    with folder.open_for_writing():
        folder.write_text("study.toml", text)
        folder.write_json(
            "analysis.json",
            {
                "inputs": dict(run.inputs),
                "status": run.status,
                "end_reason": run.end_reason,
                "outputs": dict(run.outputs),
            }
            | _work(run)
            | ({"variants": list(variants)} if variants else {}),
        )
        folder.add_histories(0, run.histories)
        write_isomme(
            run, model, folder.path / "iso_mme", name=study.name, title=study.title
        )  # fmt: skip
        figures = draw(study, run)
        if variants:
            figures["variants"] = draw_ranges(variant_ranges(study, variants, model))
        style.save(figures, folder.path / "figures")
        animations = {}
        if run.scene is not None:
            gif = folder.path / "figures" / "crash.gif"
            crash.write_animation(run.scene, gif)
            animations["The whole crash, from the side and from above."] = gif.read_bytes()
        folder.write_text(
            "report.html", _report(study, model, run, tables, figures, animations, variants)
        )


def _report(
    study: Reconstruction,
    model: Model,
    run: Run,
    tables: list[PublishedTable],
    figures: dict[str, Any],
    animations: dict[str, bytes],
    variants: Sequence[VariantOutcome],
) -> str:
    captions = {name: view.caption for name, view in VIEWS.items()} | {
        "kinematics": "The body from the side, in the car's frame.",
        "dents": "Displacement of the car's shells from above: the largest, and what is left.",
        "contact_force": "Contact force of each zone of the car.",
        "force_penetration": "Force of the hood on the headform against penetration.",
        "variants": "The same inputs through models that differ in one thing.",
    }
    outputs = [
        [item.name, quantity(run.outputs[item.name], item.unit, 4), item.meaning]
        for item in model.outputs
    ]
    inputs = [
        [item.name, quantity(run.inputs[item.name], item.unit, 4), item.source]
        for item in model.inputs
    ]
    numbers = [
        Table("Outputs", ["output", "value", "meaning"], outputs),
        Table("Inputs", ["input", "value", "source"], inputs),
    ]
    work = _work(run).get("work")
    if work:
        numbers.append(
            Table(
                "Energy balance: work on the body by kind, and the energy residual.",
                ["kind", "work [J]"],
                [[name.replace("_", " "), f"{value:,.1f}"] for name, value in work.items()],
            )
        )
    apart = {
        name: {captions[name]: figures[name]} if name in figures else {}
        for name in ("kinematics", "dents", "variants")
    }
    viewer = {VIEWER_CAPTION: view_runs(study.title, {model.name: run})} if run.scene else {}
    rest = {captions[name]: figure for name, figure in figures.items() if name not in apart}
    sections = [
        Section("Comparison with the published tables", (), [as_table(table) for table in tables]),
        Section("One change at a time", *_variants_said(study, model, variants), apart["variants"]),
        Section("Kinematics", (), (), apart["kinematics"], animations, viewer),
        Section("Dents", (), (), apart["dents"]),
        Section("Histories", (), (), rest),
        Section("Numbers", (), numbers),
    ]
    return render(
        study.title,
        f"One run of the {model.name} model; it ended with {run.end_reason.replace('_', ' ')}.",
        [s for s in sections if s.tables or s.figures or s.animations],
    )


def _variants_said(
    study: Reconstruction, model: Model, variants: Sequence[VariantOutcome]
) -> tuple[list[str], list[Table]]:
    """Return what precedes the figure of the variants, and their table."""
    if not variants:
        return [], []
    said = (
        "Every variant takes the inputs of this case. A difference between neighbours is due to "
        "the one thing that they do not share if it exceeds the scatter of the perturbed runs."
    )
    return [said], [variant_table(study, variants, model)]


def _work(run: Run) -> dict[str, dict[str, float]]:
    """Return the work by kind (J), if the model reports an energy balance."""
    if "work" not in run.histories:
        return {}
    return {"work": {k: float(v[0]) for k, v in run.histories["work"].channels.items()}}
