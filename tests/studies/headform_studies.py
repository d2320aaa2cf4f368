"""Studies of a headform on a straight hood, whose indices are known, and the command line.

Without damping and friction HIC15 is proportional to v^2.5 m^-0.75 k^0.75, the force to
v m^0.5 k^0.5 times a constant, so lognormal inputs make lognormal outputs.
"""

import contextlib
import io
import itertools
import math
import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from html import unescape
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mcstudy.execution.results import ResultsFolder
from mcstudy.injury import association
from models.registry import load_model
from studies import cli, kind, worker
from studies.diagnosis import study as diagnosis
from studies.injury import speed as injury_speed
from studies.kinds import KINDS, parse_study
from studies.publishing import publish
from studies.risk_curve import study as risk_curve
from studies.sensitivity import measure as sensitivity
from studies.sobol import analysis as sobol_analysis
from studies.stiffness_fit import fits
from studies.stiffness_fit import study as stiffness

SPREADS = {"impact_speed": 0.12, "headform_mass": 0.2, "hood_force_scale": 0.3}
EXPONENTS = {
    "hic15": {"impact_speed": 2.5, "headform_mass": -0.75, "hood_force_scale": 0.75},
    "peak_force": {"impact_speed": 1.0, "headform_mass": 0.5, "hood_force_scale": 0.5},
}

INPUTS = """
[inputs.impact_speed]
distribution = "lognormal"
unit = "km/h"
median = 30.0
sigma = 0.12

[inputs.headform_mass]
distribution = "lognormal"
unit = "kg"
median = 2.5
sigma = 0.2

[inputs.hood_force_scale]
distribution = "lognormal"
median = 1.0
sigma = 0.3
"""
HEAD = """\
format = "mcstudy-study/1"
kind = "{kind}"
name = "headform_{kind}"
title = "Headform & <script>hood</script> [bold]"
seed = 11
max_failure_rate = {limit}
"""
HOOD = """
[{table}]
name = "headform"
options = {{ hood_curve = [[0.0, 0.0], [0.1, {force}]], channel_class = 0.0 }}
"""
INJURY = """
[mechanisms.impact]
functions = { nhtsa_lognormal = 1.0, prasad_mertz = 3.0 }
[scenarios.slow]
title = "slow <b> [red] $x$ %"
[scenarios.slow.inputs.impact_speed]
distribution = "lognormal"
unit = "km/h"
median = 24.0
sigma = 0.12
"""
DESIGNS = {
    "monte-carlo": "n = 120\nreplicate_size = 20",
    "sobol": "n = 64",
    "morris": "n = 16",
    "injury": "n = 60\nreplicate_size = 10",
    "model-comparison": "n = 60\nreplicate_size = 10",
    "map": "n = 12\nreplicate_size = 4",
    "multi-fidelity": "cpu_time = 60.0",
    "model-chain": "n = 60\nreplicate_size = 10",
    "posterior": 'method = "sobol"\nn = 128\nreplicate_size = 64',
}
GRID = """
[axes.impact_angle]
unit = "deg"
first = 0.0
last = 10.0
step = 5.0
[axes.friction_body_car]
values = [0.2, 0.25]
"""
EVIDENCE = """
[evidence.hic15]
value = 600.0
sd = 60.0
[evidence.peak_force]
value = 4000.0
unit = "N"
sd = 400.0
[propositions."above 30 km/h"]
of = "impact_speed"
above = 30.0
unit = "km/h"
"""
# A hood of 1 kN/m times a scale: below SOFTEST the contact lasts more than a second and the run
# fails, which one run in twenty does.
SOFTEST = 0.0117
FAILING = """
[inputs.hood_force_scale]
distribution = "lognormal"
median = 8.4
sigma = 4.0
low = 0.002
high = 1000.0

[inputs.impact_speed]
distribution = "uniform"
unit = "km/h"
low = 20.0
high = 40.0
"""


