"""The cells of an injury study: every scenario with every car front."""

from collections.abc import Iterator
from dataclasses import dataclass

from mcstudy.studyfile.schema import Report
from studies.injury.schema import AS_IT_STANDS, REFERENCE, Front, InjuryStudy, Scenario
from studies.monte_carlo.schema import MonteCarloStudy


@dataclass(frozen=True)
class Cell:
    """One scenario with one car front: a Monte Carlo study, and the inputs that it fixes."""

    scenario: str
    front: str
    study: MonteCarloStudy
    changes: Scenario

    @property
    def name(self) -> str:
        """Scenario and front, which name the cell's folder."""
        return f"{self.scenario}/{self.front}"


def cells_of(study: InjuryStudy) -> Iterator[Cell]:
    """Yield the cells of a study, the reference scenario first."""
    scenarios = {REFERENCE: Scenario(title=AS_IT_STANDS)} | study.scenarios
    for scenario, changes in scenarios.items():
        for front, entry in fronts_of(study).items():
            model = study.model.model_copy(update={"options": study.model.options | entry.options})
            yield Cell(
                scenario,
                front,
                MonteCarloStudy(
                    format=study.format, kind="monte-carlo", name=study.name, title=study.title,
                    seed=study.seed, model=model, fixed=study.fixed, effects=study.effects,
                    design=study.design,
                    inputs=study.inputs | changes.inputs, dependence=study.dependence,
                    max_failure_rate=study.max_failure_rate, run_time=study.run_time,
                    report=Report(histories=0),
                ),
                changes,
            )  # fmt: skip


def fronts_of(study: InjuryStudy) -> dict[str, Front]:
    """Return the car fronts: those of the study, or the model's own."""
    return study.fronts or {"car": Front()}
