"""Fuzzed files through every reader: right ones are read, wrong ones cost one line and exit code 2.

Nothing but that line is written, no warning of a library reaches the terminal, and whatever the
product writes it reads back. ``reader_grammars`` holds the grammars. The fast tests draw the same
few files every time; the slow tier draws thousands.
"""

import contextlib
import io
import json
import re
import shutil
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pandas as pd
import pytest
import reader_grammars as grammars
from headform_studies import quick_fits, without_figures
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mcstudy.errors import UserError
from mcstudy.execution import runner
from mcstudy.execution.results import ResultsFolder, digest
from mcstudy.files import read_study_text
from mcstudy.injury import association
from mcstudy.injury.survival import RiskFit
from mcstudy.measurement.isomme import read_test, write_test
from mcstudy.measurement.measured_data import load_measured
from models.contact.corridor import build_corridor, corridor_text, load_corridors
from models.contact.law import ForceCurve
from models.registry import load_model
from studies import cli
from studies.diagnosis import study as diagnosis
from studies.isomme_export import write_isomme
from studies.kinds import load_study

CONFIGS = Path(__file__).parents[2] / "configs"
LONGEST_LINE = 2100


class Reached(BaseException):
    """A study came through every check, to where its runs begin."""


@dataclass(frozen=True)
class Answer:
    """What a command said: exit code (None: it came to its runs), output, error, warnings."""

    code: int | None
    out: str
    err: str
    warned: list[str] = field(default_factory=list)


def call(*arguments: str | Path) -> Answer:
    """Run the command line in this process; whatever it raises beside an exit comes through."""
    out, err = io.StringIO(), io.StringIO()
    code: int | None = None
    with (
        mock.patch.object(sys, "argv", ["mcstudy", *map(str, arguments)]),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        warnings.catch_warnings(record=True) as warned,
    ):
        warnings.simplefilter("always")
        try:
            cli.main()
        except SystemExit as end:
            assert isinstance(end.code, int)
            code = end.code
        except Reached:
            pass
    told = [f"{w.category.__name__}: {w.message} ({w.filename}:{w.lineno})" for w in warned
            if not issubclass(w.category, DeprecationWarning | ResourceWarning)]  # fmt: skip
    return Answer(code, out.getvalue(), err.getvalue(), told)


def assert_told(answer: Answer, out: Path, *, codes: tuple[int, ...] = (1, 2)) -> None:
    """Check that a command succeeded in silence, or said in one line why not and wrote nothing."""
    assert not answer.warned, answer.warned
    if answer.code in (0, None):
        assert answer.err == ""
        return
    assert answer.code in codes, answer
    assert_one_line(answer.err.removesuffix("\n"), start="mcstudy: ")
    assert answer.out == ""
    if answer.code == 2:
        assert not out.exists(), f"{out} was written, and: {answer.err}"


def assert_one_line(message: str, *, start: str = "") -> None:
    assert message.startswith(start)
    assert message.isprintable(), repr(message)
    assert len(message) <= LONGEST_LINE
    assert "Traceback" not in message


@contextlib.contextmanager
def checks_alone() -> Iterator[None]:
    """End every study where its runs begin, every diagnosis where its search begins."""
    with (
        mock.patch.object(runner, "run", side_effect=Reached),
        mock.patch.object(diagnosis, "search", side_effect=Reached),
        mock.patch.object(diagnosis, "fit_surfaces", side_effect=Reached),
    ):
        yield


@contextlib.contextmanager
def undrawn() -> Iterator[None]:
    """Leave figures out, and most repetitions."""
    with without_figures(), quick_fits(), mock.patch.object(association, "RESAMPLES", 8):
        yield


def write(folder: Path, files: Mapping[str, bytes]) -> Path:
    """Write files by relative path."""
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return folder


def check_study(raw: bytes, folder: Path) -> None:
    """A study file comes to its runs, or is refused in one line."""
    path, out = folder / "study.toml", folder / "out"
    path.write_bytes(raw)
    verb = "reconstruct" if b"reconstruction" in raw else "run"
    with checks_alone(), undrawn():
        assert_told(call(verb, path, "--out", out, "--quiet"), out)