def study_text(
    kind: str,
    design: str = "",
    *,
    inputs: str = INPUTS,
    more: str = "",
    outputs: tuple[str, ...] = ("hic15", "peak_force"),
    limit: float = 0.02,
    force: float = 10000.0,
) -> str:
    """Return a study file of the headform on a straight hood, or of two hoods."""
    text = HEAD.format(kind=kind, limit=limit) + ("age = 7.5\n" if kind == "injury" else "")
    hoods = {"model": force}
    if kind == "model-comparison":
        hoods = {"models.soft": force, "models.stiff": 2.0 * force}
    if kind in ("multi-fidelity", "model-chain"):
        hoods = {"models.soft": force, "models.stiff": 2.0 * force}
    text += "".join(HOOD.format(table=name, force=value) for name, value in hoods.items())
    if kind == "multi-fidelity":
        # The second model is cheap, filters, and has more runs.
        cheap = text.rindex("channel_class = 0.0 }")
        text = text[:cheap].replace("\n[models.soft]", "\n[models.soft]\ncost = 1.0")
        text += "channel_class = 1000.0 }\ncost = 0.05\n"
        text += f'\n[budget]\n{design or DESIGNS[kind]}\noutput = "hic15"\n{inputs}{more}'
    elif kind == "model-chain":
        text += f'changes = ["hood"]\n\n[design]\n{design or DESIGNS[kind]}\n{inputs}{more}'
    else:
        text += f"\n[design]\n{design or DESIGNS[kind]}\n{inputs}{more}"
    if kind == "injury":
        return text + INJURY
    if kind == "posterior":
        text += EVIDENCE
    if kind == "map":
        text += GRID
    extra = {
        "monte-carlo": "histories = 0",
        "model-comparison": "",
        "model-chain": "",
        "posterior": "",
        "map": "limits.hic15 = [250.0, 400.0]",
        "multi-fidelity": "limits.hic15 = [250.0]\n"
        'risks = [{ function = "nhtsa_lognormal", level = 3, age = 8.0 }]',
    }.get(kind, "resamples = 100")
    listed = ", ".join(f'"{name}"' for name in outputs)
    return f"{text}\n[report]\noutputs = [{listed}]\n{extra}\n"


def run_text(text: str, folder: ResultsFolder, *, workers: int = 1) -> dict[str, Any]:
    """Run a study file of any sampled kind and return its analysis as it is in the folder."""
    study = parse_study(text)
    KINDS[study.kind].run(study, text, folder, workers=workers, quiet=True)
    return folder.read_json("analysis.json")


GRAZING = 0.5
"""rad: beyond this angle the formula's head has no blow."""


def closed_form(
    argument: Mapping[str, Any], rows: NDArray[np.float64], started: object = None
) -> tuple[NDArray[np.float64], list[str]]:
    """Return what the headform model returns, by formula and at once, where only rows matter."""
    model = load_model(argument["name"], argument["options"])
    places = [item.name for item in model.inputs]
    v, m, scale, angle = (rows[:, places.index(name)] for name in (*SPREADS, "impact_angle"))
    k = scale * float(argument["options"]["hood_curve"][1][1]) / 10000.0
    # The filter stands for another method.
    light = -0.2 if argument["options"].get("channel_class") else -0.75
    found = {
        "hic15": np.where(angle > GRAZING, np.nan, 6.0 * v**2.5 * m**light * k**0.75),
        "peak_force": 316.0 * v * m**0.5 * k**0.5,
        "clip_3ms": 10.0 * v * k**0.3,
    }
    outputs = np.zeros((len(rows), len(model.outputs)))
    for j, item in enumerate(model.outputs):
        if item.name in found:
            outputs[:, j] = found[item.name]
    failed = scale < SOFTEST
    outputs[failed] = np.nan
    ends = np.where(angle > GRAZING, "no_head_contact", "ok")
    return outputs, np.where(failed, "time_limit", ends).tolist()


def shares(output: str) -> dict[str, float]:
    """Return squared standard deviations of the logarithm of an output, by input."""
    return {name: (EXPONENTS[output][name] * SPREADS[name]) ** 2 for name in SPREADS}


def first_order(parts: Mapping[str, float]) -> dict[str, float]:
    """Return first-order indices of a product of independent lognormals."""
    whole = math.expm1(sum(parts.values()))
    return {name: math.expm1(part) / whole for name, part in parts.items()}


def total_order(parts: Mapping[str, float]) -> dict[str, float]:
    """Return total indices of a product of independent lognormals."""
    both = sum(parts.values())
    return {name: 1.0 - math.expm1(both - part) / math.expm1(both) for name, part in parts.items()}


def second_order(parts: Mapping[str, float]) -> dict[str, float]:
    """Return second-order indices of a product of independent lognormals."""
    whole = math.expm1(sum(parts.values()))
    return {
        f"{a} x {b}": math.expm1(parts[a]) * math.expm1(parts[b]) / whole
        for a, b in itertools.combinations(parts, 2)
    }


def assert_holds(estimate: Mapping[str, float], truth: float, widened: float = 1.5) -> None:
    """Check that an interval, widened about its value, holds the truth."""
    value, low, high = estimate["value"], estimate["low"], estimate["high"]
    assert low < value < high
    assert value - widened * (value - low) <= truth <= value + widened * (high - value)


@dataclass(frozen=True)
class Answer:
    """What the command line said: exit code, standard output and error."""

    code: int
    out: str
    err: str

    @property
    def line(self) -> str:
        """Standard output on one line, without the console's line breaks."""
        return " ".join(self.out.split())


