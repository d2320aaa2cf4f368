"""Measured-data folders: what is read, in which units, and every kind of damage."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcstudy_tools import quiet
from numpy.testing import assert_allclose

from mcstudy.errors import UserError
from mcstudy.measurement.measured_data import Measured, load_measured

HEADER = """\
format = "mcstudy-measured/1"
title = "Hood B, child headform, 2 tests"
model = "headform"

[fixed]
headform_mass = 2.5
hood_curve = [[0.0, 0.0], [0.015, 2600.0]]

[uncertain.hood_force_scale]
distribution = "lognormal"
median = 1.0
sigma = 0.06

[inputs.impact_speed]
unit = "km/h"
sd = 0.18

[inputs.impact_angle]
unit = "deg"

[scalars.hic15]
sd = 20.0

[signals.head_acceleration]
unit = "m/s2"
sd = 1.0
filter = "CFC1000"

[signals.hood_force]
unit = "kN"
"""
TESTS = """\
test,impact_speed,impact_angle,hic15,remark
A-1,30,0,800,1
B.2,40,5,,2
"""


def ramp(start: float, step: float, count: int) -> str:
    """Return a signal file: acceleration 9.80665 k m/s2 and force k / 10 kN at sample k."""
    rows = [f"{start + k * step:.7f},{9.80665 * k:.6f},{0.1 * k:.4f}" for k in range(count)]
    return "\n".join(["time,head_acceleration,hood_force", *rows, ""])


TOML, CSV, SIGNAL = "measured.toml", "tests.csv", "signals/A-1.csv"
FILES = {
    TOML: HEADER,
    CSV: TESTS,
    SIGNAL: ramp(-0.005, 1e-4, 300),
    # Another time grid, that starts after contact.
    "signals/B.2.csv": ramp(0.002, 5e-5, 90),
}


def write(folder: Path, files: Mapping[str, str | bytes | None]) -> Path:
    """Write a folder; None leaves a file out."""
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if content is not None:
            path.write_bytes(content.encode() if isinstance(content, str) else content)
    return folder


def load(folder: Path, changes: Mapping[str, Any] | None = None) -> Measured:
    return load_measured(write(folder, FILES | dict(changes or {})))


def changed(name: str, old: str, new: str) -> dict[str, str]:
    assert old in FILES[name]
    return {name: FILES[name].replace(old, new)}


def test_header_tests_and_scalars(tmp_path: Path) -> None:
    data = load(tmp_path)
    header = data.header
    assert data.source == tmp_path
    assert (header.title, header.model) == ("Hood B, child headform, 2 tests", "headform")
    assert header.fixed["hood_curve"] == [[0.0, 0.0], [0.015, 2600.0]]
    assert header.uncertain["hood_force_scale"].distribution == "lognormal"
    assert header.scalars["hic15"].sd == 20.0
    assert list(data.tests["test"]) == ["A-1", "B.2"]
    assert data.tests["hic15"].iloc[0] == 800.0
    assert math.isnan(data.tests["hic15"].iloc[1])


def test_inputs_are_converted_with_their_uncertainty(tmp_path: Path) -> None:
    data = load(tmp_path)
    assert data.input_value("impact_speed", 0, "m/s") == pytest.approx((30.0 / 3.6, 0.05))
    assert data.input_value("impact_speed", 1, "km/h") == pytest.approx((40.0, 0.18))
    assert data.input_value("impact_angle", 1, "rad") == pytest.approx((math.radians(5.0), 0.0))
    # Fixed for all tests: exact, in the model's unit; a curve is no number.
    assert data.input_value("headform_mass", 1, "kg") == (2.5, 0.0)
    assert data.input_value("hood_curve", 0, "1") is None
    assert data.input_value("friction_body_car", 0, "1") is None
    with pytest.raises(UserError, match=r"inputs\.impact_speed\.unit: .*'km/h' measures speed"):
        data.input_value("impact_speed", 0, "kg")


def test_signals_keep_their_own_grid_and_lead_in(tmp_path: Path) -> None:
    data = load(tmp_path)
    time, values = data.signal("A-1", "head_acceleration", "g")
    assert_allclose(time, -0.005 + 1e-4 * np.arange(300), atol=1e-9)
    assert_allclose(values, np.arange(300.0), rtol=1e-6, atol=1e-6)
    time, values = data.signal("B.2", "hood_force", "N")
    assert_allclose(time, 0.002 + 5e-5 * np.arange(90), atol=1e-9)
    assert_allclose(values, 100.0 * np.arange(90.0), atol=1e-9)
    classes = [data.header.signals[k].channel_class for k in ("head_acceleration", "hood_force")]
    assert classes == [1000.0, 0.0]
    with pytest.raises(UserError, match=r"signals\.hood_force\.unit: .*'kN' measures force"):
        data.signal("A-1", "hood_force", "g")


def test_channels_with_gaps_and_channels_that_a_test_has_not(tmp_path: Path) -> None:
    # Channels of two recorders in one file: each has values at its own times.
    rows = [f"{k * 1e-4:.4f},{k if k % 2 else ''},{'' if k % 2 else k}" for k in range(40)]
    data = load(tmp_path, {
        SIGNAL: "\n".join(["time,head_acceleration,hood_force", *rows]),
        "signals/B.2.csv": "\n".join(["time,hood_force", *(f"{k},{k}" for k in range(9))]),
    })  # fmt: skip
    time, values = data.signal("A-1", "head_acceleration", "m/s2")
    assert_allclose(time, 1e-4 * np.arange(1, 40, 2))
    assert_allclose(values, np.arange(1, 40, 2))
    assert set(data.signals["B.2"]) == {"hood_force"}
    for test, name in (("B.2", "head_acceleration"), ("A-1", "bumper_force"), ("C", "hood_force")):
        with pytest.raises(UserError, match=f"test '{test}' has no signal '{name}'"):
            data.signal(test, name, "g")


@pytest.mark.parametrize(
    ("text", "encoding"),
    [
        (TESTS, "utf-16"),
        (TESTS.replace(",", ";").replace("30", "30,0"), "utf-8"),
        (TESTS.replace(",", "\t").replace("\n", "\r\n"), "utf-8-sig"),
        (TESTS.replace("remark", "Prüfer"), "cp1252"),
        ("hic15,impact_angle,test,impact_speed\n800,0,A-1,30\n,1,B.2,31\n", "utf-8"),
    ],
)
def test_tables_as_programs_write_them(tmp_path: Path, text: str, encoding: str) -> None:
    mark = b"\xef\xbb\xbf" + HEADER.encode()
    data = load(tmp_path, {CSV: text.encode(encoding), TOML: mark})
    assert list(data.tests["test"]) == ["A-1", "B.2"]
    assert data.input_value("impact_speed", 0, "km/h") == pytest.approx((30.0, 0.18))
    assert data.tests["hic15"].iloc[0] == 800.0


def test_places_of_errors_stand_in_the_file(tmp_path: Path) -> None:
    # The distribution is one of several classes; its name is no key of the file.
    with pytest.raises(UserError, match=r"toml: uncertain\.hood_force_scale\.sigma: ") as caught:
        load(tmp_path, changed(TOML, "sigma = 0.06", "sigma = '1'"))
    assert "lognormal" not in str(caught.value)
    with pytest.raises(UserError, match=r"toml: fixed\.hood_curve: must be a number or a list"):
        load(tmp_path, changed(TOML, "0.015, 2600.0", "0.015, 'x'"))


@pytest.mark.parametrize("unit", ["Km/h", "KM/H", "kph", "km/hr"])
def test_units_in_other_letters(tmp_path: Path, unit: str) -> None:
    data = load(tmp_path, changed(TOML, 'unit = "km/h"', f'unit = "{unit}"'))
    assert data.header.inputs["impact_speed"].unit == "km/h"


@pytest.mark.parametrize("test", ["007", "1e3", "NA", "None", "nan", "null"])
def test_ids_that_look_like_numbers_or_missing_values_stay_text(tmp_path: Path, test: str) -> None:
    files = changed(CSV, "A-1", test) | {f"signals/{test}.csv": FILES[SIGNAL]}
    data = load(tmp_path, files)
    assert list(data.tests["test"]) == list(data.signals) == [test, "B.2"]


def test_a_folder_without_signals_needs_no_signal_files(tmp_path: Path) -> None:
    header = HEADER[: HEADER.index("[signals.head")]
    assert load_measured(write(tmp_path, {TOML: header, CSV: TESTS})).signals == {}


NUMBERS = "time,head_acceleration,hood_force\n" + "0.1,1,1\n" * 20
BINARY = bytes(range(256))
FIFTY = ramp(0.0, 1e-4, 50)
SPEED = "column 'impact_speed' must"
NO_FILE = "cannot name a file"

DAMAGE: list[tuple[dict[str, Any], str]] = [
    ({CSV: None}, "tests.csv: cannot be read"),
    ({SIGNAL: None}, "A-1.csv: cannot be read"),
    ({TOML: ""}, "measured.toml: "),
    ({TOML: HEADER[:200]}, "measured.toml: "),
    ({TOML: BINARY}, "measured.toml: cannot be read"),
    ({TOML: "a = " + "[" * 5000}, "measured.toml: not valid TOML"),
    (changed(TOML, "measured/1", "measured/2"), "measured.toml: format"),
    (changed(TOML, 'model = "headform"', ""), "measured.toml: model"),
    ({TOML: "colour = 3\n" + HEADER}, "measured.toml: colour"),
    (changed(TOML, "sd = 0.18", "sde = 1.0"), "measured.toml: inputs.impact_speed.sde"),
    *((changed(TOML, "sd = 0.18", f"sd = {bad}"), "inputs.impact_speed.sd")
      for bad in ("-1", "nan", "'1'")),
    (changed(TOML, "CFC1000", "CFC100"), "signals.head_accel"),
    (changed(TOML, "headform_mass = 2.5", "headform_mass = 'x'"), "fixed.headform_mass"),
    (changed(TOML, "lognormal", "gauss"), "uncertain.hood_force"),
    (changed(TOML, 'title = "Hood B, child headform, 2 tests"', "title = 3"),
     "measured.toml: title"),
    (changed(TOML, "inputs.impact_angle", "inputs.test"), ""),
    ({CSV: ""}, "tests.csv: line 1 must name"),
    ({CSV: BINARY}, "tests.csv: cannot be read"),
    ({CSV: TESTS.splitlines()[0]}, "tests.csv: holds no tests"),
    ({CSV: TESTS[:-9]}, "tests.csv: line 3 has 1 fields, not 5"),
    (changed(CSV, "A-1", '"A-1'), "tests.csv: cannot be read"),
    (changed(CSV, "test,", "id,"), "tests.csv: column 'test' is missing"),
    (changed(CSV, "impact_speed", "speed"), "column 'impact_speed'"),
    (changed(CSV, "hic15", "hic"), "column 'hic15' is missing"),
    *((changed(CSV, "A-1,30", f"A-1,{bad}"), SPEED)
      for bad in ("nan", "", "inf", "fast", '"30,5"', "1" + "0" * 400)),
    ({CSV: TESTS.replace("A-1,30", "A-1,True").replace("B.2,40", "B.2,False")}, SPEED),
    (changed(CSV, "800", "much"), "line 2: column 'hic15' must"),
    (changed(CSV, "B.2", "A-1"), "line 3: test 'A-1' is there"),
    (changed(CSV, "A-1", "../A-1"), "test id '../A-1' cannot name a file"),
    *((changed(CSV, "A-1", bad), NO_FILE)
      for bad in ("x/../A-1", "/etc/passwd", "C:A-1", ".A-1", '"A\n1"', "x" * 5000)),
    (changed(CSV, "A-1", "A\0-1"), "cannot be read"),
    (changed(CSV, "A-1", ""), "tests.csv: "),
    ({SIGNAL: ""}, "A-1.csv: line 1 must name"),
    ({SIGNAL: NUMBERS[:34]}, "A-1.csv: line .* ends after 0 samples"),
    ({SIGNAL: ramp(0.0, 1e-4, 7)}, "A-1.csv: line 8: .* ends after 7 samples"),
    ({SIGNAL: BINARY}, "A-1.csv: cannot be read"),
    (changed(SIGNAL, "time,", "t,"), "A-1.csv: line 1: the first column must be"),
    (changed(SIGNAL, "time,head_acceleration", "head_acceleration,time"), "line 1: the first"),
    ({SIGNAL: NUMBERS}, "A-1.csv: line 3: time must rise"),
    ({SIGNAL: FIFTY + "0.001,1,1\n"}, "line 52: time must rise"),
    ({SIGNAL: FIFTY + "0.1,abc,1\n"}, "'head_acceleration' must"),
    ({SIGNAL: FIFTY + "now,1,1\n"}, "column 'time' must hold"),
    ({SIGNAL: FIFTY + "0.1,1,1,1,1\n"}, "A-1.csv: line 52 has 5 fields"),
    ({SIGNAL: NUMBERS.replace("0.1,1", "0.1,nan")}, "line 2: .* must hold numbers"),
    # Laboratories' files end rows in a separator: a reader must not take the first for an index.
    ({SIGNAL: NUMBERS[:34] + "".join(f"{k}e-4,{k},{k},{k}\n" for k in range(50))},
     "A-1.csv: line 2 has 4 fields"),
]  # fmt: skip


@pytest.mark.parametrize(("files", "message"), DAMAGE, ids=[message for _, message in DAMAGE])
def test_damage_is_told_in_one_line_that_names_the_place(
    tmp_path: Path, files: dict[str, Any], message: str
) -> None:
    with pytest.raises(UserError, match=message or None) as caught:
        load(tmp_path, files)
    assert str(caught.value).startswith(str(tmp_path))
    assert len(str(caught.value).splitlines()) == 1
    assert str(caught.value).isprintable()


def test_what_is_no_folder_of_measured_data(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "empty").mkdir()
    neither = "holds neither measured.toml nor an ISO-MME test"
    for name, message in (("file", "is no folder"), ("none", "is no folder"), ("empty", neither)):
        with pytest.raises(UserError, match=message) as caught:
            load_measured(tmp_path / name)
        assert str(caught.value).startswith(str(tmp_path / name))


@quiet(60)
@given(name=st.sampled_from(sorted(FILES)), data=st.data())
def test_any_folder_is_read_or_a_user_error(tmp_path: Path, name: str, data: st.DataObject) -> None:
    text = FILES[name]
    start = data.draw(st.integers(0, len(text) - 1))
    end = data.draw(st.integers(start, min(len(text), start + 12)))
    insert = data.draw(st.text("abc,.;\"'[]{}=#-e0129\n \t\0", max_size=8))
    try:
        loaded = load(tmp_path, {name: text[:start] + insert + text[end:]})
    except UserError as error:
        assert len(str(error).splitlines()) == 1
        return
    for channels in loaded.signals.values():
        for table in channels.values():
            assert np.all(np.isfinite(table))
            assert np.all(np.diff(table[:, 0]) > 0.0)
    assert np.all(np.isfinite(loaded.tests[["impact_speed", "impact_angle"]]))
