"""The common style of all figures."""

import functools
import io
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import seaborn as sns
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, get_font
from matplotlib.patches import Rectangle
from numpy.typing import ArrayLike, NDArray

from mcstudy.statistics import varies

# Okabe and Ito's palette, distinguishable with all common colour vision deficiencies.
BLUE, ORANGE, GREEN, RED = "#0072B2", "#E69F00", "#009E73", "#D55E00"
SKY, PURPLE, YELLOW, GREY = "#56B4E9", "#CC79A7", "#F0E442", "#6B6B6B"
SEQUENTIAL = "rocket_r"
"""Sequential palette, light to dark: it reads in grey and with every colour vision."""
PALETTE = (BLUE, ORANGE, GREEN, RED, SKY, PURPLE, "#000000", "#8C6D31")

_RC: dict[str, Any] = {
    "font.size": 10,
    "axes.titlesize": 11,
    "axes.labelsize": 10,
    "legend.fontsize": 9,
    "axes.grid": True,
    "grid.color": "#E3E3E3",
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.fonttype": "path",
    "svg.hashsalt": "mcstudy",
    "figure.dpi": 110,
    # Titles and names come from study files: a dollar sign in them starts no formula.
    "text.parse_math": False,
}

LABELS = {
    "hic15": "HIC15",
    "hic36": "HIC36",
    "throw_distance": "throw distance",
    "wad": "wrap-around distance (WAD)",
    "clip_3ms": "3 ms head acceleration",
    "clip_3ms_consecutive": "3 ms clip (consecutive)",
    "bric": "BrIC",
    "ground_hic15": "HIC15 on the road",
    "friction_body_road": "friction body–road",
    "friction_body_car": "friction body–car",
    "friction_tyre_road": "friction tyre–road",
}
LINE, TICK, LINES = 44, 28, 3
"""Characters a line of a label and of a tick label, and largest number of lines."""
MAX_SCORE = 1e4
"""Largest size of a reference, over that of the values, to be drawn with them (assumed)."""
_NO_WIDTH = "\N{ZERO WIDTH SPACE}"
_UNIT_TEXT = {"1": "", "m/s2": "m/s²", "rad/s2": "rad/s²"}


def label(name: str, unit: str = "1") -> str:
    """Return an axis label: the quantity in words and its unit in square brackets."""
    return f"{words(name)} {bracketed(unit)}"


def bracketed(unit: str) -> str:
    """Return a unit in square brackets."""
    return f"[{_UNIT_TEXT.get(unit, unit) or '–'}]"


def words(name: str) -> str:
    """Return a quantity's name in words."""
    if name.startswith("log_") and name not in LABELS:
        return f"log of {words(name.removeprefix('log_'))}"
    return LABELS.get(name, name.replace("_", " "))


def safe(text: str, line: int = LINE) -> str:
    """Return a user's text in drawable form, for a label, title or tick.

    It is wrapped and, where it is very long, cut; characters that no font has become U+FFFD, and an
    empty text becomes a dash.

    Parameters
    ----------
    text : str
    line : int
        Characters a line.
    """
    drawn = _drawable()
    plain = "".join(
        c if c.isprintable() and ord(c) in drawn else "\N{REPLACEMENT CHARACTER}"
        for c in " ".join(text.split())
    )
    lines = textwrap.wrap(plain, line, break_on_hyphens=False) or ["–"]
    if len(lines) > LINES:
        lines = [*lines[: LINES - 1], lines[LINES - 1][: line - 1] + "…"]
    shown = "\n".join(lines)
    # Matplotlib leaves labels that begin with an underscore out of legends.
    return _NO_WIDTH + shown if shown.startswith("_") else shown


def quantity(name: str) -> str:
    """Return the name of an input, output or group in words, drawable as a tick label."""
    return safe(words(name), TICK)


@functools.cache
def _drawable() -> frozenset[int]:
    """Return the characters that the fonts of the figures have."""
    found: set[int] = set()
    with styled():
        for family in mpl.rcParams["font.sans-serif"]:
            with suppress(ValueError):
                found |= set(get_font(findfont(family, fallback_to_default=False)).get_charmap())
    return frozenset(found)


def ends_of(
    values: ArrayLike, points: Sequence[float] = (), *, below: float = 0.05, above: float = 0.05
) -> tuple[float, float]:
    """Return the limits of an axis for values, also where they do not vary.

    Parameters
    ----------
    values : array
        Finite.
    points : sequence of float
        Reference values to include where they are near (``is_near``) the values.
    below, above : float
        Margins, in shares of the axis.
    """
    held: NDArray[np.float64] = np.asarray(values, dtype=float).ravel()
    held = np.concatenate([held, [point for point in points if is_near(held, point)]])
    low, high = float(held.min()), float(held.max())
    if not varies(held):
        half = 0.05 * max(abs(low), abs(high)) or 1.0
        low, high = low - half, high + half
    return low - below * (high - low), high + above * (high - low)


def is_near(values: ArrayLike, point: float) -> bool:
    """Return whether a point can share an axis with values without hiding them."""
    return abs(point) <= MAX_SCORE * (float(np.abs(np.asarray(values)).max()) or 1.0)


def covered(axes: Axes, height: float) -> float:
    """Return the share of axes, ``height`` inches high, that their small legend covers."""
    labels: list[str] = axes.get_legend_handles_labels()[1]
    lines = sum(1 + label.count("\n") for label in labels)
    return min(0.17 * lines / height, 0.7)


def mark_missing(axes: Axes, missing: NDArray[np.bool_]) -> None:
    """Hatch the cells of a heat map without a value and print a dash in them."""
    for row, column in zip(*np.nonzero(missing), strict=True):
        axes.add_patch(
            Rectangle((column, row), 1.0, 1.0, facecolor="#F4F4F4", edgecolor="#C4C4C4",
                      hatch="///", linewidth=0.0)
        )  # fmt: skip
        axes.text(column + 0.5, row + 0.5, "–", ha="center", va="center", fontsize=8)


@contextmanager
def styled() -> Iterator[None]:
    """Apply the project's style within the context; the user's settings are restored."""
    settings: Any = {**_RC, "axes.prop_cycle": cycler(color=PALETTE)}
    with sns.axes_style("ticks"), mpl.rc_context(settings):
        yield


def new_figure(width: float, height: float) -> Figure:
    """Return a figure (inches) without a window."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save(figures: Mapping[str, Figure], folder: Path) -> None:
    """Write each figure as PNG and SVG.

    Parameters
    ----------
    figures : mapping
        Figures by file name without extension.
    folder : Path
        Created if missing.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with styled():
        for name, figure in figures.items():
            figure.savefig(folder / f"{name}.png", dpi=150)
            figure.savefig(folder / f"{name}.svg", metadata={"Date": None})


def png_bytes(figure: Figure, dpi: int = 110) -> bytes:
    """Return a figure as PNG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi)
    return buffer.getvalue()