def mcstudy(*arguments: object) -> Answer:
    """Run the command line in this process."""
    out, err = io.StringIO(), io.StringIO()
    with (
        mock.patch.object(sys, "argv", ["mcstudy", *map(str, arguments)]),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            cli.main()
        except SystemExit as ended:
            assert isinstance(ended.code, int)
            return Answer(ended.code, out.getvalue(), err.getvalue())
    raise AssertionError("the command line did not exit")


def told(answer: Answer, code: int = 2) -> str:
    """Return the one line with which a command refuses or fails."""
    assert answer.code == code, answer
    assert answer.out == ""
    assert answer.err.startswith("mcstudy: ") and answer.err.count("\n") == 1, answer.err
    return answer.err


FRAME = (
    r'<iframe title="[^"]*" loading="lazy" sandbox="allow-scripts" allow="fullscreen" '
    r'srcdoc="([^"]*)">'
)


def assert_stands_alone(html: str) -> None:
    """Check that a report needs no network and holds no script and no word of the program's.

    Scripts may run in frames that are closed off, whose pages need no network either.
    """
    for page in re.findall(FRAME, html):
        inner = unescape(page)
        assert not re.search(r"<link|<iframe|@import|url\(|https?://", inner, re.IGNORECASE)
        assert not re.search(r'(?:src|href)\s*=\s*"', inner)
    html = re.sub(FRAME, "", html)
    assert not re.search(r"<script|<link|<iframe|@import|url\(", html, re.IGNORECASE)
    for link in re.findall(r'(?:src|href)="([^"]*)"', html):
        assert link.startswith(("data:image/", "#")), link[:60]
    words = re.sub(r"(?s)<style>.*?</style>|<[^>]+>", " ", html).replace("None of them", "")
    assert not re.search(r"\b(nan|inf|None|null)\b", words)


@contextlib.contextmanager
def by_formula(evaluate: Any = closed_form) -> Iterator[None]:
    """Replace the headform model's runs by a formula, and resample little; one worker only."""
    with (
        mock.patch.object(worker, "evaluate", evaluate),
        mock.patch.object(sobol_analysis, "STEP_RESAMPLES", 8),
        mock.patch.object(association, "RESAMPLES", 4),
        mock.patch.object(injury_speed, "RESAMPLES", 50),
    ):
        yield


class _AnyFigure(dict[str, Figure]):
    """An empty mapping of figures that has every one."""

    def __missing__(self, name: str) -> Figure:
        return Figure(figsize=(0.1, 0.1))


@contextlib.contextmanager
def without_figures() -> Iterator[None]:
    """Leave drawing out of every report: it takes most of a small study's time."""

    def undrawn(folder: ResultsFolder, title: str, subtitle: str, analysis: Any, _: Any,
                sections_of: Any) -> dict[str, Any]:  # fmt: skip
        return publish(folder, title, subtitle, analysis, lambda _: _AnyFigure(), sections_of)

    with contextlib.ExitStack() as stack:
        for module in (kind, sensitivity, risk_curve, diagnosis):
            stack.enter_context(mock.patch.object(module, "publish", undrawn))
        yield


@contextlib.contextmanager
def quick_fits(draws: int = 4) -> Iterator[None]:
    """Fit stiffness with few repetitions and without figures."""
    quick = partial(fits.fit_stiffness, draws=draws)
    with (
        mock.patch.object(fits, "fit_stiffness", quick),
        mock.patch.object(stiffness, "draw", lambda *_: mock.MagicMock()),
    ):
        yield


@contextlib.contextmanager
def recorded_parts() -> Iterator[list[int]]:
    """Record the run ids that arrive in any folder."""
    ids: list[int] = []
    keep = ResultsFolder.add_part

    def add_part(self: ResultsFolder, frame: pd.DataFrame) -> None:
        ids.extend(frame["run"].tolist())
        keep(self, frame)

    with mock.patch.object(ResultsFolder, "add_part", add_part):
        yield ids


def unfinished(source: ResultsFolder, path: Path, runs: pd.DataFrame) -> ResultsFolder:
    """Return a folder as a kill leaves it: some of the runs of another one, in parts."""
    folder = ResultsFolder(path)
    manifest = source.read_json("manifest.json")
    for name in ("digest", "counts"):
        manifest.pop(name, None)
    with folder.open_for_writing():
        folder.write_text("study.toml", (source.path / "study.toml").read_text())
        folder.write_json("manifest.json", manifest | {"finished": False})
        half = len(runs) // 2
        for part in (runs.iloc[half:], runs.iloc[:half]):
            folder.add_part(part)
    return folder


def copy_of(source: ResultsFolder, path: Path, runs: pd.DataFrame | None = None) -> ResultsFolder:
    """Return a finished folder with other runs in it and no report."""
    folder = ResultsFolder(path)
    with folder.open_for_writing():
        for name in ("study.toml", "manifest.json"):
            folder.write_text(name, (source.path / name).read_text())
        folder.compact(source.runs() if runs is None else runs)
    return folder


def global_state() -> list[int]:
    """Return the state of NumPy's global random generator."""
    state = np.random.get_state()  # noqa: NPY002
    assert isinstance(state, tuple)
    numbers: list[int] = state[1].tolist()
    return numbers


def contents(folder: Path) -> dict[str, bytes]:
    """Return every file of a folder by relative path."""
    return {
        str(file.relative_to(folder)): file.read_bytes()
        for file in sorted(folder.rglob("*"))
        if file.is_file()
    }
