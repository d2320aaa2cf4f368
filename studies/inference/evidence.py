"""Inference from evidence on the runs of an existing results folder, and draws for Python."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pydantic import TypeAdapter

from mcstudy.errors import UserError
from mcstudy.execution.results import ResultsFolder
from mcstudy.files import parse_toml, read_study_text
from mcstudy.posterior.inference import SETS
from mcstudy.sampling import seeds
from mcstudy.studyfile.reading import check_study
from mcstudy.studyfile.schema import SampledStudy
from models.protocol import Model
from studies.kinds import KINDS, load_study, parse_study
from studies.posterior.analysis import analyse
from studies.posterior.case import Case
from studies.posterior.evidence import check_tables, units_of
from studies.posterior.numbers import PosteriorAnalysis
from studies.posterior.report import draw, sections_of
from studies.posterior.schema import EvidenceFile, EvidenceTables, PosteriorStudy
from studies.publishing import publish
from studies.runs import columns_of, load_study_model

DRAWS = 4000
"""Draws of a posterior as a table."""

_EVIDENCE: TypeAdapter[EvidenceFile] = TypeAdapter(EvidenceFile)


def read_evidence(path: Path | str) -> tuple[EvidenceTables, str]:
    """Return the evidence of a file, and its title.

    Parameters
    ----------
    path : path or str
        Evidence file, or a posterior study's.

    Raises
    ------
    UserError
        If something in it is wrong; the message names the file and the place in it.
    """
    text = read_study_text(path)
    if str(parse_toml(text, str(path)).get("format", "")).startswith("mcstudy-study/"):
        study = parse_study(text, str(path))
        if not isinstance(study, PosteriorStudy):
            raise UserError(f"{path}: a study of kind {study.kind} has no evidence")
        return study, study.title
    found = check_study(text, str(path), _EVIDENCE)
    return found, found.title


def load_bank(source: ResultsFolder) -> tuple[SampledStudy, Model, pd.DataFrame]:
    """Return the study of a results folder, its model, and the runs that are a sample.

    Parameters
    ----------
    source : ResultsFolder
        Of a posterior, Monte Carlo or Sobol' study.

    Raises
    ------
    UserError
        If its design is no sample of the inputs.
    """
    study = load_study(source.path / "study.toml")
    kind = KINDS.get(study.kind)
    if kind is None or not isinstance(study, SampledStudy):
        raise UserError(
            f"{source.path}: is the folder of a study of kind {study.kind}; evidence is held "
            "against those of posterior, Monte Carlo and Sobol' studies"
        )
    model = load_study_model(study)
    runs = kind.independent_rows(source.runs(columns_of(model)), source)
    return study, model, runs


def infer(
    source: ResultsFolder, evidence: Path | str, out: ResultsFolder | None = None
) -> PosteriorAnalysis:
    """Infer a quantity from evidence and the runs of a folder, and write a report.

    Parameters
    ----------
    source : ResultsFolder
        Of a posterior, Monte Carlo or Sobol' study: the bank.
    evidence : path or str
        Evidence file, or a posterior study's.
    out : ResultsFolder, optional
        Folder of the report, by default ``posterior_<name of the file>`` in the folder.

    Raises
    ------
    UserError
        If file and folder do not fit each other.
    StudyError
        If no run agrees with the evidence.
    """
    tables, title = read_evidence(evidence)
    study, model, runs = load_bank(source)
    check_tables(tables, study, model)
    folder = out or ResultsFolder(Path(source.path) / f"posterior_{Path(evidence).stem}")
    if folder.path.resolve() == source.path.resolve():
        raise UserError(f"{folder.path}: holds the study itself; choose another --out")
    analysis = analyse(tables, study, model, runs)
    with folder.open_for_writing():
        folder.write_text("evidence.toml", read_study_text(evidence))
        subtitle = (
            f"Evidence of {len(tables.evidence)} items on {len(runs):,} runs of the {study.kind} "
            f"study {study.name}"
        )
        return publish(folder, title, subtitle, analysis, draw, sections_of)


def posterior_draws(source: ResultsFolder, evidence: Path | str, *, n: int = DRAWS) -> pd.DataFrame:
    """Return equally weighted draws of a posterior: all inputs and outputs, in the model's units.

    The target is adjusted to the evidence; the other columns are those of the run of each draw.

    Parameters
    ----------
    source : ResultsFolder
        Of a posterior, Monte Carlo or Sobol' study: the bank.
    evidence : path or str
        Evidence file, or a posterior study's.
    n : int
        Number of draws.

    Raises
    ------
    UserError
        If file and folder do not fit each other.
    StudyError
        If no run agrees with the evidence.
    """
    tables, _ = read_evidence(evidence)
    study, model, runs = load_bank(source)
    check_tables(tables, study, model)
    case = Case(tables, study, model, runs)
    posterior = case.posterior(case.items, sets=SETS)
    draws = posterior.given()
    rng = seeds.generator(study.seed, seeds.EVIDENCE, 6)
    chosen = rng.choice(draws.values.size, n, p=draws.weights)
    columns = {name: case.bank.values[name][draws.runs[chosen]] for name in units_of(model)}
    return pd.DataFrame(columns | {tables.target: draws.values[chosen]})


def to_inference_data(draws: pd.DataFrame) -> Any:
    """Return draws as ``InferenceData`` of ArviZ, one chain.

    Parameters
    ----------
    draws : DataFrame
        From ``posterior_draws``.

    Raises
    ------
    UserError
        If ArviZ is not installed.
    """
    try:
        import arviz
    except ImportError:
        raise UserError("ArviZ is not installed: pip install arviz") from None
    table = {str(name): np.asarray(draws[name])[None] for name in draws.columns}
    return arviz.from_dict(table)
