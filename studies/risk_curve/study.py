"""Injury-risk curves fitted to a table of cases, a user's or a study's."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from mcstudy import units
from mcstudy.errors import UserError
from mcstudy.execution.results import ResultsFolder
from mcstudy.figures import risk, style
from mcstudy.injury.cases import observations_of, read_cases, read_parquet
from mcstudy.injury.risk_curve import INFLUENTIAL, RiskDescription, describe_risk
from mcstudy.report import Section, Table
from mcstudy.text import interval, number, unit
from studies.injury.analysis import CASES, proportional
from studies.injury.cells import fronts_of
from studies.injury.schema import REFERENCE, InjuryStudy
from studies.kinds import load_study
from studies.publishing import publish
from studies.runs import load_study_model


@dataclass(frozen=True)
class RiskCurveAnalysis(RiskDescription):
    """Every number of a report of injury-risk curves.

    Attributes
    ----------
    source : table of cases, or folder of an injury study.
    stimulus, unit : name and unit of the stimulus; None where the table states no unit.
    injury : name of the injury.
    """

    source: str
    stimulus: str
    unit: str | None
    injury: str


def fit_risk_curves(
    source: Path,
    stimulus: str,
    folder: ResultsFolder,
    *,
    level: int = 3,
    scenario: str | None = None,
) -> RiskCurveAnalysis:
    """Fit injury-risk curves to cases and write a report of them.

    Parameters
    ----------
    source : path
        CSV or Parquet table of cases, or the folder of an injury study.
    stimulus : str
        Column that the risk depends on.
    folder : ResultsFolder
        Folder of the report.
    level : int
        AIS from which a case counts as injured, where the table has a column ``ais``.
    scenario : str, optional
        Of an injury study; by default the reference scenario.

    Raises
    ------
    UserError
        If the table is wrong or allows no curve.
    """
    if source.is_dir() and folder.path.resolve() == source.resolve():
        raise UserError(f"{folder.path}: holds the study itself; choose another --out")
    table, named = _read(source, stimulus, scenario)
    observations = observations_of(table.reset_index(drop=True), stimulus, level, str(source))
    try:
        found = describe_risk(observations)
    except ValueError as error:
        raise UserError(f"{source}: {error}") from None
    plain = "injured" in table.columns or f"{stimulus}_low" in table.columns
    injury = "injury" if plain else f"AIS{level}+"
    words = style.words(stimulus)
    xlabel = words if named is None else style.label(stimulus, named)
    subtitle = f"{found.cases:,} cases of {source.name}, {found.injured:,} injured"
    with folder.open_for_writing():
        return publish(
            folder, f"Risk of {injury} against {words}", subtitle,
            RiskCurveAnalysis(
                **vars(found), source=str(source), stimulus=stimulus, unit=named, injury=injury
            ),
            lambda held: {"risk_curve": risk.draw_risk_curve(held, xlabel, f"risk of {injury}")},
            _sections_of,
        )  # fmt: skip


def _sections_of(analysis: RiskCurveAnalysis, figures: Mapping[str, Any]) -> list[Section]:
    caption = (
        "Risk with its 95 % band, the cases, the non-parametric estimate, and the stimuli at 5, "
        "25 and 50 % risk."
    )
    shown = {caption: figures["risk_curve"]}
    return [
        Section("Risk curve", summarise(analysis), tables(analysis), shown),
        Section("Method", _method(analysis)),
    ]


def _read(source: Path, stimulus: str, scenario: str | None) -> tuple[pd.DataFrame, str | None]:
    """Return the table of cases, and the unit of the stimulus where a study states it.

    One scenario of a study is used, its car fronts in proportion to their shares: other scenarios
    repeat the same people.
    """
    if not source.is_dir():
        if scenario is not None:
            raise UserError(f"{source}: is no injury study, it has no scenario {scenario!r}")
        return read_cases(source, stimulus), None
    study = load_study(source / "study.toml")
    if not isinstance(study, InjuryStudy):
        raise UserError(f"{source}: is not the folder of an injury study")
    table = read_parquet(source / CASES)
    wanted = scenario or REFERENCE
    if wanted not in set(table["scenario"]):
        names = ", ".join(map(str, table["scenario"].unique()))
        raise UserError(f"{source}: has no scenario {wanted!r}, only {names}")
    shares = {name: front.share for name, front in fronts_of(study).items()}
    table = proportional(table[table["scenario"] == wanted], shares)
    model = load_study_model(study)
    known = {item.name: item.unit for item in model.inputs}
    known |= {item.name: item.unit for item in model.outputs}
    if stimulus not in known:
        return table, None
    named = known[stimulus]
    if stimulus in study.inputs:
        # Inputs are shown in the unit of the study file.
        shown = study.inputs[stimulus].unit
        table[stimulus] /= units.factor(shown, named)
        named = shown
    # A run without the impact is not a case.
    return table[table[stimulus].notna()], named


def summarise(analysis: RiskCurveAnalysis) -> list[str]:
    """Return the result in sentences."""
    unit_text = f" {unit(analysis.unit)}".rstrip() if analysis.unit else ""
    half, quarter, few = (f"{interval(analysis.at[p])}{unit_text}" for p in ("0.5", "0.25", "0.05"))
    lines = [
        f"Half are injured ({analysis.injury}) at "
        f"{style.words(analysis.stimulus)} {half}, one in four at {quarter}, one in twenty at "
        f"{few} ({analysis.family} curve, {analysis.cases:,} cases, "
        f"{analysis.injured:,} injured)."
    ]
    influence = analysis.influence
    if influence is not None and influence.influential:
        worst = influence.largest[0]
        moved = (
            "leaves no curve"
            if not math.isfinite(worst.shift)
            else f"moves it by {number(abs(worst.shift), 2)} standard errors"
        )
        lines.append(
            f"{influence.influential} influential case(s): leaving out case {worst.case} {moved}."
        )
    return lines


def tables(analysis: RiskCurveAnalysis) -> list[Table]:
    """Return quality of the best curve and comparison of the families."""
    points = [
        [f"{100 * float(p):g} %", interval(entry), number(entry.quality_index, 2),
         entry.quality]
        for p, entry in analysis.at.items()
    ]  # fmt: skip
    families = [
        [name, number(entry.aic, 5), number(entry.log_likelihood, 5),
         number(entry.median), number(entry.intercept, 4), number(entry.slope, 4)]
        for name, entry in analysis.families.items()
    ]  # fmt: skip
    return [
        Table(
            f"{analysis.family} curve: stimulus at three risks, and its quality index.",
            ["risk", "stimulus (95 %)", "quality index", "class"],
            points,
        ),
        Table(
            "Families, best first.",
            ["family", "AIC", "log likelihood", "median", "intercept", "slope in ln x"],
            families,
        ),
    ]


def _weighting(analysis: RiskCurveAnalysis) -> list[str]:
    """Return a sentence on the weights of the cases, if they have any."""
    if analysis.weight is None:
        return []
    total = number(analysis.weight, 6)
    if analysis.counted:
        return [f"The rows represent {total} cases by their column 'weight', all counted."]
    return [
        f"The rows are weighted by their column 'weight' (sum {total}). The weights are not whole "
        "numbers and count as shares of a population: intervals use the sandwich estimator, and "
        "the AIC of the weighted likelihood only compares the families."
    ]


def _method(analysis: RiskCurveAnalysis) -> list[str]:
    exact = analysis.exact
    lines = [
        "Survival analysis as in ISO/TS 18506: injured cases are left-censored, uninjured ones "
        f"right-censored{f', {exact} exact' if exact else ''}; Weibull, log-normal and "
        "log-logistic curves by maximum likelihood, the one with the smallest AIC is drawn. With "
        "few cases the AIC hardly distinguishes the families: compare their medians.",
        *_weighting(analysis),
        "The band is normal on the scale of the linear predictor. The quality index is the width "
        "of the 95 % interval of the stimulus over the stimulus: up to 0.5 good, 1 fair, 1.5 "
        "marginal, above unacceptable.",
    ]
    if analysis.influence is not None:
        lines.append(
            "Each case was left out once; one counts as influential if the stimulus at 5, "
            f"25 or 50 % risk moves by more than {INFLUENTIAL:g} standard error."
        )
    return lines
