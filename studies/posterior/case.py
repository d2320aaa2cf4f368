"""A bank with its evidence: the posterior of any of its quantities."""

import functools
from collections.abc import Mapping

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy import units
from mcstudy.errors import StudyError, UserError
from mcstudy.posterior.evidence import Bank, Item
from mcstudy.posterior.inference import Draws, Posterior
from mcstudy.posterior.kernel import LEAST, weighted_quantile
from mcstudy.posterior.ratio import Proposition, Ratio, measure_ratio
from mcstudy.studyfile.schema import SampledStudy
from models.protocol import Model
from studies.posterior.evidence import bank_of, items_of, prior_weights, units_of
from studies.posterior.numbers import Spread
from studies.posterior.schema import EvidenceTables

Array = NDArray[np.float64]

LEVELS = (0.5, 0.9, 0.95)
"""Probabilities of the central intervals."""
FEWER = 32_768
"""Simulated sets of evidence of the posteriors beside the main one."""


class Case:
    """A bank, its evidence, and posteriors of any of its quantities."""

    def __init__(
        self, tables: EvidenceTables, study: SampledStudy, model: Model, runs: pd.DataFrame
    ) -> None:
        self.tables, self.model, self.study = tables, model, study
        self.bank: Bank = bank_of(runs, model)
        if self.bank.size < LEAST:
            raise UserError(
                f"only {self.bank.size} runs are complete, and a posterior takes {LEAST}; run the "
                "study again to go on"
            )
        self.items = items_of(tables, model)
        self.weights = prior_weights(tables, study, self.bank, model)
        self.unit = study.inputs[tables.target].unit
        self.factor = units.factor(units_of(model)[tables.target], self.unit)

    @functools.cached_property
    def plain(self) -> dict[str, Item]:
        """The items without the stated errors of the model."""
        return items_of(self.tables, self.model, discrepancy=0.0)

    def posterior(
        self,
        items: Mapping[str, Item],
        target: str = "",
        weights: Array | None = None,
        sets: int = FEWER,
    ) -> Posterior:
        """Return the posterior of a quantity given items.

        Raises
        ------
        StudyError
            If no run agrees with the items, or some that do have no such quantity.
        """
        try:
            return Posterior(
                self.bank,
                list(items.values()),
                target or self.tables.target,
                weights=self.weights if weights is None else weights,
                seed=self.study.seed,
                sets=sets,
            )
        except ValueError as error:
            raise StudyError(f"evidence: {error}") from None

    def draws_of(self, name: str, items: Mapping[str, Item]) -> Draws:
        """Return draws of a quantity given items and that there is such a quantity."""
        return self.posterior({**items, "": Item(name, happened=True)}, name).given()

    def ratio(self, posterior: Posterior, proposition: Proposition, draws: Draws) -> Ratio:
        """Return a likelihood ratio.

        Raises
        ------
        UserError
            Naming the proposition, if the prior leaves no doubt of it.
        """
        try:
            return measure_ratio(posterior, proposition, draws)
        except ValueError as error:
            raise UserError(f"propositions.{error}") from None

    def spread(self, draws: Draws, factor: float = 0.0) -> Spread:
        """Return the distribution of draws of the target, in its unit."""
        return spread_of(draws.values, draws.weights, draws.effective, factor or self.factor)


def spread_of(values: Array, weights: Array, effective: float, factor: float = 1.0) -> Spread:
    """Return the distribution of weighted values times a factor.

    Parameters
    ----------
    values, weights : (j,) arrays
        Draws, and weights that sum to one.
    effective : float
        Effective number of runs.
    factor : float
    """
    ends = {
        f"{level:g}": weighted_quantile(
            values, weights, np.array([0.5 - 0.5 * level, 0.5 + 0.5 * level])
        )
        for level in LEVELS
    }
    return Spread(
        factor * float(weighted_quantile(values, weights, 0.5)),
        {key: (factor * float(low), factor * float(high)) for key, (low, high) in ends.items()},
        effective,
    )
