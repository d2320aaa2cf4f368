"""The full tier: many trials and the resulting rates."""

import itertools
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from mcstudy.execution.progress import follow
from mcstudy.execution.results import ResultsFolder
from mcstudy.execution.workers import run_jobs
from mcstudy.figures.panels import Curve, Panel, draw_panels
from mcstudy.report import Section, Table
from mcstudy.statistics import Estimate, probability
from mcstudy.text import number, percent
from mcstudy.typed_json import from_plain
from studies.publishing import publish
from studies.validation.diagnosis.trial import Outcome, Trial, run_trial

SHARES = {
    ("none", False): 4,
    ("none", True): 2,
    ("own form", False): 5,
    ("own form", True): 3,
    ("foreign form", False): 2,
    ("outside", False): 2,
    ("pair", True): 2,
}
"""Of twenty trials: a quarter and more without effect, a tenth outside the catalogue, pairs."""
SETS = 300
BATCH = 16
"""Trials that are run at a time."""
LARGE = 2.0
"""Size, over the minimum detectable one, from which an effect counts as large."""
BINS = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, np.inf)


@dataclass(frozen=True)
class Target:
    """A required rate: name, eligible trials, hits, and bounds of the rate."""

    key: str
    what: str
    counts: Callable[[Outcome], bool]
    hits: Callable[[Outcome], bool]
    low: float
    high: float


def _right(outcome: Outcome) -> bool:
    return any(name in outcome.named for name in outcome.names)


TARGETS = (
    Target("false_alarms", "false alarms without effect",
           lambda o: o.trial.kind == "none", lambda o: o.detected, 0.0, 0.05),
    Target("detection", "detection at twice the detectable size or more",
           lambda o: o.trial.kind == "own form" and o.size >= LARGE,
           lambda o: o.detected, 0.90, 1.0),
    Target("truth_in_set", "truth in the named set, given detection",
           lambda o: o.trial.kind == "own form" and bool(o.named), _right, 0.95, 1.0),
    Target("single_wrong", "one single wrong name",
           lambda o: o.trial.kind == "own form",
           lambda o: len(o.named) == 1 and not _right(o), 0.0, 0.02),
    Target("outside_named", "outside the catalogue, given a catalogue name",
           lambda o: o.trial.kind == "outside", lambda o: bool(o.named), 0.0, 0.10),
    Target("other_form", "other functional form named rightly, given detection",
           lambda o: o.trial.kind == "foreign form" and o.detected, _right, 0.80, 1.0),
    Target("pair_both", "two effects: both named, given detection",
           lambda o: o.trial.kind == "pair" and o.detected,
           lambda o: all(name in o.named for name in o.names), 0.65, 1.0),
    Target("pair_wrong", "two effects: wrong and unflagged",
           lambda o: o.trial.kind == "pair",
           lambda o: bool(o.named) and not o.flagged and not _right(o), 0.0, 0.03),
    Target("spurious_second", "a spurious second effect when one is hidden",
           lambda o: o.trial.kind in ("own form", "foreign form"),
           lambda o: o.second is not None, 0.0, 0.02),
)  # fmt: skip


def plan(sets: int) -> list[Trial]:
    """Return the trials of a tier, in proportion to ``SHARES``."""
    whole = sum(SHARES.values())
    trials = []
    for (kind, force), share in SHARES.items():
        count = max(1, round(sets * share / whole))
        trials += [Trial(10_000 + k, kind, force) for k in range(count)]
    return trials


def validate_diagnosis(
    folder: ResultsFolder, *, sets: int = SETS, workers: int = -1, quiet: bool = False
) -> dict[str, Any]:
    """Run the trials, write their report and return the analysis.

    Parameters
    ----------
    folder : ResultsFolder
        Folder of the report.
    sets : int
        Approximate number of trials.
    workers : int
        Processes, -1 for one per core.
    quiet : bool
        No progress line.
    """
    trials = plan(sets)
    # Sorted by seed, so that every kind is there from the start.
    trials.sort(key=lambda t: (t.seed, t.kind, t.force))
    outcomes: list[Outcome] = []
    for start in follow(range(0, len(trials), BATCH), f"batches of {BATCH} trials", quiet=quiet):
        outcomes += run_jobs(run_trial, trials[start : start + BATCH], workers)
    with folder.open_for_writing():
        return publish(
            folder, "Validation of the diagnosis",
            f"{len(outcomes)} sets of 18 tests, effects hidden by an independent program",
            analyse(outcomes), _draw, _sections,
        )  # fmt: skip


