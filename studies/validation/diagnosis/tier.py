"""The full tier: many trials and the resulting rates."""

import itertools
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from mcstudy.execution.results import ResultsFolder
from mcstudy.figures import style
from mcstudy.figures.panels import Curve, Panel, draw_panels
from mcstudy.report import Section, Table
from mcstudy.statistics import Estimate, probability
from mcstudy.text import number, percent
from mcstudy.typed_json import from_plain
from studies.publishing import publish
from studies.validation.diagnosis.outcomes import run_trials
from studies.validation.diagnosis.trial import Outcome, Trial, run_trial

SHARES = {
    ("none", False, True): 3,
    ("none", False, False): 2,
    ("none", True, False): 1,
    ("own form", False, True): 2,
    ("own form", False, False): 1,
    ("own form", True, False): 1,
    ("foreign form", False, True): 4,
    ("foreign form", False, False): 2,
    ("foreign form", True, False): 2,
    ("outside", False, True): 2,
    ("outside", False, False): 1,
    ("pair", True, True): 2,
}
"""Sets of each kind, with load cell and rebound speed or not, of the usual laboratory or another:
half of the sets have forms or effects that the catalogue does not have."""
SETS = 300
SEED = 40_000
"""Seed of the first trial of a kind."""
VISIBLE, LARGE = 1.0, 10.0
"""Sizes over the minimum detectable one from which an effect counts as visible and as large."""
BINS = (0.0, 0.5, 1.0, 2.0, 5.0, 10.0, np.inf)


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


def _single_wrong(outcome: Outcome) -> bool:
    return len(outcome.named) == 1 and not _right(outcome)


def _of(kind: str, least: float = 0.0) -> Callable[[Outcome], bool]:
    return lambda o: o.trial.kind == kind and o.size >= least


def _both(outcome: Outcome) -> bool:
    return all(name in outcome.named for name in outcome.names)


TARGETS = (
    Target("false_alarms", "false alarms without effect",
           _of("none"), lambda o: o.detected, 0.0, 0.05),
    Target("false_names", "given a name without effect",
           _of("none"), lambda o: bool(o.named), 0.0, 0.005),
    Target("own_named", "own form of a visible size named, alone or in a set",
           _of("own form", VISIBLE), _right, 0.95, 1.0),
    Target("foreign_named", "foreign form of a visible size named, alone or in a set",
           _of("foreign form", VISIBLE), _right, 0.85, 1.0),
    Target("own_single_wrong", "own form: one single wrong name",
           _of("own form"), _single_wrong, 0.0, 0.02),
    Target("foreign_single_wrong", "foreign form: one single wrong name",
           _of("foreign form"), _single_wrong, 0.0, 0.02),
    Target("large_detected", "detected at ten times the visible size or more",
           lambda o: o.trial.kind in ("own form", "foreign form") and o.size >= LARGE,
           lambda o: o.detected, 0.99, 1.0),
    Target("outside_unexplained", "outside the catalogue, given an alarm: unexplained",
           lambda o: o.trial.kind == "outside" and o.detected, lambda o: not o.named, 0.95, 1.0),
    Target("pair_both", "two effects, the smaller one visible: both named",
           _of("pair", VISIBLE), _both, 0.75, 1.0),
    Target("pair_wrong", "two effects: wrong and unflagged",
           _of("pair"), lambda o: bool(o.named) and not o.flagged and not _right(o), 0.0, 0.03),
    Target("spurious_second", "a spurious second effect when one is hidden",
           lambda o: o.trial.kind in ("own form", "foreign form"),
           lambda o: o.second is not None, 0.0, 0.02),
)  # fmt: skip
HIDDEN = {"own form": style.BLUE, "foreign form": style.RED, "pair": style.GREEN}
"""Kinds of sets whose shares are shown by size, with the colours of their curves."""
GAINS = {"inside": 0.15, "above": 0.25}
"""Least gain in CRPS of HIC15 on held-out tests of effects that were named rightly, by region."""


def plan(sets: int) -> list[Trial]:
    """Return the trials of a tier, in proportion to ``SHARES``."""
    whole = sum(SHARES.values())
    trials = []
    for (kind, force, usual), share in SHARES.items():
        count = max(1, round(sets * share / whole))
        trials += [Trial(SEED + k, kind, force, usual) for k in range(count)]
    return trials


def validate_diagnosis(
    folder: ResultsFolder, *, sets: int = SETS, workers: int = -1, quiet: bool = False
) -> dict[str, Any]:
    """Run the trials, write their report and return the analysis.

    Trials that an interrupted validation of the same code left in the folder are not run again.

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
    with folder.open_for_writing():
        outcomes = run_trials(folder.path, trials, run_trial, Outcome, workers, quiet=quiet)
        return publish(
            folder, "Validation of the diagnosis",
            f"{len(outcomes)} sets of tests from seed {SEED} on, effects hidden by an independent "
            "program",
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
        "gains": _gains(outcomes),
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


def _gains(outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Return the median gain in CRPS and the coverages of effects named rightly, by region."""
    rows = []
    for region in ("inside", "above", "below"):
        part = [o.gains[region] for o in outcomes if region in o.gains]
        if part:
            values = np.array([gain.crps for gain in part])
            low, high = np.quantile(values, [0.25, 0.75])
            rows.append(
                {
                    "region": region,
                    "trials": len(part),
                    "median": float(np.median(values)),
                    "low": float(low),
                    "high": float(high),
                    "against_process": float(np.median([gain.against_process for gain in part])),
                    "coverage_base": float(np.mean([gain.coverage_base for gain in part])),
                    "coverage_extended": float(np.mean([gain.coverage for gain in part])),
                    "least": GAINS.get(region, 0.0),
                }
            )
    return rows


