"""Structural types of a model, so that the methods import no physics."""

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class OutputLike(Protocol):
    """An output: name, unit, meaning."""

    @property
    def name(self) -> str: ...
    @property
    def unit(self) -> str: ...
    @property
    def meaning(self) -> str: ...


class InputLike(OutputLike, Protocol):
    """An input: as an output, with nominal value and valid range."""

    @property
    def nominal(self) -> float: ...
    @property
    def low(self) -> float: ...
    @property
    def high(self) -> float: ...


class HistoryLike(Protocol):
    """Time histories: times in s and channels of the same length by name."""

    @property
    def time(self) -> NDArray[np.float64]: ...
    @property
    def channels(self) -> Mapping[str, NDArray[np.float64]]: ...


class Simulator(Protocol):
    """A model as seen by the methods."""

    @property
    def name(self) -> str: ...
    @property
    def version(self) -> str: ...
    @property
    def inputs(self) -> Sequence[InputLike]: ...
    @property
    def outputs(self) -> Sequence[OutputLike]: ...
    @property
    def partial_status(self) -> frozenset[str]: ...
