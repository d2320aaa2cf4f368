"""What Sobol' and Morris studies share: designs in blocks that exchange one factor at a time."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from mcstudy.execution.results import ResultsFolder
from mcstudy.studyfile.identity import numbers_digest
from mcstudy.studyfile.schema import FactorStudy
from mcstudy.studyfile.study_inputs import check_independent, map_inputs
from mcstudy.studyfile.study_outputs import report_outputs
from studies.explorer import explorer_pages
from studies.kind import StudyKind
from studies.runs import ModelRuns, RunEnds, RunPlan, complete_blocks, load_study_model
from studies.stored_scenes import keep_scenes


@dataclass(frozen=True)
class FactorAnalysis(RunEnds):
    """First part of the analysis of a design in blocks.

    Attributes
    ----------
    groups : members of the factors that are groups of inputs.
    """

    groups: Mapping[str, Sequence[str]]


Study = TypeVar("Study", bound=FactorStudy)
Analysis = TypeVar("Analysis", bound=FactorAnalysis)


class FactorKind(StudyKind[Study, RunPlan, ModelRuns, Analysis]):
    """A kind of study of one model whose runs come in blocks."""

    def plan(self, study: Study, folder: ResultsFolder) -> RunPlan:
        """Return the model and the values of its inputs over the whole design."""
        model = load_study_model(study)
        report_outputs(study, model)
        check_independent(study)
        uniforms, replicate = self.design(study)
        columns = map_inputs(study, model, uniforms)
        folder.check_same_study(numbers_digest(study, model))
        return RunPlan(model, columns, replicate)

    @abstractmethod
    def design(self, study: Study) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return the design (n, d) in the unit cube and the independent part (n,) of each row."""

    def results(self, study: Study, folder: ResultsFolder) -> ModelRuns:
        """Return the model and the runs of the blocks that are whole."""
        model = load_study_model(study)
        return ModelRuns(model, complete_blocks(folder, model))

    def keep(self, study: Study, results: ModelRuns, folder: ResultsFolder) -> None:
        """Keep notable runs in three dimensions."""
        keep_scenes(study, results.model, results.runs, folder)

    def pages(self, study: Study, results: ModelRuns, folder: ResultsFolder) -> Mapping[str, str]:
        """Return the explorer of the runs."""
        return explorer_pages(study, results.model, results.runs, folder)