def check_whole_study(raw: bytes, folder: Path) -> None:
    """A study of the headform runs to its report, which is rebuilt equal, or is refused."""
    path, out = folder / "study.toml", folder / "out"
    path.write_bytes(raw)
    kind = "reconstruct" if b"reconstruction" in raw else "run"
    options = [] if kind == "reconstruct" else ["--workers", "1"]
    with undrawn():
        answer = call(kind, path, "--out", out, "--json", *options)
        assert_told(answer, out)
        if answer.code:
            return
        json.loads(answer.out)
        if kind == "run":
            assert read_study_text(out / "study.toml") == read_study_text(path)
            held = (out / "analysis.json").read_bytes()
            folder_read = ResultsFolder(out)
            manifest = folder_read.read_json("manifest.json")
            if "digest" in manifest:
                assert digest(folder_read.runs()) == manifest["digest"]
            again = call("report", out)
            assert (again.code, again.err, again.warned) == (0, "", [])
            assert (out / "analysis.json").read_bytes() == held


def check_cases(raw: bytes, folder: Path, ending: str = "csv") -> None:
    """A table of cases gives a curve or is refused in one line."""
    path, out = folder / f"cases.{ending}", folder / "out"
    path.write_bytes(raw)
    with undrawn():
        assert_told(call("risk-curve", path, "--stimulus", "hic", "--out", out), out, codes=(2,))


def check_tests(files: Mapping[str, bytes], folder: Path) -> None:
    """A folder of tests is read, fitted and made a problem of a diagnosis, or is refused."""
    source, out = write(folder / "data", files), folder / "out"
    source.mkdir(exist_ok=True)
    before = {path: path.read_bytes() for path in source.rglob("*") if path.is_file()}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            data = load_measured(source)
    except UserError as error:
        assert_one_line(str(error))
    else:
        assert len(data.tests)
        for channels in data.signals.values():
            for table in channels.values():
                assert np.isfinite(table).all()
    with checks_alone(), undrawn():
        answer = call("fit-stiffness", source, "--out", out)
        assert_told(answer, out, codes=(2,))
        shutil.rmtree(out, ignore_errors=True)
        answer = call("diagnose", source, "--out", out, "--workers", "1", "--quiet")
        assert_told(answer, out, codes=(2,))
    assert {path: path.read_bytes() for path in source.rglob("*") if path.is_file()} == before


Check = Callable[[Any, Path], None]
PAPER = grammars.paper_studies(CONFIGS)
READERS: dict[str, tuple[st.SearchStrategy[Any], Check, int, int]] = {
    "study": (grammars.study_files(grammars.STUDIES), check_study, 25, 1800),
    "paper study": (grammars.study_files(PAPER), check_study, 10, 1500),
    "whole study": (grammars.whole_studies(), check_whole_study, 1, 150),
    "csv": (grammars.csv_files(), check_cases, 25, 1200),
    "parquet": (grammars.parquet_files(), partial(check_cases, ending="parquet"), 25, 1400),
    "iso-mme": (grammars.mme_tests(), check_tests, 15, 900),
    "measured": (grammars.measured_folders(), check_tests, 15, 900),
}
"""By reader: its grammar, what is checked, files drawn by the fast and by the slow test."""
FAST = settings(
    derandomize=True, deadline=None, database=None,
    suppress_health_check=list(HealthCheck),
)  # fmt: skip
SLOW = settings(FAST, derandomize=False, print_blob=True)


def fuzz(reader: str, tmp_path_factory: pytest.TempPathFactory, options: settings) -> None:
    grammar, check, _, _ = READERS[reader]

    @options
    @given(grammar)
    def drawn(value: Any) -> None:
        folder = tmp_path_factory.mktemp("drawn")
        check(value, folder)
        shutil.rmtree(folder)

    drawn()


@pytest.mark.parametrize("reader", READERS)
def test_any_file_is_read_or_refused_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, reader: str
) -> None:
    fuzz(reader, tmp_path_factory, settings(FAST, max_examples=READERS[reader][2]))


@pytest.mark.slow
@pytest.mark.parametrize("reader", READERS)
def test_thousands_of_files_are_read_or_refused_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, reader: str
) -> None:
    fuzz(reader, tmp_path_factory, settings(SLOW, max_examples=READERS[reader][3]))


ROUND = settings(FAST, max_examples=25)
AXES = tuple(f"D0HEADCG00PCAC{axis}A" for axis in "XYZ")


