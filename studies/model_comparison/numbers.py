"""Every number of a model comparison."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from mcstudy.agreement import Agreement, Sources, VarianceSplit
from mcstudy.statistics import Estimate
from mcstudy.typed_json import Real
from studies.runs import RunEnds


@dataclass(frozen=True)
class ComparedModel:
    """A model of the comparison: name, version, ignored inputs with the reason, run statuses."""

    name: str
    version: str
    ignored: Mapping[str, str]
    status: Mapping[str, int]


@dataclass(frozen=True)
class PublishedMethods:
    """Mean and standard deviation over the published simulations of an output."""

    unit: str
    methods: int
    mean: Real
    sd: Real


@dataclass(frozen=True)
class Disagreement:
    """First-order share of the variance of the difference by input, and its noise line."""

    shares: Mapping[str, Estimate]
    noise: Real


@dataclass(frozen=True)
class ApartRun:
    """A run with a large difference: its values by both models, and its inputs."""

    run: int
    values: Sequence[Real]
    inputs: Mapping[str, Real]


@dataclass(frozen=True)
class Pair(Agreement):
    """Agreement of two models on an output.

    Attributes
    ----------
    unit : unit of the output.
    breaking : gain in rank correlation by input.
    most_apart : runs with the largest differences beyond the mean difference.
    disagreement : shares of the variance of the difference; None if there are too few runs.
    """

    unit: str
    breaking: Sources
    most_apart: Sequence[ApartRun]
    disagreement: Disagreement | None = None


@dataclass(frozen=True)
class TooFewRuns:
    """An output that too few runs have by every model.

    Attributes
    ----------
    unit : unit of the output.
    rows : runs with a value by every model.
    """

    unit: str
    rows: int


@dataclass(frozen=True)
class ComparedOutput(TooFewRuns):
    """An output by all models.

    Attributes
    ----------
    variance : split of its variance over inputs and methods.
    method_sd : standard deviation of the methods for one set of inputs.
    spread : standard deviation over the runs by model.
    pairs : agreement by pair of labels ``a/b``.
    """

    variance: VarianceSplit
    method_sd: Real
    spread: Mapping[str, Real]
    pairs: Mapping[str, Pair]


@dataclass(frozen=True)
class ComparisonAnalysis(RunEnds):
    """Every number of a model comparison.

    Attributes
    ----------
    models : models by label.
    nominal : outputs of the nominal run by label.
    published : published simulations by output.
    outputs : comparison by output.
    compared : outputs that can be compared.
    """

    models: Mapping[str, ComparedModel]
    nominal: Mapping[str, Mapping[str, Real]]
    published: Mapping[str, PublishedMethods]
    outputs: Mapping[str, Annotated[ComparedOutput | TooFewRuns, Field(union_mode="left_to_right")]]
    compared: Sequence[str]

    @property
    def reported(self) -> dict[str, ComparedOutput]:
        """Outputs that can be compared."""
        found = {name: self.outputs[name] for name in self.compared}
        return {name: entry for name, entry in found.items() if isinstance(entry, ComparedOutput)}

    def pairs(self, one: str, two: str) -> dict[str, Pair]:
        """Return the agreement of two models by output."""
        return {name: entry.pairs[f"{one}/{two}"] for name, entry in self.reported.items()}
