"""The one style of all figures."""

import io
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
import seaborn as sns
from cycler import cycler
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

# Okabe and Ito's palette, distinguishable with all common colour vision deficiencies.
BLUE, ORANGE, GREEN, RED = "#0072B2", "#E69F00", "#009E73", "#D55E00"
SKY, PURPLE, YELLOW, GREY = "#56B4E9", "#CC79A7", "#F0E442", "#6B6B6B"
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
    # Titles and names come from study files: a dollar sign in them is no formula.
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


@contextmanager
def styled() -> Iterator[None]:
    """Draw in the project's style, leaving the user's own settings alone."""
    settings: Any = {**_RC, "axes.prop_cycle": cycler(color=PALETTE)}
    with sns.axes_style("ticks"), mpl.rc_context(settings):
        yield


def new_figure(width: float, height: float) -> Figure:
    """Return a figure (inches) that belongs to no window."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save(figures: Mapping[str, Figure], folder: Path) -> None:
    """Write each figure as PNG and SVG.

    Parameters
    ----------
    figures : by file name without ending. folder : Path, created.
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
