"""What the methods need to know of a model: a structural type, so that they import no physics."""

from collections.abc import Sequence
from typing import Protocol


class InputLike(Protocol):
    """An input: name, unit, meaning, nominal value and valid range."""

    @property
    def name(self) -> str: ...
    @property
    def unit(self) -> str: ...
    @property
    def meaning(self) -> str: ...
    @property
    def nominal(self) -> float: ...
    @property
    def low(self) -> float: ...
    @property
    def high(self) -> float: ...


class OutputLike(Protocol):
    """An output: name, unit, meaning."""

    @property
    def name(self) -> str: ...
    @property
    def unit(self) -> str: ...
    @property
    def meaning(self) -> str: ...


class Simulator(Protocol):
    """A model as the methods see it."""

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
