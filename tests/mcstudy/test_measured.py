"""Measured-data folders: what is read, in which units, and every kind of damage."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

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


FILES: dict[str, str | bytes] = {
    "measured.toml": HEADER,
    "tests.csv": TESTS,
    "signals/A-1.csv": ramp(-0.005, 1e-4, 300),
    # Another time grid, that starts after contact.
    "signals/B.2.csv": ramp(0.002, 5e-5, 90),
}


def write(folder: Path, files: Mapping[str, str | bytes | None]) -> Path:
    """Write a folder; None leaves a file out."""
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(content, str):
            path.write_text(content, encoding="utf-8")
        elif content is not None:
            path.write_bytes(content)
    return folder


def load(folder: Path, **changes: Any) -> Measured:
    return load_measured(write(folder, FILES | changes))


def changed(name: str, old: str, new: str) -> dict[str, str]:
    text = FILES[name]
    assert isinstance(text, str)
    assert old in text
    return {name: text.replace(old, new)}


# -- good folders ----------------------------------------------------------------------------


def test_header_tests_and_scalars(tmp_path: Path) -> None:
    data = load(tmp_path)
    assert data.source == tmp_path
    assert data.header.title == "Hood B, child headform, 2 tests"
    assert data.header.model == "headform"
    assert data.header.fixed["hood_curve"] == [[0.0, 0.0], [0.015, 2600.0]]
    assert data.header.uncertain["hood_force_scale"].distribution == "lognormal"
    assert data.header.scalars["hic15"].sd == 20.0
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
    np.testing.assert_allclose(time, -0.005 + 1e-4 * np.arange(300), atol=1e-9)
    np.testing.assert_allclose(values, np.arange(300.0), rtol=1e-6, atol=1e-6)
    time, values = data.signal("B.2", "hood_force", "N")
    np.testing.assert_allclose(time, 0.002 + 5e-5 * np.arange(90), atol=1e-9)
    np.testing.assert_allclose(values, 100.0 * np.arange(90.0), atol=1e-9)
    header = data.header.signals
    assert header["head_acceleration"].channel_class == 1000.0
    assert header["hood_force"].channel_class == 0.0
    with pytest.raises(UserError, match=r"signals\.hood_force\.unit: .*'kN' measures force"):
        data.signal("A-1", "hood_force", "g")


def test_channels_with_gaps_and_channels_that_a_test_has_not(tmp_path: Path) -> None:
    # Channels of two recorders in one file: each has values at its own times.
    rows = [f"{k * 1e-4:.4f},{k if k % 2 else ''},{'' if k % 2 else k}" for k in range(40)]
    files = {
        "signals/A-1.csv": "\n".join(["time,head_acceleration,hood_force", *rows]),
        "signals/B.2.csv": "\n".join(["time,hood_force", *(f"{k},{k}" for k in range(9))]),
    }
    data = load(tmp_path, **files)
    time, values = data.signal("A-1", "head_acceleration", "m/s2")
    np.testing.assert_allclose(time, 1e-4 * np.arange(1, 40, 2))
    np.testing.assert_allclose(values, np.arange(1, 40, 2))
    assert set(data.signals["B.2"]) == {"hood_force"}
    for test, name in (("B.2", "head_acceleration"), ("A-1", "bumper_force"), ("C", "hood_force")):
        with pytest.raises(UserError, match=f"test '{test}' has no signal '{name}'"):
            data.signal(test, name, "g")


def test_columns_in_any_order_and_windows_files(tmp_path: Path) -> None:
    text = "hic15,impact_angle,test,impact_speed\r\n,0,A-1,30\r\n7,1,B.2,31\r\n"
    data = load(tmp_path, **{"tests.csv": b"\xef\xbb\xbf" + text.encode()})
    assert data.input_value("impact_speed", 1, "km/h") == pytest.approx((31.0, 0.18))
    assert list(data.tests["test"]) == ["A-1", "B.2"]


@pytest.mark.parametrize(
    ("text", "encoding"),
    [
        (TESTS, "utf-16"),
        (TESTS.replace(",", ";"), "utf-8"),
        (TESTS.replace(",", ";").replace("30", "30,0"), "utf-8"),
        (TESTS.replace(",", "\t"), "utf-8-sig"),
        (TESTS.replace(",", " , "), "utf-8"),
        ("sep=;\n" + TESTS.replace(",", ";"), "utf-8"),
        (TESTS.replace("remark", "Prüfer"), "cp1252"),
        (TESTS.replace("\n", "\r"), "utf-8"),
    ],
)
def test_tables_as_programs_write_them(tmp_path: Path, text: str, encoding: str) -> None:
    data = load(tmp_path, **{"tests.csv": text.encode(encoding)})
    assert list(data.tests["test"]) == ["A-1", "B.2"]
    assert data.input_value("impact_speed", 0, "km/h") == pytest.approx((30.0, 0.18))
    assert data.tests["hic15"].iloc[0] == 800.0


def test_a_study_file_with_a_byte_order_mark(tmp_path: Path) -> None:
    data = load(tmp_path, **{"measured.toml": b"\xef\xbb\xbf" + HEADER.encode()})
    assert data.header.title.startswith("Hood B")


def test_places_of_errors_stand_in_the_file(tmp_path: Path) -> None:
    # The distribution is one of several classes; its name is no key of the file.
    with pytest.raises(UserError, match=r"toml: uncertain\.hood_force_scale\.sigma: ") as caught:
        load(tmp_path, **changed("measured.toml", "sigma = 0.06", "sigma = '1'"))
    assert "lognormal" not in str(caught.value)
    with pytest.raises(UserError, match=r"toml: fixed\.hood_curve: must be a number or a list"):
        load(tmp_path, **changed("measured.toml", "0.015, 2600.0", "0.015, 'x'"))


@pytest.mark.parametrize("unit", ["Km/h", "KM/H", "kph", "km/hr"])
def test_units_in_other_letters(tmp_path: Path, unit: str) -> None:
    data = load(tmp_path, **changed("measured.toml", 'unit = "km/h"', f'unit = "{unit}"'))
    assert data.header.inputs["impact_speed"].unit == "km/h"


def test_numbers_as_ids_stay_text(tmp_path: Path) -> None:
    files = {"tests.csv": TESTS.replace("A-1", "007").replace("B.2", "1e3")}
    signal = FILES["signals/A-1.csv"]
    files |= {"signals/007.csv": signal, "signals/1e3.csv": signal}
    data = load(tmp_path, **files)
    assert list(data.tests["test"]) == ["007", "1e3"]
    assert data.signal("007", "hood_force", "kN")[0].size == 300


def test_a_folder_without_signals_needs_no_signal_files(tmp_path: Path) -> None:
    header = HEADER[: HEADER.index("[signals.head")]
    data = load_measured(write(tmp_path, {"measured.toml": header, "tests.csv": TESTS}))
    assert data.signals == {}


# -- damage ----------------------------------------------------------------------------------

SIGNAL = "signals/A-1.csv"
NUMBERS = "time,head_acceleration,hood_force\n" + "0.1,1,1\n" * 20
BINARY = bytes(range(256))


DAMAGE: dict[str, tuple[dict[str, Any], str]] = {
    "no tests.csv": ({"tests.csv": None}, "tests.csv: cannot be read"),
    "no signal": ({SIGNAL: None}, "A-1.csv: cannot be read"),
    "header empty": ({"measured.toml": ""}, "measured.toml: "),
    "header cut": ({"measured.toml": HEADER[:200]}, "measured.toml: "),
    "header binary": ({"measured.toml": BINARY}, "measured.toml: cannot be read"),
    "header nested": ({"measured.toml": "a = " + "[" * 5000}, "measured.toml: not valid TOML"),
    "other format": (changed("measured.toml", "measured/1", "measured/2"), "measured.toml: format"),
    "no model": (changed("measured.toml", 'model = "headform"', ""), "measured.toml: model"),
    "unknown key": ({"measured.toml": "colour = 3\n" + HEADER}, "measured.toml: colour"),
    "unknown nested key": (changed("measured.toml", "sd = 0.18", "sde = 1.0"),
                           "measured.toml: inputs.impact_speed.sde"),
    "sd negative": (changed("measured.toml", "sd = 0.18", "sd = -1"), "inputs.impact_speed.sd"),
    "sd nan": (changed("measured.toml", "sd = 0.18", "sd = nan"), "inputs.impact_speed.sd"),
    "sd text": (changed("measured.toml", "sd = 0.18", "sd = '1'"), "inputs.impact_speed.sd"),
    "filter unknown": (changed("measured.toml", "CFC1000", "CFC100"), "signals.head_accel"),
    "fixed text": (changed("measured.toml", "headform_mass = 2.5", "headform_mass = 'x'"),
                   "fixed.headform_mass"),
    "bad distribution": (changed("measured.toml", "lognormal", "gauss"), "uncertain.hood_force"),
    "title a number": (changed("measured.toml", 'title = "Hood B, child headform, 2 tests"',
                               "title = 3"), "measured.toml: title"),
    "tests empty": ({"tests.csv": ""}, "tests.csv: line 1 must name"),
    "tests binary": ({"tests.csv": BINARY}, "tests.csv: cannot be read"),
    "tests cut": ({"tests.csv": TESTS.splitlines()[0]}, "tests.csv: holds no tests"),
    "row cut": ({"tests.csv": TESTS[:-9]}, "tests.csv: line 3 has 1 fields, not 5"),
    "open quote": (changed("tests.csv", "A-1", '"A-1'), "tests.csv: cannot be read"),
    "no id column": (changed("tests.csv", "test,", "id,"), "tests.csv: column 'test' is missing"),
    "no input column": (changed("tests.csv", "impact_speed", "speed"), "column 'impact_speed'"),
    "no scalar column": (changed("tests.csv", "hic15", "hic"), "column 'hic15' is missing"),
    "nan input": (changed("tests.csv", "A-1,30", "A-1,nan"), "column 'impact_speed' must"),
    "empty input": (changed("tests.csv", "A-1,30", "A-1,"), "column 'impact_speed' must"),
    "infinite input": (changed("tests.csv", "A-1,30", "A-1,inf"), "column 'impact_speed' must"),
    "text in an input": (changed("tests.csv", "A-1,30", "A-1,fast"), "column 'impact_speed' must"),
    "text in a scalar": (changed("tests.csv", "800", "much"), "line 2: column 'hic15' must"),
    "decimal comma": (changed("tests.csv", "30", '"30,5"'), "column 'impact_speed' must"),
    "repeated id": (changed("tests.csv", "B.2", "A-1"), "line 3: test 'A-1' is there"),
    "path trick": (changed("tests.csv", "A-1", "../A-1"), "test id '../A-1' cannot name a file"),
    "path trick inside": (changed("tests.csv", "A-1", "x/../A-1"), "cannot name a file"),
    "absolute path": (changed("tests.csv", "A-1", "/etc/passwd"), "cannot name a file"),
    "windows path": (changed("tests.csv", "A-1", "C:A-1"), "cannot name a file"),
    "hidden file": (changed("tests.csv", "A-1", ".A-1"), "cannot name a file"),
    "line break in id": (changed("tests.csv", "A-1", '"A\n1"'), "cannot name a file"),
    "null in id": (changed("tests.csv", "A-1", "A\0-1"), "cannot be read"),
    "long id": (changed("tests.csv", "A-1", "x" * 5000), "cannot name a file"),
    "signal empty": ({SIGNAL: ""}, "A-1.csv: line 1 must name"),
    "signal header only": ({SIGNAL: NUMBERS[:34]}, "A-1.csv: line .* ends after 0 samples"),
    "signal cut": ({SIGNAL: ramp(0.0, 1e-4, 7)}, "A-1.csv: line 8: .* ends after 7 samples"),
    "signal binary": ({SIGNAL: BINARY}, "A-1.csv: cannot be read"),
    "signal without time": (changed(SIGNAL, "time,", "t,"), "line 1: the first column must be"),
    "time not first": (changed(SIGNAL, "time,head_acceleration", "head_acceleration,time"),
                       "A-1.csv: line 1: the first column"),
    "time stands still": ({SIGNAL: NUMBERS}, "A-1.csv: line 3: time must rise"),
    "time falls": ({SIGNAL: ramp(0.0, -1e-4, 50)}, "A-1.csv: line 3: time must rise"),
    "time jumps back": ({SIGNAL: ramp(0.0, 1e-4, 50) + "0.001,1,1\n"}, "line 52: time must rise"),
    "text in a signal": ({SIGNAL: ramp(0.0, 1e-4, 50) + "0.1,abc,1\n"}, "'head_acceleration' must"),
    "text in time": ({SIGNAL: ramp(0.0, 1e-4, 50) + "now,1,1\n"}, "column 'time' must hold"),
    "ragged": ({SIGNAL: ramp(0.0, 1e-4, 50) + "0.1,1,1,1,1\n"}, "A-1.csv: line 52 has 5 fields"),
    "only nan": ({SIGNAL: NUMBERS.replace("0.1,1", "0.1,nan")}, "line 2: .* must hold numbers"),
    "empty id": (changed("tests.csv", "A-1", ""), "tests.csv: "),
    "input called test": (changed("measured.toml", "inputs.impact_angle", "inputs.test"), ""),
    "huge number": (changed("tests.csv", "A-1,30", "A-1,1" + "0" * 400), "tests.csv: "),
    "a switch": ({"tests.csv": TESTS.replace("A-1,30", "A-1,True").replace("B.2,40", "B.2,False")},
                 "column 'impact_speed'"),
    # Laboratories' files end rows in a separator: a reader must not take the first for an index.
    "a column more in each row": (
        {SIGNAL: "time,head_acceleration,hood_force\n"
                 + "".join(f"{k}e-4,{k},{k},{k}\n" for k in range(50))},
        "A-1.csv: line 2 has 4 fields"),
}  # fmt: skip
CASES = [(name, *case) for name, case in DAMAGE.items()]


@pytest.mark.parametrize(("name", "files", "message"), CASES, ids=list(DAMAGE))
def test_damage_is_told_in_one_line_that_names_the_place(
    tmp_path: Path, name: str, files: dict[str, Any], message: str
) -> None:
    with pytest.raises(UserError, match=message or None) as caught:
        load(tmp_path, **files)
    assert str(caught.value).startswith(str(tmp_path))
    assert len(str(caught.value).splitlines()) == 1
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("test", ["NA", "None", "nan", "null"])
def test_ids_that_look_like_missing_values(tmp_path: Path, test: str) -> None:
    files = changed("tests.csv", "A-1", test) | {f"signals/{test}.csv": FILES[SIGNAL]}
    assert list(load(tmp_path, **files).signals) == [test, "B.2"]


def test_what_is_no_folder_of_measured_data(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("")
    empty = tmp_path / "empty"
    empty.mkdir()
    for place, message in ((path, "is no folder"), (tmp_path / "none", "is no folder"),
                           (empty, "holds neither measured.toml nor an ISO-MME test")):  # fmt: skip
        with pytest.raises(UserError, match=message) as caught:
            load_measured(place)
        assert str(caught.value).startswith(str(place))


@settings(
    derandomize=True,
    deadline=None,
    database=None,
    max_examples=100,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
@given(name=st.sampled_from(sorted(FILES)), data=st.data())
def test_a_mutilated_folder_is_read_or_is_a_user_error(
    tmp_path: Path, name: str, data: st.DataObject
) -> None:
    text = FILES[name]
    assert isinstance(text, str)
    start = data.draw(st.integers(0, len(text) - 1))
    end = data.draw(st.integers(start, min(len(text), start + 12)))
    insert = data.draw(st.text("abc,.;\"'[]{}=#-e0129\n \t\0", max_size=8))
    try:
        loaded = load(tmp_path, **{name: text[:start] + insert + text[end:]})
    except UserError as error:
        assert len(str(error).splitlines()) == 1
        return
    for channels in loaded.signals.values():
        for table in channels.values():
            assert np.all(np.isfinite(table))
            assert np.all(np.diff(table[:, 0]) > 0.0)
    assert np.all(np.isfinite(loaded.tests[["impact_speed", "impact_angle"]]))