def analyse(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Return rates, confusion and power of outcomes."""
    rates = {}
    for target in TARGETS:
        counted = [o for o in outcomes if target.counts(o)]
        if not counted:
            continue
        rate = probability(np.array([target.hits(o) for o in counted]))
        rates[target.key] = {
            "what": target.what,
            "trials": len(counted),
            "least": target.low,
            "most": target.high,
            "met": target.low <= rate.value <= target.high,
            "allowed": rate.low <= target.high and rate.high >= target.low,
            **vars(rate),
        }
    return {
        "rates": rates,
        "confusion": confusion(outcomes),
        "power": _power(outcomes),
        "seconds": {
            "median": float(np.median([o.seconds for o in outcomes])),
            "largest": float(max(o.seconds for o in outcomes)),
        },
        "outcomes": [asdict(o) for o in outcomes],
    }


def confusion(outcomes: Sequence[Outcome]) -> dict[str, dict[str, int]]:
    """Return the confusion matrix of hidden and named effects, single effects only."""
    table: dict[str, Counter[str]] = {}
    for o in outcomes:
        if len(o.names) > 1:
            continue
        hidden = o.names[0] if o.names else "nothing"
        given = "adequate" if o.cause is None else o.cause
        table.setdefault(hidden, Counter())[given] += 1
    return {name: dict(table[name]) for name in sorted(table)}


def _power(outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Return the share of effects of the catalogue that are detected, by size."""
    rows = []
    for low, high in itertools.pairwise(BINS):
        part = [o for o in outcomes if o.trial.kind == "own form" and low <= o.size < high]
        if part:
            rate = probability(np.array([o.detected for o in part]))
            middle = float(np.median([o.size for o in part]))
            rows.append({"size": middle, "trials": len(part), **vars(rate)})
    return rows


def _draw(analysis: Mapping[str, Any]) -> dict[str, Any]:
    rows = analysis["power"]
    if not rows:
        return {}
    size = np.array([row["size"] for row in rows])
    share = [Curve(size, np.array([row["value"] for row in rows]), "detected", marker="o")]
    share += [Curve(np.full(2, row["size"]), np.array([row["low"], row["high"]])) for row in rows]
    label = "size over the minimum detectable (80 % power) [-]"
    panel = Panel(label, "share detected [-]", share, xlim=(0.0, 10.0), ylim=(0.0, 1.02),
                  legend="lower right")  # fmt: skip
    return {"power": draw_panels([panel], width=6.0, height=4.0)}


def summarise(analysis: Mapping[str, Any]) -> list[Table]:
    """Return rates against targets and the confusion of names."""
    rates = [
        [row["what"], str(row["trials"]), percent(from_plain(Estimate, row)), _wanted(row),
         "met" if row["met"] else "within its interval" if row["allowed"] else "MISSED"]
        for row in analysis["rates"].values()
    ]  # fmt: skip
    given = sorted({name for row in analysis["confusion"].values() for name in row})
    confused = [
        [hidden, *(str(row.get(name, "")) for name in given)]
        for hidden, row in analysis["confusion"].items()
    ]
    return [
        Table("Rates with 95 % intervals.", ["what", "trials", "rate", "target", "verdict"], rates),
        Table("Confusion matrix: hidden (rows) and named (columns).", ["hidden", *given], confused),
    ]


def _wanted(row: Mapping[str, Any]) -> str:
    if row["least"] == 0.0:
        return f"at most {100.0 * row['most']:g} %"
    return f"at least {100.0 * row['least']:g} %"


def _sections(analysis: Mapping[str, Any], figures: Mapping[str, Any]) -> list[Section]:
    words = [
        "Effects were hidden in sets of 18 headform tests by a generator with its own integrator "
        "and contact laws; noise 1 g, recorded speed within 0.05 m/s, 1 % scatter from test to "
        "test. Effect, form and size were drawn from seeds unknown to the diagnosis.",
        f"A diagnosis took {number(analysis['seconds']['median'])} s on one core (median), "
        f"{number(analysis['seconds']['largest'])} s at most.",
    ]
    shown = {"Share of the catalogue's effects that was detected.": figures["power"]} if (
        "power" in figures
    ) else {}  # fmt: skip
    return [Section("Rates", words, summarise(analysis), shown)]


def failed(analysis: Mapping[str, Any]) -> list[str]:
    """Return the targets that are missed beyond their interval."""
    return [row["what"] for row in analysis["rates"].values() if not row["allowed"]]
