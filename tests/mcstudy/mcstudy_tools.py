"""What several tests of the methods share: settings, known functions, a terminal, checks."""

import io
import math
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from hypothesis import HealthCheck, settings
from matplotlib.figure import Figure
from numpy.testing import assert_array_equal
from numpy.typing import NDArray

from mcstudy.figures import style

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


def quiet(examples: int) -> settings:
    """Return settings of properties that are the same every time."""
    return settings(
        derandomize=True,
        deadline=None,
        database=None,
        max_examples=examples,
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
    )


def generator(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


@contextmanager
def global_generator_left_alone() -> Iterator[None]:
    """Check that NumPy's global generator is neither read nor set."""
    np.random.seed(2)  # noqa: NPY002
    following = np.random.random(5)  # noqa: NPY002
    np.random.seed(2)  # noqa: NPY002
    yield
    assert_array_equal(np.random.random(5), following)  # noqa: NPY002


def ishigami(u: Array) -> Array:
    """Return sin x1 + 7 sin^2 x2 + 0.1 x3^4 sin x1 with x in [-pi, pi], mean 3.5."""
    x = math.pi * (2.0 * u[..., :3] - 1.0)
    wave = np.sin(x)
    return np.asarray(wave[..., 0] * (1.0 + 0.1 * x[..., 2] ** 4) + 7.0 * wave[..., 1] ** 2)


def ishigami_parts() -> tuple[float, float, float, float]:
    """Return V, V1, V2 and V13 of Ishigami's function; all others are zero.

    T. Ishigami, T. Homma, ISUMA 1990; B. Sudret, Reliability Engineering and System Safety 93,
    2008, section 5.1: V = a^2/8 + b pi^4/5 + b^2 pi^8/18 + 1/2, V1 = (1 + b pi^4/5)^2 / 2,
    V2 = a^2/8, V13 = 8 b^2 pi^8/225.
    """
    a, b, pi4 = 7.0, 0.1, math.pi**4
    v = a**2 / 8.0 + b * pi4 / 5.0 + b**2 * pi4**2 / 18.0 + 0.5
    return v, 0.5 * (1.0 + b * pi4 / 5.0) ** 2, a**2 / 8.0, 8.0 * b**2 * pi4**2 / 225.0


class Terminal(io.StringIO):
    """A text stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def check_drawn(figure: Figure) -> None:
    assert style.png_bytes(figure, dpi=40).startswith(b"\x89PNG")


def legend_of(figure: Figure) -> list[str]:
    """Return the words of a figure's legends."""
    held = [*figure.legends, *(axes.get_legend() for axes in figure.axes)]
    return [text.get_text() for legend in held if legend is not None for text in legend.get_texts()]


def check_units(figure: Figure, *names: str) -> None:
    """Check that every label carries its unit in brackets, and that these are among them."""
    labels = [text for axes in figure.axes for text in (axes.get_xlabel(), axes.get_ylabel())]
    assert all(text.endswith("]") and text.index("[") > 1 for text in labels if text), labels
    for name in names:
        assert any(name in text for text in labels), (name, labels)
