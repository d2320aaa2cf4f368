"""A diagnosis of every kind of data: ISO-MME tests and full-scale tests of the crash core."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from mcstudy.isomme import write_test
from mcstudy.results import ResultsFolder
from studies.diagnosis.study import diagnose
from studies.validation.diagnosis.hidden_effects import CURVE, Hidden, Laboratory, make_tests

STUDY = f"""format = "mcstudy-study/1"
kind = "monte-carlo"
name = "hood"
title = "Hood"
[model]
name = "headform"
options = {{ hood_curve = {[list(knot) for knot in CURVE]} }}
[design]
method = "latin-hypercube"
n = 200
[inputs.impact_speed]
distribution = "uniform"
unit = "m/s"
low = 7.0
high = 11.0
[inputs.hood_force_scale]
distribution = "lognormal"
median = 1.0
sigma = 0.1
[fixed.hood_unloading_ratio]
value = {Laboratory().ratio}
"""
ACCELERATION = "11HEAD0000H3ACRA"


def isomme_of(source: Path, folder: Path) -> None:
    """Write the tests of a folder in the measured-data format as ISO-MME tests."""
    rows = pd.read_csv(source / "tests.csv")
    for name, speed in zip(rows["test"], rows["impact_speed"], strict=True):
        signal = pd.read_csv(source / "signals" / f"{name}.csv").to_numpy()
        time = signal[:, 0]
        write_test(
            folder / name, name.upper(), {ACCELERATION: (signal[:, 1], "g")},
            start=float(time[0]), interval=float(np.diff(time).mean()),
            velocity=float(speed), mass=Laboratory().mass,
        )  # fmt: skip


def test_isomme_tests_are_diagnosed_with_the_model_of_a_study_file(tmp_path: Path) -> None:
    laboratory = Laboratory(tests=8, speed_sd=0.0)
    hidden = [Hidden("sensor_saturation", "", {"limit": 110.0})]
    make_tests(tmp_path / "data", hidden, 3, laboratory)
    isomme_of(tmp_path / "data", tmp_path / "mme")
    (tmp_path / "hood.toml").write_text(STUDY)
    answer = diagnose(
        tmp_path / "mme", ResultsFolder(tmp_path / "out"),
        model_config=tmp_path / "hood.toml", workers=1,
    )  # fmt: skip
    assert answer["cause"] == "sensor_saturation"
    limit = answer["parameters"]["sensor_saturation"][0]
    assert limit["value"] == pytest.approx(110.0, abs=2.0)
    # The hood's stiffness is what the study file samples and the tests do not state.
    assert "[inputs.hood_force_scale]" in (tmp_path / "out" / "extended.toml").read_text()
