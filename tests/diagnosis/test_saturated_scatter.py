"""Tests scatter before the accelerometer reads them: a clipped top does not scatter."""

from pathlib import Path

import numpy as np

from mcstudy.diagnosis.base_model import fit_base
from mcstudy.diagnosis.fit import fit
from mcstudy.diagnosis.layout import Scatter
from mcstudy.diagnosis.normal_equations import Scores
from mcstudy.measurement.measured_data import load_measured
from studies.diagnosis.causes import causes_of
from studies.diagnosis.model_choice import choose_model
from studies.diagnosis.problem import build_problem
from studies.diagnosis.simulation import Simulation
from studies.diagnosis.study import simulation_of
from studies.validation.diagnosis.hidden_effects import make_tests
from studies.validation.diagnosis.laboratory import Hidden, Laboratory

LIMIT = 80.0


def test_a_clipped_sample_does_not_respond_and_the_others_do() -> None:
    options = {"channel_class": 0.0, "hood_curve": [[0.0, 0.0], [0.1, 10000.0]]}
    simulation = Simulation("headform", options, {"head_acceleration": 0.0}, ())
    inputs = {"impact_speed": 9.0}
    seen = simulation(inputs, {"sensor_saturation": {"limit": LIMIT, "sharpness": 100.0}})
    assert seen is not None
    values, response = seen.signals["head_acceleration"][1], seen.responses["head_acceleration"]
    clipped = values == LIMIT
    assert 5 < clipped.sum() < values.size
    np.testing.assert_array_equal(response[clipped], 0.0)
    below = values < 0.99 * LIMIT
    np.testing.assert_allclose(response[below], values[below], atol=1e-6)
    free = simulation(inputs, {"sensor_gain": {"factor": 0.9}})
    assert free is not None
    assert not free.responses


def test_pulses_that_scatter_below_a_clip_leave_nothing_but_noise(tmp_path: Path) -> None:
    hidden = Hidden("sensor_saturation", "catalogue", {"limit": LIMIT})
    make_tests(tmp_path / "tests", [hidden], 3, Laboratory(tests=8, scatter=0.04))
    data = load_measured(tmp_path / "tests")
    choice = choose_model(data, None)
    problem = build_problem(data, choice, simulation_of(data, choice))
    layouts, base = fit_base(problem)
    (saturation,) = [c for c in causes_of("headform") if c.name == "sensor_saturation"]
    (clipped,) = [form for form in saturation.forms if form.name == "clipped"]
    fits = []
    for latent in (-2.0, -1.0, 0.0):
        shared = np.concatenate([base.scores.shared, np.full(clipped.size, latent)])
        start = Scores(shared, base.scores.own)
        fits.append(fit(problem, layouts, (clipped,), start, Scatter(0.04, 0.04)))
    found = min(fits, key=lambda entry: entry.misfit)
    residual = np.concatenate(found.residuals)
    assert np.mean(residual**2) < 1.05