@ROUND
@given(
    seed=st.integers(0, 999),
    size=st.sampled_from([8, 9, 100]),
    start=st.floats(-1.0, 1.0),
    interval=st.floats(1e-6, 0.1),
    speed=st.floats(0.1, 100.0),
    mass=st.floats(0.1, 100.0),
    title=st.sampled_from(grammars.WORDS) | st.text(max_size=30),
)
def test_a_written_test_is_read_back(
    tmp_path_factory: pytest.TempPathFactory, seed: int, size: int, start: float, interval: float,
    speed: float, mass: float, title: str,
) -> None:  # fmt: skip
    folder = tmp_path_factory.mktemp("written")
    rng = np.random.default_rng(seed)
    parts = 10.0 ** rng.uniform(-3, 4) * rng.standard_normal((3, size))
    channels = dict(zip(AXES, [(part, "g") for part in parts], strict=True))
    written = channels | {"D0HEADCG00PCAVXA": (parts[0], "rad/s")}
    mme = write_test(folder / "T", "T", written, start=start, interval=interval, title=title,
                     velocity=speed, mass=mass)  # fmt: skip
    test = read_test(mme)
    assert test.title == " ".join(title.split()).replace("NOVALUE", "")
    assert [channel.code for channel in test.channels] == [*AXES, "D0HEADCG00PCAVXA"]
    for channel, part in zip(test.channels, [*parts, parts[0]], strict=True):
        np.testing.assert_allclose(channel.values, part, rtol=5.1e-7)
    data = load_measured(folder)
    assert data.input_value("impact_speed", 0, "m/s") == (pytest.approx(speed, rel=1e-8), 0.0)
    assert data.input_value("headform_mass", 0, "kg") == (pytest.approx(mass, rel=1e-8), 0.0)
    time, values = data.signal("T", "head_acceleration", "g")
    np.testing.assert_allclose(time, start + interval * np.arange(size), rtol=1e-8, atol=2e-9)
    np.testing.assert_allclose(values, np.sqrt((parts**2).sum(axis=0)), rtol=2e-6)
    shutil.rmtree(folder)


@settings(FAST, max_examples=10)
@given(
    seed=st.integers(0, 999),
    method=st.sampled_from(["quantiles", "components"]),
    zone=st.sampled_from(grammars.WORDS) | st.text(max_size=20),
    title=st.sampled_from(grammars.WORDS) | st.text(max_size=20),
)
def test_a_written_corridor_is_read_back(
    tmp_path_factory: pytest.TempPathFactory, seed: int, method: str, zone: str, title: str
) -> None:
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.uniform(1, 6)
    curves = []
    for _ in range(int(rng.integers(3, 7))):
        steps = rng.uniform(0.005, 0.03, 3), size * rng.uniform(0.2, 1.0, 3)
        depth, force = (np.concatenate([[0.0], np.cumsum(step)]) for step in steps)
        curves.append(ForceCurve(depth, force, rng.uniform(1.5, 10.0)))
    corridor = build_corridor(curves, method)
    folder = tmp_path_factory.mktemp("corridor")
    # As ``fit-stiffness`` writes it.
    ResultsFolder(folder).write_text("corridor.toml", corridor_text(corridor, zone, title, title))
    found = load_corridors(str(folder / "corridor.toml"))
    assert list(found) == [zone]
    for name in ("lower", "median", "upper"):
        mine, other = getattr(corridor, name), getattr(found[zone], name)
        np.testing.assert_allclose(other.penetration, mine.penetration, rtol=5.1e-6)
        np.testing.assert_allclose(other.force, mine.force, rtol=5.1e-6)
        assert other.unloading_ratio == pytest.approx(mine.unloading_ratio, rel=5.1e-6)
    shutil.rmtree(folder)


