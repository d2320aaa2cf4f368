"""Writing of a study's analysis, figures and report."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from mcstudy.execution.results import ResultsFolder
from mcstudy.figures import style
from mcstudy.report import Section, render


def publish(
    folder: ResultsFolder,
    title: str,
    subtitle: str,
    analysis: Mapping[str, Any],
    draw: Callable[[dict[str, Any]], Mapping[str, Any]],
    sections_of: Callable[[dict[str, Any], Mapping[str, Any]], Sequence[Section]],
) -> dict[str, Any]:
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
    analysis : mapping
        Every number of the report.
    draw : callable
        Analysis to figures by file name.
    sections_of : callable
        Analysis and figures to sections.
    """
    folder.write_json("analysis.json", analysis)
    held = folder.read_json("analysis.json")
    figures = draw(held)
    style.save(figures, folder.path / "figures")
    folder.write_text("report.html", render(title, subtitle, sections_of(held, figures)))
    return held