def _power(outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Return the shares of effects that are detected and named, by kind and size.

    Of two effects the smaller one counts, and both must be named.
    """
    rows = []
    for kind in HIDDEN:
        for low, high in itertools.pairwise(BINS):
            part = [o for o in outcomes if o.trial.kind == kind and low <= o.size < high]
            if part:
                rows.append(
                    {
                        "kind": kind,
                        "size": float(np.median([o.size for o in part])),
                        "trials": len(part),
                        "detected": asdict(probability(np.array([o.detected for o in part]))),
                        "named": asdict(probability(np.array([_both(o) for o in part]))),
                    }
                )
    return rows


def _draw(analysis: Mapping[str, Any]) -> dict[str, Any]:
    panels = []
    label = "size over the minimum detectable (80 % power) [–]"
    for key in ("detected", "named"):
        curves = []
        for kind, colour in HIDDEN.items():
            rows = [row for row in analysis["power"] if row["kind"] == kind]
            if rows:
                size = np.array([row["size"] for row in rows])
                share = np.array([row[key]["value"] for row in rows])
                curves.append(Curve(size, share, kind, colour=colour, marker="o"))
        if curves:
            panels.append(
                Panel(label, f"share {key} [–]", curves, xlim=(0.0, 20.0), ylim=(0.0, 1.02),
                      legend="lower right")
            )  # fmt: skip
    return {"power": draw_panels(panels)} if panels else {}


def summarise(analysis: Mapping[str, Any]) -> list[Table]:
    """Return rates against targets and the confusion of names."""
    rates = [
        [row["what"], str(row["trials"]), percent(from_plain(Estimate, row)), _wanted(row),
         "met" if row["met"] else "within its interval" if row["allowed"] else "MISSED"]
        for row in analysis["rates"].values()
    ]  # fmt: skip
    confused = [
        [hidden, str(sum(row.values())),
         ", ".join(f"{name} ({row[name]})" for name in sorted(row, key=lambda name: -row[name]))]
        for hidden, row in analysis["confusion"].items()
    ]  # fmt: skip
    power = [
        [row["kind"], number(row["size"]), str(row["trials"]),
         *(percent(from_plain(Estimate, row[key])) for key in ("detected", "named"))]
        for row in analysis["power"]
    ]  # fmt: skip
    gains = [
        [row["region"], str(row["trials"]),
         f"{100.0 * row['median']:.0f} % ({100.0 * row['low']:.0f} to {100.0 * row['high']:.0f})",
         f"{100.0 * row['against_process']:.0f} %", f"{100.0 * row['coverage_base']:.0f} %",
         f"{100.0 * row['coverage_extended']:.0f} %",
         f"at least {100.0 * row['least']:g} %" if row["least"] else ""]
        for row in analysis["gains"]
    ]  # fmt: skip
    return [
        Table("Rates with 95 % intervals.", ["what", "trials", "rate", "target", "verdict"], rates),
        Table("By form and size, median of its class; of two effects the smaller one's size, and "
              "both are named.",
              ["form", "size", "trials", "detected", "named"], power),
        Table("HIC15 of held-out tests where the name was right: gain in CRPS (median and "
              "quartiles over sets) against the base model and a Gaussian process, and coverage "
              "of 90 % intervals.",
              ["region", "sets", "gain", "against process", "coverage, base",
               "coverage, extended", "target"], gains),
        Table("Answers by hidden effect: the first name, and in how many sets.",
              ["hidden", "sets", "answers"], confused),
    ]  # fmt: skip


def _wanted(row: Mapping[str, Any]) -> str:
    if row["least"] == 0.0:
        return f"at most {100.0 * row['most']:g} %"
    return f"at least {100.0 * row['least']:g} %"


def _sections(analysis: Mapping[str, Any], figures: Mapping[str, Any]) -> list[Section]:
    words = [
        "Effects were hidden in sets of headform tests by a generator with its own integrators and "
        "contact laws. Half of the sets are of the usual laboratory (18 tests at 5 to 10 m/s, "
        "noise 1 g, recorded speed within 0.05 m/s, 1 % scatter from test to test), half of others "
        "(6 to 40 tests, other curves, masses, speeds, sampling rates, noise, with and without "
        "repeats at one speed). Effect, form and size were drawn from seeds unknown to the "
        "diagnosis; foreign forms are none of the catalogue's formulas.",
        f"A diagnosis took {number(analysis['seconds']['median'])} s on one core (median), "
        f"{number(analysis['seconds']['largest'])} s at most.",
    ]
    caption = "Shares of the effects that were detected and named, both of two."
    shown = {caption: figures["power"]} if "power" in figures else {}
    return [Section("Rates", words, summarise(analysis), shown)]


def failed(analysis: Mapping[str, Any]) -> list[str]:
    """Return the targets that are missed beyond their interval."""
    return [row["what"] for row in analysis["rates"].values() if not row["allowed"]]