@ROUND
@given(
    numbers=st.lists(st.floats(), min_size=1, max_size=8),
    words=st.lists(st.sampled_from(grammars.WORDS), min_size=8, max_size=8),
)
def test_written_runs_are_read_back(
    tmp_path_factory: pytest.TempPathFactory, numbers: list[float], words: list[str]
) -> None:
    runs = pd.DataFrame({
        "run": np.arange(len(numbers)), "replicate": 0, "hic15": numbers,
        "status": words[: len(numbers)], "reason": words[::-1][: len(numbers)],
    })  # fmt: skip
    folder = ResultsFolder(tmp_path_factory.mktemp("runs"))
    with folder.open_for_writing():
        for part in (runs.iloc[len(runs) // 2 :], runs.iloc[: len(runs) // 2]):
            if len(part):
                folder.add_part(part)
        folder.compact(held := folder.runs())
    assert digest(folder.runs(["hic15"])) == digest(held) == digest(runs)
    pd.testing.assert_frame_equal(folder.runs(), runs, check_exact=True)
    shutil.rmtree(folder.path)


def test_a_reconstruction_exported_as_iso_mme_is_read_back(tmp_path: Path) -> None:
    model = load_model("headform", grammars.HEADFORM["options"])
    run = model.run({"impact_speed": 12.5, "headform_mass": 2.75})
    write_isomme(run, model, tmp_path, name="drop", title="[1]: a * drop")
    data = load_measured(tmp_path)
    assert (data.header.title, list(data.tests["test"])) == ("[1]: a * drop", ["drop"])
    assert data.input_value("impact_speed", 0, "m/s") == (pytest.approx(12.5), 0.0)
    assert data.input_value("headform_mass", 0, "kg") == (pytest.approx(2.75), 0.0)
    time, values = data.signal("drop", "head_acceleration", "g")
    head = run.histories["head"]
    np.testing.assert_allclose(time, head.time, atol=1e-9)
    np.testing.assert_allclose(values, head.channels["acceleration"], rtol=5.1e-7, atol=1e-30)


@pytest.mark.parametrize("kind", ["monte-carlo", "reconstruction"])
@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-8"])
def test_study_files_with_a_byte_order_mark_are_run(
    tmp_path: Path, kind: str, encoding: str
) -> None:
    text = "\ufeff" + grammars.toml_text(grammars.STUDIES[kind])
    path, out = tmp_path / "study.toml", tmp_path / "out"
    path.write_bytes(text.encode(encoding))
    verb, code = ("reconstruct", 0) if kind == "reconstruction" else ("run", None)
    with checks_alone(), undrawn():
        answer = call(verb, path, "--out", out, "--quiet")
    assert (answer.code, answer.err) == (code, "")
    if kind == "reconstruction":
        assert load_study(out / "study.toml") == load_study(path)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"distribution": "lognormal", "median": 8.0, "sigma": 5000.0}, "draws"),
        ({"distribution": "lognormal", "median": 8.0, "sigma": 5e-324, "high": 20.0}, ""),
        ({"distribution": "lognormal", "median": 8.0, "sigma": 12.0, "low": 5e-324}, "draws"),
        ({"distribution": "normal", "mean": 0.0, "sd": 1e308}, "draws"),
        ({"distribution": "uniform", "low": -1e308, "high": 1e308}, "draws inf"),
        ({"distribution": "triangular", "low": -1e308, "mode": 7.0, "high": 1e308}, "draws"),
        ({"distribution": "growth-chart", "age": "headform_mass", "at": [0.0, 30.0],
          "L": [3.6, 15.6], "M": [1e308, 9.9], "S": [26.5, 18.3], "high": 1e150}, "draws"),
    ],
)  # fmt: skip
def test_distributions_beyond_what_numbers_hold_are_refused_without_a_warning(
    tmp_path: Path, table: dict[str, Any], message: str
) -> None:
    study = grammars.STUDIES["monte-carlo"]
    study = study | {"inputs": grammars.INPUTS | {"impact_speed": table | {"unit": "m/s"}}}
    path, out = tmp_path / "study.toml", tmp_path / "out"
    path.write_text(grammars.toml_text(study), encoding="utf-8")
    with checks_alone():
        answer = call("run", path, "--out", out, "--quiet")
    assert_told(answer, out)
    if message:
        assert (answer.code, message in answer.err) == (2, True)
        assert "inputs.impact_speed" in answer.err


