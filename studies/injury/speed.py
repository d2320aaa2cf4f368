"""Risk against impact speed, and the speed that halves it."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import optimize

from mcstudy.figures.style import words
from mcstudy.sampling import seeds
from studies.injury.numbers import HalvingSpeed, SpeedCurve, SpeedRisk
from studies.injury.schema import REFERENCE, InjuryStudy
from studies.paired_runs import batch_of

Array = NDArray[np.float64]

SPEED = "impact_speed"
BINS = 24
"""Bins of equal width along the speed, between its 1 % and 99 % quantiles (assumed)."""
MIN_IN_BIN = 10
RESAMPLES = 400
HEAD_LEVELS = (2, 3, 5)
"""AIS levels of the head with a curve."""
MIN_COUNT = 240
"""Minimum runs of a curve (assumed)."""


def describe_speed(
    study: InjuryStudy, cases: pd.DataFrame, shares: Mapping[str, float]
) -> SpeedRisk | None:
    """Return risks along the impact speed with 95 % bands, and the speeds that halve them.

    Cases of all scenarios that change only the speed are pooled: given the speed they are
    exchangeable. Curves are means over bins of the speed, made monotonic by isotonic regression;
    bands come from resampled parts of the design.

    Parameters
    ----------
    study : InjuryStudy
        Checked study file.
    cases : DataFrame
        Runs with risks.
    shares : mapping
        Share of each car front.

    Returns
    -------
    SpeedRisk or None
        None where the study does not vary the speed.
    """
    if SPEED not in study.inputs:
        return None
    alike = [REFERENCE] + [
        name
        for name, scenario in study.scenarios.items()
        if set(scenario.inputs) | set(scenario.fixed) <= {SPEED}
    ]
    held = cases[cases["scenario"].isin(alike)]
    if len(held) < MIN_COUNT:
        return None
    wanted = _wanted(study, held)
    speed = 3.6 * held[SPEED].to_numpy(dtype=float)
    slowest, fastest = (float(v) for v in np.quantile(speed, [0.01, 0.99]))
    edges = np.linspace(slowest, fastest, BINS + 1)
    place = np.clip(np.searchsorted(edges, speed, side="right") - 1, 0, BINS - 1)
    batch = batch_of(study, held)
    weight = held["front"].map(dict(shares)).to_numpy(dtype=float)
    # Sums of weights and of weighted risks by part of the design and bin of the speed.
    cells = (int(batch.max()) + 1, BINS)
    weights, speeds = np.zeros(cells), np.zeros(cells)
    np.add.at(weights, (batch, place), weight)
    np.add.at(speeds, (batch, place), weight * speed)
    filled = np.bincount(place, minlength=BINS) >= MIN_IN_BIN
    weights, speeds = weights[:, filled], speeds[:, filled]
    middle = speeds.sum(axis=0) / weights.sum(axis=0)
    reference = (held["scenario"] == REFERENCE).to_numpy()
    rng = seeds.generator(study.seed, seeds.BOOTSTRAP, 1)
    draws = [rng.integers(0, cells[0], cells[0]) for _ in range(RESAMPLES)]
    curves, halved = {}, {}
    for name, risk in wanted.items():
        sums = np.zeros(cells)
        np.add.at(sums, (batch, place), weight * risk)
        sums = sums[:, filled]
        now = float(np.average(risk[reference], weights=weight[reference]))
        curve = _curve(sums, weights, np.arange(cells[0]))
        resampled = np.stack([_curve(sums, weights, draw) for draw in draws])
        low, high = np.quantile(resampled, [0.025, 0.975], axis=0)
        curves[name] = SpeedCurve(curve.tolist(), low.tolist(), high.tolist())
        speeds_half = np.array([_speed_at(middle, c, 0.5 * now) for c in resampled])
        half = _speed_at(middle, curve, 0.5 * now)
        held_half = speeds_half[np.isfinite(speeds_half)]
        # A zero risk cannot be halved.
        known = now > 0.0 and np.isfinite(half) and held_half.size > 0.9 * RESAMPLES
        halved[name] = HalvingSpeed(
            value=half if now > 0.0 else np.nan,
            low=float(np.quantile(held_half, 0.025)) if known else np.nan,
            high=float(np.quantile(held_half, 0.975)) if known else np.nan,
            now=now,
        )
    median = 3.6 * float(np.median(held.loc[reference, SPEED]))
    return SpeedRisk(middle.tolist(), len(held), curves, halved, median)


def _wanted(study: InjuryStudy, held: pd.DataFrame) -> dict[str, Array]:
    """Return the risks (n,) by name that are averaged along the speed."""
    limit = study.limit
    risks = {
        f"AIS{level}+ head": held[f"risk_head_ais{level}"].to_numpy(dtype=float)
        for level in HEAD_LEVELS
    }
    for item in study.observed:
        name = f"{item.label} (AIS{item.level}+ {words(item.mechanism)})"
        risks[name] = held[f"risk_{item.mechanism}_ais{item.level}"].to_numpy(dtype=float)
    above = held[limit.output].to_numpy(dtype=float) > limit.value
    risks[f"{words(limit.output)} above {limit.value:g}"] = above.astype(float)
    return risks


def _curve(sums: Array, weights: Array, parts: NDArray[np.int64]) -> Array:
    """Return the monotonic curve of the chosen parts of the design."""
    total = weights[parts].sum(axis=0)
    mean = sums[parts].sum(axis=0) / np.maximum(total, 1e-12)
    return np.asarray(optimize.isotonic_regression(mean, weights=np.maximum(total, 1e-12)).x)


def _speed_at(speed: Array, curve: Array, risk: float) -> float:
    """Return the speed at which a rising curve reaches a risk, NaN if it lies beyond its ends."""
    if not curve[0] <= risk <= curve[-1]:
        return float("nan")
    keep = np.concatenate([[True], np.diff(curve) > 0.0])
    return float(np.interp(risk, curve[keep], speed[keep]))
