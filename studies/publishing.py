"""Writing of a study's analysis, figures and report."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

from mcstudy.execution.results import ANALYSIS, ResultsFolder
from mcstudy.figures import style
from mcstudy.report import Section, render

Analysis = TypeVar("Analysis")


def publish(
    folder: ResultsFolder,
    title: str,
    subtitle: str,
    analysis: Analysis,
    draw: Callable[[Analysis], Mapping[str, Any]],
    sections_of: Callable[[Analysis, Mapping[str, Any]], Sequence[Section]],
) -> Analysis:
    """Write an analysis, its figures and its report, and return the analysis as it is on disk.

    Figures and report are made from the file's content, so that they can be rebuilt from it.

    Parameters
    ----------
    folder : ResultsFolder
        Results folder of the study.
    title : str
        Title of the report.
    subtitle : str
        Subtitle of the report.
    analysis : dataclass
        Every number of the report.
    draw : callable
        Analysis to figures by file name.
    sections_of : callable
        Analysis and figures to sections.
    """
    folder.write_json(ANALYSIS, analysis)
    held = folder.read_analysis(type(analysis))
    figures = draw(held)
    style.save(figures, folder.path / "figures")
    folder.write_text("report.html", render(title, subtitle, sections_of(held, figures)))
    return held
