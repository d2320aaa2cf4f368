"""Runs of a sampled study that are kept in three dimensions: extremes, medians, failures, nearest.

They are run again after the study and packed for the viewer in ``scenes/`` of its folder, so that
report and explorer are rebuilt from the folder alone.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from mcstudy.execution.results import ResultsFolder
from mcstudy.figures import style
from mcstudy.studyfile.schema import SampledStudy
from mcstudy.studyfile.study_outputs import report_outputs
from mcstudy.viewer.explorer import Stored
from models.protocol import Model, complete_status
from studies.runs import run_again
from studies.viewing import pack_scene

FOLDER, INDEX = "scenes", "scenes/index.json"
MOST = 12
"""Runs that are kept at most."""
SHARE = 20
"""Runs of a study for each that is kept: running them again costs at most 5 % of the study."""
OUTPUTS = 2
"""Outputs whose extremes and median are kept."""
NEAREST = 2
"""Runs nearest to the accident that are kept."""


@dataclass(frozen=True)
class Measured:
    """A measured value of an output, and what counts as near: both in the model's unit."""

    output: str
    value: float
    scale: float


def notable_runs(
    model: Model, runs: pd.DataFrame, outputs: Sequence[str], measured: Sequence[Measured] = ()
) -> dict[int, str]:
    """Return the numbers of runs worth a look, the most important ones first, and why.

    Parameters
    ----------
    model : Model
    runs : DataFrame
        One row a run.
    outputs : sequence of str
        Outputs of interest, the most important ones first.
    measured : sequence of Measured
        What is known of the accident.
    """
    found: dict[int, list[str]] = {}
    whole = runs[runs["status"].isin(complete_status(model))]

    def note(row: Any, why: str) -> None:
        found.setdefault(int(runs.loc[row, "run"]), []).append(why)

    known = [item for item in measured if whole[item.output].notna().any()]
    if known:
        away = pd.DataFrame({i.output: (whole[i.output] - i.value) / i.scale for i in known})
        apart = (away**2).sum(axis=1, skipna=False).dropna().sort_values(kind="stable")
        for place, row in enumerate(apart.index[:NEAREST]):
            note(row, "nearest to the accident" if place == 0 else "next to it")
    for name in outputs[:OUTPUTS]:
        ordered = whole[name].dropna().sort_values(kind="stable").index
        if len(ordered):
            label = style.words(name)
            note(ordered[-1], f"largest {label}")
            note(ordered[len(ordered) // 2], f"median {label}")
            note(ordered[0], f"smallest {label}")
    for status, group in runs[~runs.index.isin(whole.index)].groupby("status", sort=True):
        note(group.index[0], f"{str(status).replace('_', ' ')}, one of {len(group):,} runs")
    allowed = max(1, min(MOST, len(runs) // SHARE))
    return {run: ", ".join(why) for run, why in list(found.items())[:allowed]}


def keep_scenes(
    study: SampledStudy,
    model: Model,
    runs: pd.DataFrame,
    folder: ResultsFolder,
    measured: Sequence[Measured] = (),
) -> None:
    """Run notable runs again and keep their scenes; those that are kept already stay.

    Parameters
    ----------
    study : SampledStudy
    model : Model
    runs : DataFrame
        One row a run.
    folder : ResultsFolder
        Open for writing.
    measured : sequence of Measured
        What is known of the accident.
    """
    notable = notable_runs(model, runs, report_outputs(study, model), measured)
    kept = {}
    for number, why in notable.items():
        name = f"{FOLDER}/run-{number:06d}.json"
        if not (folder.path / name).exists():
            row = runs[runs["run"] == number].iloc[0]
            packed = pack_scene(f"run {number}", run_again(model, row))
            if packed is None:
                continue
            folder.write_text(name, json.dumps(packed))
        kept[str(number)] = why
    for old in (folder.path / FOLDER).glob("run-*.json"):
        if str(int(old.stem[4:])) not in kept:
            old.unlink()
    if kept:
        folder.write_json(INDEX, kept)


def stored_scenes(folder: ResultsFolder) -> list[Stored]:
    """Return the runs that are kept in three dimensions.

    Raises
    ------
    UserError
        If a file is missing or not JSON.
    """
    if not (folder.path / INDEX).exists():
        return []
    return [
        Stored(int(number), why, folder.read_json(f"{FOLDER}/run-{int(number):06d}.json"))
        for number, why in folder.read_json(INDEX).items()
    ]
