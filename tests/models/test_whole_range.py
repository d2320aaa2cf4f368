"""The whole declared range of inputs, corners and inside: no exception, no number that is none."""

import numpy as np
import pytest

from models.protocol import Model, complete_status
from models.registry import load_model

ROWS = 20_000


def anywhere(model: Model, n: int, seed: int) -> np.ndarray:
    """Return rows of which a third has every input at an end of its range."""
    rng = np.random.default_rng(seed)
    low = np.array([item.low for item in model.inputs])
    high = np.array([item.high for item in model.inputs])
    share = rng.random((n, low.size))
    share[::3] = np.round(share[::3])
    return np.asarray(low + share * (high - low))


def check(name: str, n: int) -> None:
    model = load_model(name)
    low = np.array([item.low for item in model.outputs])
    high = np.array([item.high for item in model.outputs])
    complete = complete_status(model)
    for seed in range(-(-n // 500)):
        found = model.run_batch(anywhere(model, min(500, n), seed))
        status = np.array(found.status)
        ok = found.outputs[status == "ok"]
        assert np.isfinite(ok).all()
        assert not np.isinf(found.outputs).any()
        assert np.isnan(found.outputs[~np.isin(status, [*complete])]).all()
        beyond = (ok < low) | (ok > high)
        # What is not physical the runner refuses; it must stay rare.
        assert beyond.any(axis=1).sum() <= 5


def test_some_headforms() -> None:
    check("headform", 500)


@pytest.mark.parametrize("name", ["multibody", "planar"])
def test_some_crashes(name: str) -> None:
    check(name, 20)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["headform", "multibody", "planar"])
def test_twenty_thousand_rows(name: str) -> None:
    check(name, ROWS)
