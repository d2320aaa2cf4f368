"""Data with a hidden effect, by a generator that shares no code with the diagnosis.

A set of tests has recorded speeds that are off, sensor noise, a small scatter from test to test,
and at most one or two effects in one of several functional forms. The answer key is kept apart from
the data.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from studies.validation.diagnosis.hidden_hood import strike
from studies.validation.diagnosis.hidden_instrument import clock, filtered, read, recorded_speed
from studies.validation.diagnosis.laboratory import GRAVITY, Hidden, Laboratory

Array = NDArray[np.float64]

LEAD, TAIL = 0.004, 0.006
"""s that are recorded before and after the contact."""


def make_tests(
    folder: Path,
    hidden: Sequence[Hidden],
    seed: int,
    laboratory: Laboratory | None = None,
    *,
    header_of: Laboratory | None = None,
) -> None:
    """Write a folder of measured tests with the effects in it.

    Parameters
    ----------
    folder : path
        New folder.
    hidden : sequence of Hidden
        Effects in the data.
    seed : int
        Seed of speeds, noise and scatter.
    laboratory : Laboratory, optional
        How the tests were made.
    header_of : Laboratory, optional
        What ``measured.toml`` states of it, by default the truth.
    """
    lab = laboratory or Laboratory()
    rng = np.random.default_rng(seed)
    scale = float(np.exp(rng.normal(0.0, lab.scale_sd)))
    speeds = np.sort(rng.uniform(lab.slowest, lab.fastest, lab.tests))
    if lab.repeats:
        speeds[rng.permutation(lab.tests)[: lab.repeats]] = 0.5 * (lab.slowest + lab.fastest)
    if lab.rising:
        speeds.sort()
    else:
        rng.shuffle(speeds)
    rows = []
    (folder / "signals").mkdir(parents=True)
    for k, speed in enumerate(speeds):
        impact = strike(hidden, lab, float(speed), scale, k)
        progress = k / max(lab.tests - 1, 1)
        time = np.arange(round(-LEAD * lab.rate), round((impact.end + TAIL) * lab.rate)) / lab.rate
        # Scatter of the whole pulse: a level and a slow wave of their own in each test.
        level, wave = rng.normal(0.0, lab.scatter, 2)
        phase = rng.uniform(0.0, 6.28)
        share = 1.0 + level + wave * np.sin(np.pi * time / max(time[-1], 1e-9) + phase)
        force = impact.force(time) * share
        slowing = (force + impact.guide(time) * share) / (impact.mass * GRAVITY)
        felt = read(hidden, slowing, time, progress)
        shown = filtered(felt, lab.rate, hidden) + rng.normal(0.0, lab.noise_sd, time.size)
        columns = {"time": clock(hidden, time), "head_acceleration": shown}
        if lab.force:
            columns["hood_force"] = filtered(force, lab.rate) + rng.normal(
                0.0, lab.force_sd, time.size
            )
        name = f"t{k + 1:02d}"
        pd.DataFrame(columns).to_csv(folder / "signals" / f"{name}.csv", index=False)
        row = {"test": name, "impact_speed": recorded_speed(hidden, float(speed), progress)
               + rng.normal(0.0, lab.speed_sd)}  # fmt: skip
        if lab.rebound:
            row["rebound_speed"] = impact.rebound + rng.normal(0.0, lab.rebound_sd)
        rows.append(row)
    pd.DataFrame(rows).to_csv(folder / "tests.csv", index=False)
    (folder / "measured.toml").write_text(_header(header_of or lab), encoding="utf-8")


def _header(lab: Laboratory) -> str:
    knots = ", ".join(f"[{x}, {f}]" for x, f in lab.curve)
    text = f"""format = "mcstudy-measured/1"
title = "Hood, headform"
model = "headform"

[fixed]
headform_mass = {lab.mass}
hood_unloading_ratio = {lab.ratio}
hood_curve = [{knots}]

[uncertain.hood_force_scale]
distribution = "lognormal"
median = 1.0
sigma = {lab.scale_sd}

[inputs.impact_speed]
unit = "m/s"
sd = {lab.speed_sd}

[signals.head_acceleration]
unit = "g"
sd = {lab.noise_sd}
filter = "CFC1000"
"""
    if lab.force:
        text += f'\n[signals.hood_force]\nunit = "N"\nsd = {lab.force_sd}\nfilter = "CFC1000"\n'
    if lab.rebound:
        text += f'\n[scalars.rebound_speed]\nunit = "m/s"\nsd = {lab.rebound_sd}\n'
    return text
