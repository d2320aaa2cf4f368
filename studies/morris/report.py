"""The report of a Morris study: factor screening in text, tables and figures."""

from collections.abc import Mapping
from typing import Any

from mcstudy.figures import screening, style
from mcstudy.report import Section, Table
from mcstudy.sampling.factors import DUMMY, PERTURBATION
from mcstudy.sampling.morris import TAIL
from mcstudy.statistics import by_size
from mcstudy.text import capital, interval, number, unit
from models.protocol import Model
from studies.factor_report import groups_said
from studies.failure_report import failure_map, failures_said, status_table
from studies.morris.analysis import MorrisAnalysis, RankedOutput
from studies.morris.schema import MorrisStudy

NAMED = 4
"""Factors that a sentence names, the largest."""
CURVED = 0.5
"""Ratio sigma / mu_star of the elementary effects above which a factor counts as non-linear or
interacting (assumed)."""


def draw(analysis: MorrisAnalysis) -> dict[str, Any]:
    """Return the study's figures by file name."""
    ranked = {name: entry for name, entry in analysis.reported.items() if entry.varies}
    if not ranked:
        return failure_map(analysis)
    return failure_map(analysis) | {
        "mean_effects": screening.draw_mean_effects(
            {name: (entry.unit, entry.factors) for name, entry in ranked.items()}, DUMMY
        ),
        "elementary_effects": screening.draw_elementary_effects(
            {
                name: (entry.unit, {k: (e.value, e.sigma) for k, e in entry.factors.items()})
                for name, entry in ranked.items()
            }
        ),
    }


def sections_of(
    study: MorrisStudy, model: Model, analysis: MorrisAnalysis, figures: Mapping[str, Any]
) -> list[Section]:
    """Return the sections of the report.

    Parameters
    ----------
    study : MorrisStudy
        Checked study file.
    model : Model
        Model of the runs.
    analysis : MorrisAnalysis
        Every number of the report.
    figures : mapping
        Figures by file name.
    """

    def one(name: str, caption: str) -> dict[str, Any]:
        return {caption: figures[name]} if name in figures else {}

    reach = f"from the {100 * TAIL:g} % to the {100 - 100 * TAIL:g} % point of a factor"
    return [
        Section(
            "Factor screening",
            [*summarise(analysis), *_not_ranked(analysis)],
            [_table(name, entry) for name, entry in analysis.reported.items() if entry.varies],
            one("mean_effects",
                f"Mean absolute elementary effect (μ*), {reach}, with 95 % intervals. Factors "
                "below the noise line are not distinguishable from zero.")
            | one("elementary_effects",
                  "Standard deviation of the elementary effects (σ) over μ*: factors at the bottom "
                  "act linearly, those towards the upper left through curvature or interactions. "
                  "Groups have no σ."),
        ),
        Section(
            "Sampling uncertainty",
            [
                f"Each of {analysis.trajectories:,} trajectories changes one factor after the "
                f"other by one large step between {study.design.levels} levels. The dummy perturbs "
                f"every input by {PERTURBATION:g} of its range: its effect is the model's noise "
                f"floor. Intervals are 95 %, by {study.report.resamples:,} bootstrap resamples of "
                "trajectories. A Morris study ranks factors; shares of variance need a Sobol' "
                "study of the influential ones.",
                *failures_said(analysis, "trajectories"),
            ],
            [status_table(analysis)],
            one("failures", "Share of failed runs in each tenth of each input."),
        ),
        Section("The model", (f"Model {model.name}, version {model.version}.",
                              groups_said(analysis))),
    ]  # fmt: skip


def summarise(analysis: MorrisAnalysis) -> list[str]:
    """Return the influential factors of the reported outputs, a paragraph each."""
    return [sentence(name, entry) for name, entry in analysis.reported.items()]


def sentence(name: str, entry: RankedOutput) -> str:
    """Return a sentence on the influential factors of an output."""
    factors = dict(entry.factors)
    noise = factors.pop(DUMMY)
    order = by_size({f: effect.value for f, effect in factors.items()})
    clear = [f for f in order if factors[f].clear]
    suffix = f" {unit(entry.unit)}".rstrip()
    title = style.words(name)
    if not entry.varies:
        return f"{capital(title)} does not vary."
    if not clear:
        return f"{capital(title)}: no factor is distinguishable from noise."
    named = ", ".join(
        f"{style.words(f)} ({number(factors[f].value)} ± "
        f"{number(factors[f].value - factors[f].low, 2)}{suffix})"
        for f in clear[:NAMED]
    )
    lines = [f"{capital(title)} is most sensitive to {named}."]
    curved = [f for f in clear[:NAMED] if factors[f].sigma > CURVED * factors[f].value]
    if curved:
        lines.append(
            "Of these, curvature or interactions with other factors show in "
            f"{', '.join(style.words(f) for f in curved)}."
        )
    weak = [f for f in order if f not in clear]
    if weak:
        lines.append(f"Not distinguishable from noise: {', '.join(style.words(f) for f in weak)}.")
    lines.append(f"Noise floor: {number(noise.value, 2)}{suffix}.")
    return " ".join(lines)


def _not_ranked(analysis: MorrisAnalysis) -> list[str]:
    missing = [
        f"{style.words(name)} ({entry.trajectories:,} of {analysis.trajectories:,})"
        for name, entry in analysis.outputs.items()
        if not isinstance(entry, RankedOutput)
    ]
    if not missing:
        return []
    return [
        "Not ranked, because too few trajectories have a value in every row (no failed run, and a "
        f"contact that the output describes): {', '.join(missing)}."
    ]


def _table(name: str, entry: RankedOutput) -> Table:
    factors = entry.factors
    order = by_size({f: effect.value for f, effect in factors.items()})
    rows = [
        [style.words(f), interval(factors[f]), number(factors[f].mean),
         number(factors[f].sigma)]
        for f in order
    ]  # fmt: skip
    caption = (
        f"{style.words(name)} [{unit(entry.unit) or '–'}]: elementary effects over "
        f"{entry.trajectories:,} trajectories."
    )
    return Table(caption, ["factor", "μ* (95 %)", "μ", "σ"], rows)
