"""Noise from the samples before contact, and channels that are computed from another one."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from mcstudy.diagnosis.channels import computed_channels
from mcstudy.diagnosis.noise import estimate_noise
from mcstudy.diagnosis.problem import Signal, Test

GRAVITY = 9.80665
MASS, SPEED = 2.5, 8.0
TIME = np.arange(-0.004, 0.02, 5e-5)


def test_stated_noise_is_kept_while_the_samples_agree_with_it() -> None:
    rng = np.random.default_rng(0)
    found = estimate_noise([rng.normal(0.0, 1.0, 80) for _ in range(18)], 1.0)
    assert (found.sd, found.correlation, found.measured) == (1.0, 0.0, False)


@pytest.mark.parametrize("true", [0.5, 2.0])
def test_stated_noise_gives_way_to_samples_that_contradict_it(true: float) -> None:
    rng = np.random.default_rng(1)
    found = estimate_noise([rng.normal(3.0, true, 80) for _ in range(18)], 1.0)
    assert found.measured
    assert found.sd == pytest.approx(true, rel=0.1)


def test_correlated_noise_is_seen() -> None:
    rng = np.random.default_rng(2)
    parts = []
    for _ in range(20):
        x = np.zeros(200)
        for k in range(1, 200):
            x[k] = 0.7 * x[k - 1] + rng.normal()
        parts.append(x[50:])
    found = estimate_noise(parts, 0.0)
    assert found.correlation == pytest.approx(0.7, abs=0.06)
    assert found.sd == pytest.approx(1.0 / np.sqrt(1.0 - 0.49), rel=0.1)


def test_unknown_noise_needs_samples() -> None:
    with pytest.raises(ValueError, match="state sd"):
        estimate_noise([np.zeros(3)], 0.0)
    with pytest.raises(ValueError, match="do not vary"):
        estimate_noise([np.zeros(100)], 0.0)


def measured(seed: int, second: str, *, computed: bool) -> Test:
    rng = np.random.default_rng(seed)
    inside = (TIME > 0.0) & (TIME < 0.015)
    truth = np.where(inside, 100.0 * np.sin(np.pi * TIME / 0.015), 0.0)
    shown = truth + rng.normal(0.0, 1.0, TIME.size)
    source = shown if computed else truth
    if second == "hood_force":
        values, sd = MASS * GRAVITY * source, 20.0
    else:
        rate = SPEED - GRAVITY * cumulative_trapezoid(source, TIME, initial=0)
        values, sd = cumulative_trapezoid(rate, TIME, initial=0), 5e-4
    if not computed:
        values = values + rng.normal(0.0, sd, TIME.size)
    return Test(
        f"t{seed}", {"headform_mass": MASS, "impact_speed": SPEED}, {},
        (Signal("head_acceleration", TIME, shown, 1.0), Signal(second, TIME, values, sd)),
        (), (), {"order": float(seed)},
    )  # fmt: skip


def refused(tests: list[Test]) -> set[str]:
    found = computed_channels(tests, mass="headform_mass", speed="impact_speed", gravity=GRAVITY)
    return set(found)


@pytest.mark.parametrize("second", ["hood_force", "hood_penetration"])
def test_a_channel_computed_from_the_acceleration_is_refused(second: str) -> None:
    assert refused([measured(k, second, computed=True) for k in range(3)]) == {second}


@pytest.mark.parametrize("second", ["hood_force", "hood_penetration"])
def test_a_channel_of_its_own_sensor_is_not(second: str) -> None:
    assert refused([measured(k, second, computed=False) for k in range(3)]) == set()


def test_a_computed_force_is_refused_whatever_mass_it_took() -> None:
    tests = []
    for k in range(3):
        test = measured(k, "hood_force", computed=True)
        a, f = test.signals
        tests.append(replace(test, signals=(a, replace(f, values=1.04 * f.values))))
    assert refused(tests) == {"hood_force"}
