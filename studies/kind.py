"""The steps common to all kinds of study: check, lock, run, analyse, publish, summarise.

A kind of study is one folder: its study file (``schema.py``), its plan, analysis, figures and
sections as a subclass of ``StudyKind``, and one line in ``studies.kinds``.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, Generic, TypeVar, get_args

from mcstudy.errors import UserError
from mcstudy.execution.results import ResultsFolder
from mcstudy.execution.workers import Workers
from mcstudy.report import Section, Table
from mcstudy.studyfile.schema import AnyStudy
from studies.publishing import publish
from studies.runs import RunEnds

Study = TypeVar("Study", bound=AnyStudy)
Plan = TypeVar("Plan")
Results = TypeVar("Results")
Analysis = TypeVar("Analysis", bound=RunEnds)


@dataclass(frozen=True)
class Finished(Generic[Study, Results, Analysis]):
    """A study whose runs are analysed: what figures and report are made of.

    Attributes
    ----------
    study : AnyStudy
        Study file of the kind, checked.
    results : Results
        From ``StudyKind.results``.
    analysis : RunEnds
        From ``StudyKind.analyse``, as read from ``analysis.json``.
    """

    study: Study
    results: Results
    analysis: Analysis


class StudyKind(ABC, Generic[Study, Plan, Results, Analysis]):
    """A kind of study whose runs are kept in a results folder.

    Attributes
    ----------
    schema : type
        Class of its study file.
    analysis : type
        Frozen dataclass of every number of its report, an object in ``analysis.json``.
    """

    schema: ClassVar[type[AnyStudy]]
    analysis: ClassVar[type[RunEnds]]

    def run(
        self,
        study: Study,
        text: str,
        folder: ResultsFolder,
        *,
        workers: Workers = -1,
        quiet: bool = False,
    ) -> Analysis:
        """Run or resume a study and write its results folder.

        Parameters
        ----------
        study : AnyStudy
            Study file of this kind, checked.
        text : str
            The study file as written.
        folder : ResultsFolder
            Results folder, new or of the same study.
        workers : int or str
            Processes, -1 for one per core, or the address of a dask scheduler.
        quiet : bool
            No progress line.

        Raises
        ------
        UserError
            If the study does not fit the model or the folder.
        StudyError
            If too many runs failed.
        """
        plan = self.plan(study, folder)
        with folder.open_for_writing():
            folder.write_text("study.toml", text)
            self.execute(study, plan, folder, workers=workers, quiet=quiet)
            results = self.results(study, folder)
            self.keep(study, results, folder)
            return self._publish(study, results, folder)

    def build_report(self, study: Study, folder: ResultsFolder) -> Analysis:
        """Analyse a results folder and write its figures and report, without running the model.

        Parameters
        ----------
        study : AnyStudy
            As read from its folder.
        folder : ResultsFolder
            Results folder of the study.

        Raises
        ------
        UserError
            If the folder holds too few runs yet.
        StudyError
            If too many runs failed.
        """
        return self._publish(study, self.results(study, folder), folder)

    def _publish(self, study: Study, results: Results, folder: ResultsFolder) -> Analysis:
        """Analyse results and write figures and report."""
        analysis = self.analyse(study, results)
        for name, table in self.tables(analysis).items():
            folder.write_text(name, table)
        done = partial(Finished, study, results)
        shown = self.pages(study, results, folder)
        return publish(
            folder,
            study.title,
            self.subtitle(done(analysis)),
            analysis,
            lambda held: self.draw(done(held)),
            lambda held, figures: [
                *self.sections(done(held), figures),
                *([Section("Explore the runs", pages=shown)] if shown else []),
            ],
        )

    @abstractmethod
    def plan(self, study: Study, folder: ResultsFolder) -> Plan:
        """Return the plan: checked models and the values of their inputs.

        Parameters
        ----------
        study : AnyStudy
            Study file of this kind, checked.
        folder : ResultsFolder
            Results folder of the study.

        Raises
        ------
        UserError
            If the study does not fit the model, or the folder is another study's.
        """

    @abstractmethod
    def execute(
        self, study: Study, plan: Plan, folder: ResultsFolder, *, workers: Workers, quiet: bool
    ) -> None:
        """Run the missing runs of a plan.

        Parameters
        ----------
        study : AnyStudy
            Study file of this kind, checked.
        plan : Plan
            From ``plan``.
        folder : ResultsFolder
            Open for writing.
        workers : int or str
            Processes, -1 for one per core, or the address of a dask scheduler.
        quiet : bool
            No progress line.
        """

    def keep(self, study: Study, results: Results, folder: ResultsFolder) -> None:
        """Keep what the report shows of single runs; nothing unless a kind has something.

        Parameters
        ----------
        study : AnyStudy
            Study file of the kind, checked.
        results : Results
            From ``results``.
        folder : ResultsFolder
            Open for writing.
        """

    @abstractmethod
    def results(self, study: Study, folder: ResultsFolder) -> Results:
        """Return the input of the analysis from a folder.

        Parameters
        ----------
        study : AnyStudy
            Study file of this kind, checked.
        folder : ResultsFolder
            Results folder of the study.
        """

    @abstractmethod
    def analyse(self, study: Study, results: Results) -> Analysis:
        """Return every number that the report prints.

        Parameters
        ----------
        study : AnyStudy
            Study file of this kind, checked.
        results : Results
            From ``results``.
        """

    def tables(self, analysis: Analysis) -> Mapping[str, str]:
        """Return tables of comma-separated values by file name; none unless a kind has some.

        Parameters
        ----------
        analysis : Analysis
            From ``analyse``.
        """
        return {}

    @abstractmethod
    def subtitle(self, done: Finished[Study, Results, Analysis]) -> str:
        """Return the line below the report's title."""

    @abstractmethod
    def draw(self, done: Finished[Study, Results, Analysis]) -> Mapping[str, Any]:
        """Return the figures by file name."""

    @abstractmethod
    def sections(
        self, done: Finished[Study, Results, Analysis], figures: Mapping[str, Any]
    ) -> Sequence[Section]:
        """Return the sections of the report, from what ``draw`` returns."""

    def pages(self, study: Study, results: Results, folder: ResultsFolder) -> Mapping[str, str]:
        """Return interactive pages of the report by caption; none unless a kind has some.

        Parameters
        ----------
        study : AnyStudy
            Study file of this kind, checked.
        results : Results
            From ``results``.
        folder : ResultsFolder
            Results folder of the study.
        """
        return {}

    @abstractmethod
    def summarise(self, analysis: Analysis) -> Sequence[str | Table]:
        """Return the command line's summary of an analysis, paragraphs or tables."""

    def independent_rows(self, runs: Any, folder: ResultsFolder) -> Any:
        """Return the rows of a table of runs that are an independent sample of the inputs.

        Parameters
        ----------
        runs : DataFrame
            One row a run.
        folder : ResultsFolder
            Results folder of the study.

        Raises
        ------
        UserError
            If the design is no sample of the inputs.
        """
        raise UserError(
            f"{folder.path}: is the folder of a study of kind {self.name}; sensitivity is "
            "measured in those of Monte Carlo and Sobol' studies"
        )

    @property
    def name(self) -> str:
        """Name of the kind in study files."""
        return str(get_args(self.schema.model_fields["kind"].annotation)[0])
