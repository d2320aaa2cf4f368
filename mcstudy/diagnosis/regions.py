"""Location of a misfit: channel, part of the pulse, group of tests."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy.diagnosis.fit import Fit
from mcstudy.diagnosis.layout import Layout
from mcstudy.diagnosis.marginal import Marginal
from mcstudy.diagnosis.regimes import regimes_of

Array = NDArray[np.float64]

WINDOWS = 8
"""Number of parts of a pulse."""
GROUPS = ("low", "middle", "high")
"""Thirds of the tests by the leading regime."""
SIZE = 0.05
"""Unit of a shape, relative to the peak."""


@dataclass(frozen=True)
class Region:
    """A part of a channel in a group of tests.

    Attributes
    ----------
    channel : signal or scalar.
    group : of tests, by the regime.
    begin, end : s after the begin of the pulse, averaged over tests; 0 for a scalar.
    low, high : range of the regime in the group.
    z : measured minus simulated, in standard errors.
    size : measured minus simulated, relative to the peak.
    """

    channel: str
    group: str
    begin: float
    end: float
    low: float
    high: float
    z: float
    size: float


@dataclass(frozen=True)
class Where:
    """The regions of a misfit and the regime by which the tests are grouped."""

    regime: str
    regions: tuple[Region, ...]

    @property
    def largest(self) -> Region:
        """The region where measured and simulated differ most."""
        return max(self.regions, key=lambda region: abs(region.z))


def locate_misfit(fitted: Fit, layouts: Sequence[Layout]) -> Where:
    """Return measured minus simulated in each region, nuisances integrated out."""
    regime, groups = _grouped(layouts)
    names: list[tuple[str, int, str]] = []
    columns: list[list[Array]] = [[] for _ in layouts]
    test = layouts[0].test
    for group in dict.fromkeys(groups):
        inside = [g == group for g in groups]
        for signal in test.signals:
            for window in range(WINDOWS):
                names.append((signal.name, window, group))
                for i, layout in enumerate(layouts):
                    shape = layout.part(signal.name, window, WINDOWS)
                    columns[i].append(SIZE * inside[i] * shape)
        for scalar in test.scalars:
            names.append((scalar.name, -1, group))
            for i, layout in enumerate(layouts):
                unit = layout.unit_scalar(scalar.name, fitted.observations[i])
                columns[i].append(SIZE * inside[i] * unit)
    marginal = Marginal(fitted, layouts, [np.stack(part, axis=1) for part in columns])
    reduced = marginal.reduce(marginal.measured(), fitted.scatter)
    information = np.maximum(np.diag(reduced.information), 1e-12)
    length = float(np.mean([b - a for a, b in (layout.window for layout in layouts)]))
    values = _regime_values(layouts, regime)
    regions = []
    for k, (channel, window, group) in enumerate(names):
        own = values[[g == group for g in groups]]
        regions.append(
            Region(
                channel,
                group,
                max(window, 0) * length / WINDOWS,
                (window + 1) * length / WINDOWS,
                float(own.min()),
                float(own.max()),
                float(reduced.score[0, k] / np.sqrt(information[k])),
                float(SIZE * reduced.score[0, k] / information[k]),
            )
        )
    return Where(regime, tuple(regions))


def _regime_values(layouts: Sequence[Layout], regime: str) -> Array:
    if not regime:
        return np.zeros(len(layouts))
    return np.array([layout.test.inputs[regime] for layout in layouts])


def _grouped(layouts: Sequence[Layout]) -> tuple[str, list[str]]:
    """Return the leading regime and the group of each test."""
    regimes = regimes_of(layouts)
    if not regimes:
        return "", ["all"] * len(layouts)
    regime = "impact_speed" if "impact_speed" in regimes else next(iter(regimes))
    rank = np.argsort(np.argsort(regimes[regime], kind="stable"))
    return regime, [GROUPS[int(3 * r / len(layouts))] for r in rank]
