"""The report of a map: figures and tables of its outputs over the points."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mcstudy import units
from mcstudy.figures import style
from mcstudy.figures.response_map import CarFront, MapPanel, Scale, band_names, draw_maps
from mcstudy.report import Section, Table
from mcstudy.text import capital, number, percent, unit
from models.protocol import Model
from models.vehicle.surface.wrap import wrap_line
from studies.failure_report import failure_map, failures_said, status_table
from studies.response_map.analysis import Cell, MapAnalysis, MappedOutput
from studies.response_map.grid import PLACE, surface_of
from studies.response_map.schema import MapStudy

STATIONS = 41
"""Lateral stations of a wrap-around line."""


def draw(study: MapStudy, model: Model, analysis: MapAnalysis) -> dict[str, Any]:
    """Return the study's figures by file name.

    Parameters
    ----------
    study : MapStudy
        Checked study file.
    model : Model
        Model of the runs.
    analysis : MapAnalysis
        Every number of the report.
    """
    figures = failure_map(analysis)
    front = _front(study, model)
    labels = _labels(study)
    if front is not None:
        labels = ("y, left [m]", "x, forward [m]")
    for name, output in analysis.outputs.items():
        values = np.array([cell.median.value for cell in output.cells])
        if not np.isfinite(values).any():
            continue
        label = style.label(name, output.unit)
        figures[f"map_{name}"] = draw_maps(
            [_panels(study, analysis, values)],
            labels,
            Scale(f"{'median of ' if analysis.draws > 1 else ''}{label}", output.limits),
            front,
        )
        above = {
            limit: np.array([100.0 * cell.above[k].value for cell in output.cells])
            for k, limit in enumerate(output.limits)
        }
        # A limit that every draw keeps, or none, needs no picture.
        open_limits = {
            limit: shares
            for limit, shares in above.items()
            if ((shares > 0.0) & (shares < 100.0)).any()
        }
        if analysis.draws > 1 and open_limits:
            label = f"probability of {style.words(name)} above the limit [%]"
            figures[f"exceedance_{name}"] = draw_maps(
                [
                    _panels(study, analysis, shares, f"above {limit:g}")
                    for limit, shares in open_limits.items()
                ],
                labels,
                Scale(label, ends=(0.0, 100.0)),
                front,
            )
    return figures


def _labels(study: MapStudy) -> tuple[str, str]:
    """Return the labels of the axes: the second input over the first."""
    first, second = ((name, axis.unit) for name, axis in study.axes.items())
    return style.label(*first), style.label(*second)


def _front(study: MapStudy, model: Model) -> CarFront | None:
    """Return the car whose surface the map covers."""
    surface = surface_of(study, model)
    if surface is None:
        return None
    axis = study.axes[PLACE[0]]
    low, high = 0.95 * surface.mesh.box[:, 1]
    stations = np.linspace(low, high, STATIONS)
    factor = units.factor(axis.unit, "m")
    lines = {
        f"WAD {value:g} {axis.unit}": wrap_line(surface.mesh, factor * value, stations)
        for value in axis.numbers
    }
    return CarFront(surface.mesh.corners, lines)


def _panels(study: MapStudy, analysis: MapAnalysis, values: Any, more: str = "") -> list[MapPanel]:
    """Return the panels of values (p,) at the points."""
    points = analysis.points
    start = len(study.panels)
    if points[0].region:
        x, y = (np.array([point.position[k] for point in points]) for k in (1, 0))
    else:
        x, y = (np.array([p.coordinates[start + k] for p in points]) for k in (0, 1))
    if not study.panels:
        return [MapPanel(capital(more), x, y, values)]
    ((name, axis),) = study.panels.items()
    first = np.array([point.coordinates[0] for point in points])
    panels = []
    for value in axis.numbers:
        own = first == value
        title = f"{style.words(name)} {value:g} {unit(axis.unit)}".rstrip()
        title = f"{title}, {more}" if more else title
        panels.append(MapPanel(title, x[own], y[own], values[own]))
    return panels


def sections_of(
    study: MapStudy, model: Model, analysis: MapAnalysis, figures: Mapping[str, Any]
) -> list[Section]:
    """Return the sections of the report.

    Parameters
    ----------
    study : MapStudy
        Checked study file.
    model : Model
        Model of the runs.
    analysis : MapAnalysis
        Every number of the report.
    figures : mapping
        Figures by file name.
    """
    sections = []
    for name, output in analysis.outputs.items():
        shown = {}
        if f"map_{name}" in figures:
            shown[f"{capital(style.words(name))} at every point{_over(analysis)}."] = figures[
                f"map_{name}"
            ]
        if f"exceedance_{name}" in figures:
            shown[f"Probability of {style.words(name)} above the limits, over the draws."] = (
                figures[f"exceedance_{name}"]
            )
        tables = [_bands_table(study, name, output)] if output.limits else []
        sections.append(
            Section(
                capital(style.words(name)),
                [_extremes(study, analysis, name, output)],
                [*tables, _panel_table(study, analysis, name, output)],
                shown,
            )
        )
    drawn = ", ".join(style.words(name) for name in study.inputs)
    said = (
        f"At every point {analysis.draws:,} draws of {drawn}, the same ones at all points. "
        "Intervals are 95 %."
        if analysis.draws > 1
        else "One run at every point; all other inputs have one value."
    )
    sections.append(
        Section(
            "Runs",
            [said, *failures_said(analysis)],
            [status_table(analysis)],
            {"Share of failed runs in each tenth of each input.": figures["failures"]}
            if "failures" in figures
            else {},
        )
    )
    sections.append(Section("The model", [f"Model {model.name}, version {model.version}."]))
    return sections


def _over(analysis: MapAnalysis) -> str:
    return f", median of {analysis.draws:,} draws" if analysis.draws > 1 else ""


def _place(study: MapStudy, coordinates: Sequence[float]) -> str:
    """Return the coordinates of a point in words."""
    axes = {**study.panels, **study.axes}
    told = zip(axes.items(), coordinates, strict=True)
    return ", ".join(
        f"{style.words(name)} {value:g} {unit(axis.unit)}".rstrip() for (name, axis), value in told
    )


def _extremes(study: MapStudy, analysis: MapAnalysis, name: str, output: MappedOutput) -> str:
    """Return a sentence on the smallest and the largest value."""
    known = [
        (cell.median.value, point)
        for cell, point in zip(output.cells, analysis.points, strict=True)
        if math.isfinite(cell.median.value)
    ]
    title = capital(style.words(name))
    if not known:
        return f"{title} has no value at any point."
    low = min(known, key=lambda entry: entry[0])
    high = max(known, key=lambda entry: entry[0])
    of_unit = f" {unit(output.unit)}".rstrip()
    return (
        f"{title} lies between {number(low[0])}{of_unit} ({_place(study, low[1].coordinates)}) and "
        f"{number(high[0])}{of_unit} ({_place(study, high[1].coordinates)})"
        f"{_over(analysis)}."
    )


def _bands_table(study: MapStudy, name: str, output: MappedOutput) -> Table:
    """Return the shares of the points in the bands, a row a band, a column a panel."""
    axis = next(iter(study.panels.values()), None)
    panel = next(iter(study.panels), "")
    heads = [
        f"{style.words(panel)} {label} {unit(axis.unit)}".rstrip() if axis else "share"
        for label in output.bands
    ]
    rows = []
    for k, band in enumerate(band_names(output.limits)):
        shares = [bands[k] for bands in output.bands.values()]
        cells = []
        for entry in shares:
            text = percent(entry.share)
            if math.isfinite(entry.lowest) and entry.lowest != entry.highest:
                text += (
                    f"; 90 % of the draws {100 * entry.lowest:.0f} to {100 * entry.highest:.0f} %"
                )
            cells.append(text)
        rows.append([band, *cells])
    title = f"{style.words(name)} [{unit(output.unit) or '–'}]"
    return Table(f"{capital(title)}: share of the points in each band.", ["band", *heads], rows)


def _panel_table(study: MapStudy, analysis: MapAnalysis, name: str, output: MappedOutput) -> Table:
    """Return the quantiles over the points, a row a panel."""
    heads: list[str] = []
    rows: list[list[str]] = []
    labels = _by_panel(study, analysis, output)
    for label, cells in labels.items():
        values = np.array([cell.median.value for cell in cells])
        part = values[np.isfinite(values)]
        ends = np.quantile(part, [0.0, 0.5, 1.0]).tolist() if part.size else [math.nan] * 3
        rows.append([label, f"{len(cells):,}", *(number(v) for v in ends)])
    heads = ["panel", "points", "lowest", "middle", "highest"]
    title = f"{style.words(name)} [{unit(output.unit) or '–'}]"
    return Table(f"{capital(title)} over the points{_over(analysis)}.", heads, rows)


def _by_panel(
    study: MapStudy, analysis: MapAnalysis, output: MappedOutput
) -> dict[str, list[Cell]]:
    """Return the cells of an output by the value of the panel."""
    if not study.panels:
        return {"all": list(output.cells)}
    ((name, axis),) = study.panels.items()
    found: dict[str, list[Cell]] = {}
    for point, cell in zip(analysis.points, output.cells, strict=True):
        label = f"{style.words(name)} {point.coordinates[0]:g} {unit(axis.unit)}".rstrip()
        found.setdefault(label, []).append(cell)
    return found


def summarise(analysis: MapAnalysis) -> list[Table]:
    """Return the values over all points for the command line, a row an output."""
    rows = []
    for name, output in analysis.outputs.items():
        values = np.array([cell.median.value for cell in output.cells])
        part = values[np.isfinite(values)]
        ends = np.quantile(part, [0.0, 0.5, 1.0]).tolist() if part.size else [math.nan] * 3
        rows.append([style.words(name), unit(output.unit) or "–", *(number(v) for v in ends)])
    return [
        Table(
            f"{len(analysis.points):,} points{_over(analysis)}.",
            ["output", "unit", "lowest", "middle", "highest"],
            rows,
        )
    ]