LOW = 560.0 * (1.0 + 1e-12 * np.array([0.0, 1.0, -1.0, 2.0, 0.5, -0.5, 1.5, 0.0]))
HIGH = np.array([1040.0, 0.0, 0.0, np.inf, 1040.0, 0.0, np.inf, 1040.0])
ALIKE = 800.0 * (1.0 + 1e-12 * np.array([2.0, -2.5, 0.4, -0.6, -0.5, -0.2, -2.0, -0.3]))
TABLES: dict[str, tuple[dict[str, Any], str]] = {
    # All within rounding of 560: the search for the slope ended where its steps were used up.
    "a jump": ({"hic_low": LOW, "hic_high": np.where(HIGH == 0.0, LOW, HIGH)},
               "risk jumps at one stimulus"),
    # The covariance of intercept and slope lost all its digits, and the interval was no number.
    "rounding alone": ({"hic": ALIKE, "injured": [1, 0, 0, 1, 1, 1, 1, 1]}, "no curve is given"),
    "weights": ({"hic": [400.0, 900.0, 700.0, 1200.0, 600.0], "injured": [0, 1, 0, 1, 1],
                 "weight": [1.0, 1e-40, 2.5, 1e60, 1.0]}, "the weights go from 1e-40 to 1e+60"),
}  # fmt: skip


@pytest.mark.parametrize("name", TABLES)
def test_cases_that_allow_no_curve_are_refused(tmp_path: Path, name: str) -> None:
    columns, message = TABLES[name]
    pd.DataFrame(columns).to_csv(tmp_path / "cases.csv", index=False)
    with undrawn():
        command = ("risk-curve", tmp_path / "cases.csv", "--stimulus", "hic")
        answer = call(*command, "--out", tmp_path / "out")
    assert_told(answer, tmp_path / "out", codes=(2,))
    assert (answer.code, message in answer.err) == (2, True)


def test_the_quality_index_of_a_stimulus_too_small_for_a_number() -> None:
    # Half a standard error of ln x: the interval is 2 sinh(1.96 / 2) wide, whatever x is.
    fit = RiskFit("log-logistic", 2000.0, 1.0, np.diag([0.25, 0.0]), -1.0, 9)
    assert fit.stimulus_at(0.5)[0] == 0.0
    assert fit.quality_index(0.5) == pytest.approx(2.0 * np.sinh(0.98), rel=1e-4)


def iso_mme(folder: Path, *, interval: float = 1e-4, size: float = 1.0) -> Path:
    """Write an ISO-MME test of a headform in three axes."""
    _, values = grammars.pulse(peak=170.0)
    channels = dict.fromkeys(AXES, (size * values / np.sqrt(3.0), "g"))
    write_test(folder / "T", "T", channels, start=-60.0 * interval, interval=interval,
               velocity=8.33, mass=2.5)  # fmt: skip
    return folder


def test_a_test_in_three_axes_is_fitted(tmp_path: Path) -> None:
    with undrawn():
        answer = call("fit-stiffness", iso_mme(tmp_path / "data"), "--out", tmp_path / "out")
    assert (answer.code, answer.err, answer.warned) == (0, "", [])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"interval": 1e-300}, "samples lie 1e-300 s apart"),
        ({"interval": 1e-12}, "samples lie 1e-12 s apart"),
        ({"interval": 10.0}, "samples lie 10 s apart"),
        ({"size": 1e12}, "no sample is above 1e+09"),
        ({"size": 1e200}, "holds inf, no sample is above 1e+09"),
    ],
)
@pytest.mark.parametrize("command", ["fit-stiffness", "diagnose"])
def test_samples_that_no_recorder_has_are_refused(
    tmp_path: Path, command: str, change: dict[str, float], message: str
) -> None:
    # A step of 1e-300 s was a window of 1e297 samples, and a sum of squares overflowed.
    answer = call(command, iso_mme(tmp_path / "data", **change), "--out", tmp_path / "out")
    assert_told(answer, tmp_path / "out")
    assert (answer.code, message in answer.err) == (2, True), answer.err


@pytest.mark.parametrize(
    ("step", "value", "message"),
    [("1e-12", "1.0", "samples lie 1e-12 s apart"), ("1e-4", "-2e12", "holds -2e+12")],
)
def test_measured_samples_that_no_recorder_has_are_refused(
    tmp_path: Path, step: str, value: str, message: str
) -> None:
    header = grammars.toml_text(grammars.MEASURED)
    rows = [f"{k * float(step):.4g},{value}" for k in range(20)]
    write(tmp_path, {
        "measured.toml": header.encode(), "tests.csv": b"test,impact_speed,hic15\nH,8.33,600\n",
        "signals/H.csv": "\n".join(["time,head_acceleration", *rows]).encode(),
    })  # fmt: skip
    with pytest.raises(UserError, match=re.escape(message)):
        load_measured(tmp_path)
