"""ISO-MME folders: written and read back, units, missing values, several tests, damage."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mcstudy.errors import UserError
from mcstudy.measurement.isomme import find_tests, head_acceleration, read_test, write_test
from mcstudy.measurement.measured_data import load_measured

Array = NDArray[np.float64]

RESULTANT = "D0HEADCG00PCACRA"
AXES = tuple(f"D0HEADCG00PCAC{axis}A" for axis in "XYZ")
VALUES = np.concatenate([np.zeros(20), 100.0 * np.sin(np.linspace(0.0, math.pi, 80))])
GIVEN = {"start": -0.002, "interval": 1e-4, "velocity": 8.333333333, "mass": 2.5}
QUIET = settings(
    derandomize=True,
    deadline=None,
    database=None,
    max_examples=60,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)


def written(folder: Path, values: Array = VALUES, unit: str = "g", name: str = "CASE7") -> Path:
    return write_test(folder / name, name, {RESULTANT: (values, unit)}, title="A drop", **GIVEN)


def edit(path: Path, change: Callable[[str], str]) -> None:
    old = path.read_text(encoding="utf-8")
    new = change(old)
    assert new != old
    path.write_text(new, encoding="utf-8")


def channel_file(mme: Path, number: int = 1) -> Path:
    return mme.parent / "Channel" / f"{mme.stem}.{number:03d}"


# -- the format ------------------------------------------------------------------------------


def test_files_are_those_of_the_standard(tmp_path: Path) -> None:
    # Folder, index and one file a channel; names padded to 28 columns (injury.md section 4).
    mme = write_test(
        tmp_path / "CASE7", "CASE7", {AXES[0]: (VALUES, "m/(s*s)"), AXES[1]: (VALUES, "g")},
        title="Time: 12:30", **GIVEN,
    )  # fmt: skip
    names = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()}
    assert names == {
        "CASE7/CASE7.mme", "CASE7/Channel/CASE7.chn", "CASE7/Channel/CASE7.001",
        "CASE7/Channel/CASE7.002",
    }  # fmt: skip
    lines = channel_file(mme).read_text().splitlines()
    header = [line for line in lines if ":" in line]
    assert all(line[28] == ":" for line in header)
    assert "Reference channel           :implicit" in header
    assert f"Channel code                :{AXES[0]}" in header
    assert "Unit                        :m/(s*s)" in header
    assert "Number of samples           :100" in header
    assert lines[len(header) :] == [f"{v:.6E}" for v in VALUES]
    index = (tmp_path / "CASE7" / "Channel" / "CASE7.chn").read_text()
    assert "Number of channels          :2" in index
    assert f"Name of channel 002         :{AXES[1]}" in index
    assert "Title                       :Time: 12:30" in mme.read_text()


def test_written_and_read_back(tmp_path: Path) -> None:
    values = VALUES.copy()
    values[[3, 50]] = math.nan
    codes = {RESULTANT: (values, "g"), "D0HEADCG00PCAVY0": (2.0 * VALUES, "rad/s")}
    test = read_test(write_test(tmp_path / "A", "A1", codes, title="Hood: B", **GIVEN))
    assert (test.name, test.title, test.mass) == ("A1", "Hood: B", 2.5)
    assert test.velocity == pytest.approx(8.333333333, rel=1e-9)
    first, second = test.channels
    assert (first.code, first.unit, first.filter) == (RESULTANT, "g", "CFC1000")
    assert (second.code, second.unit, second.filter) == ("D0HEADCG00PCAVY0", "rad/s", "none")
    np.testing.assert_allclose(first.time, -0.002 + 1e-4 * np.arange(100), atol=1e-15)
    np.testing.assert_allclose(first.values, values, rtol=1e-6)
    np.testing.assert_allclose(second.values, 2.0 * VALUES, rtol=1e-6)


@QUIET
@given(
    values=st.lists(st.floats(-1e30, 1e30, allow_subnormal=False), min_size=2, max_size=40),
    start=st.floats(-10.0, 10.0),
    interval=st.floats(1e-6, 1.0),
)
def test_any_numbers_come_back(
    tmp_path: Path, values: list[float], start: float, interval: float
) -> None:
    mme = write_test(tmp_path / "T", "T", {RESULTANT: (np.array(values), "g")}, start=start,
                     interval=interval)  # fmt: skip
    test = read_test(mme)
    np.testing.assert_allclose(test.channels[0].values, values, rtol=5.1e-7)
    expected = start + interval * np.arange(len(values))
    np.testing.assert_allclose(test.channels[0].time, expected, rtol=1e-8, atol=1e-8 * abs(start))
    assert math.isnan(test.velocity) and math.isnan(test.mass)


@pytest.mark.parametrize(
    ("letter", "name"),
    [("A", "CFC1000"), ("B", "CFC600"), ("C", "CFC180"), ("D", "CFC60"), ("0", "none"),
     ("X", "none")],
)  # fmt: skip
def test_filter_is_the_last_letter(tmp_path: Path, letter: str, name: str) -> None:
    code = RESULTANT[:15] + letter
    mme = write_test(tmp_path / "T", "T", {code: (VALUES, "g")}, **GIVEN)
    assert read_test(mme).channels[0].filter == name
    header = load_measured(tmp_path).header
    assert header.signals["head_acceleration"].filter == name


@pytest.mark.parametrize(
    "code", ["", "SHORT", RESULTANT + "A", "D0headCG00PCACRA", "D0HEAD:G00PCACRA"]
)
def test_codes_have_sixteen_characters(tmp_path: Path, code: str) -> None:
    with pytest.raises(ValueError, match="16"):
        write_test(tmp_path / "T", "T", {code: (VALUES, "g")}, **GIVEN)
    assert not (tmp_path / "T").exists()


def test_a_missing_title_stays_missing(tmp_path: Path) -> None:
    mme = write_test(tmp_path / "T", "T", {RESULTANT: (VALUES, "g")}, **GIVEN)
    assert read_test(mme).title == ""


# -- head acceleration -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("unit", "size"),
    [("g", 1.0), ("m/s2", 9.80665), ("m/(s*s)", 9.80665), ("m/s^2", 9.80665), ("m/s²", 9.80665)],
)
def test_accelerations_are_in_g(tmp_path: Path, unit: str, size: float) -> None:
    found = head_acceleration(read_test(written(tmp_path, size * VALUES, unit))).channel
    assert (found.unit, found.code) == ("g", RESULTANT)
    np.testing.assert_allclose(found.values, VALUES, rtol=1e-6)


def test_files_in_latin_letters(tmp_path: Path) -> None:
    mme = written(tmp_path, 9.80665 * VALUES, "m/s²")
    path = channel_file(mme)
    path.write_bytes(path.read_text(encoding="utf-8").encode("latin-1"))
    np.testing.assert_allclose(head_acceleration(read_test(mme)).channel.values, VALUES, rtol=1e-6)


def test_resultant_of_three_axes_in_mixed_units(tmp_path: Path) -> None:
    x, y, z = VALUES, -0.5 * VALUES, np.linspace(-3.0, 3.0, VALUES.size)
    codes = {AXES[0]: (x, "g"), AXES[1]: (9.80665 * y, "m/s2"), AXES[2]: (z, "g"),
             "D0HEADCG00PCAVXA": (x, "rad/s"), "D0CHST0000PCACRA": (x, "g")}  # fmt: skip
    found = head_acceleration(read_test(write_test(tmp_path / "T", "T", codes, **GIVEN))).channel
    assert found.code == RESULTANT
    np.testing.assert_allclose(found.values, np.sqrt(x**2 + y**2 + z**2), rtol=2e-6)


def test_a_resultant_channel_alone_keeps_its_sign(tmp_path: Path) -> None:
    noise = VALUES - 0.4
    mme = write_test(tmp_path / "T", "T", {RESULTANT: (noise, "g")}, **GIVEN)
    found = head_acceleration(read_test(mme)).channel
    np.testing.assert_allclose(found.values, noise, rtol=1e-6)


def test_missing_samples_are_left_out(tmp_path: Path) -> None:
    y = VALUES.copy()
    y[:5] = y[90:] = math.nan
    codes = {AXES[0]: (VALUES, "g"), AXES[1]: (y, "g"), AXES[2]: (VALUES, "g")}
    mme = write_test(tmp_path / "T", "T", codes, **GIVEN)
    assert "NOVALUE" in channel_file(mme, 2).read_text()
    found = head_acceleration(read_test(mme)).channel
    np.testing.assert_allclose(found.time, -0.002 + 1e-4 * np.arange(5, 90), atol=1e-12)
    np.testing.assert_allclose(found.values, math.sqrt(3.0) * VALUES[5:90], rtol=2e-6)


@pytest.mark.parametrize(
    ("codes", "message"),
    [
        (AXES[:2], "no head acceleration"),
        (("D0HEADCG00PCAVRA",), "no head acceleration"),
        (("D0CHST0000PCACRA",), "no head acceleration"),
    ],
)
def test_tests_without_head_acceleration(
    tmp_path: Path, codes: tuple[str, ...], message: str
) -> None:
    test = read_test(write_test(tmp_path / "T", "T7", dict.fromkeys(codes, (VALUES, "g")), **GIVEN))
    with pytest.raises(UserError, match=rf"T7\.mme: .*{message}"):
        head_acceleration(test)


def test_axes_on_other_times_are_refused(tmp_path: Path) -> None:
    mme = write_test(tmp_path / "T", "T", dict.fromkeys(AXES, (VALUES, "g")), **GIVEN)
    edit(channel_file(mme, 3), lambda text: text.replace(":-0.002", ":-0.001"))
    with pytest.raises(UserError, match="differ in time"):
        head_acceleration(read_test(mme))


def test_axes_filtered_differently_are_refused(tmp_path: Path) -> None:
    codes = {code[:15] + letter: (VALUES, "g") for code, letter in zip(AXES, "A0D", strict=True)}
    test = read_test(write_test(tmp_path / "T", "T", codes, **GIVEN))
    with pytest.raises(UserError, match="filter"):
        head_acceleration(test)


@pytest.mark.parametrize("missing", ["velocity", "mass"])
def test_speed_and_mass_must_be_given(tmp_path: Path, missing: str) -> None:
    values = {key: value for key, value in GIVEN.items() if key != missing}
    mme = write_test(tmp_path / "T", "T", {RESULTANT: (VALUES, "g")}, **values)
    assert math.isnan(getattr(read_test(mme), missing))
    with pytest.raises(UserError, match="'Velocity test object 1' and 'Mass test object 1'"):
        load_measured(tmp_path)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("8.25", 8.25), ("+8.25", 8.25), ("-8.25", -8.25), ("8.25 m/s", 8.25), (".5", 0.5),
        ("8.25E+00", 8.25), ("1e1", 10.0), ("NOVALUE", math.nan), ("", math.nan),
        ("30 km/h", 30.0 / 3.6), ("8.25 m/s", 8.25),
    ],
)  # fmt: skip
def test_speed_as_laboratories_write_it(tmp_path: Path, text: str, value: float) -> None:
    mme = written(tmp_path)
    edit(mme, lambda old: old.replace(":8.33333333", f":{text}"))
    found = read_test(mme).velocity
    assert found == pytest.approx(value, nan_ok=True)


@pytest.mark.parametrize("text", ["fast", "8,25", "30 knots", "12 kg"])
def test_a_speed_that_is_none_is_refused(tmp_path: Path, text: str) -> None:
    mme = written(tmp_path)
    edit(mme, lambda old: old.replace(":8.33333333", f":{text}"))
    with pytest.raises(UserError, match="not a number in m/s"):
        _ = read_test(mme).velocity


# -- folders ---------------------------------------------------------------------------------


def test_several_tests_in_subfolders_are_one_set(tmp_path: Path) -> None:
    for k, name in enumerate(("B2", "A1", "C3")):
        write_test(
            tmp_path / name, name, {RESULTANT: ((k + 1.0) * VALUES, "g")}, title=f"Test {name}",
            start=-0.002 * k, interval=1e-4, velocity=8.0 + k, mass=2.5 + k,
        )  # fmt: skip
    assert [path.stem for path in find_tests(tmp_path)] == ["A1", "B2", "C3"]
    data = load_measured(tmp_path)
    assert list(data.tests["test"]) == ["A1", "B2", "C3"]
    assert data.header.model == "headform"
    assert data.header.title == "Test A1"
    assert data.input_value("impact_speed", 0, "m/s") == (9.0, 0.0)
    assert data.input_value("headform_mass", 2, "kg") == (4.5, 0.0)
    time, values = data.signal("B2", "head_acceleration", "g")
    assert time[0] == 0.0
    np.testing.assert_allclose(values, VALUES, rtol=1e-6)


def test_a_test_folder_itself_and_capital_letters(tmp_path: Path) -> None:
    mme = written(tmp_path)
    (mme.parent / "Channel").rename(mme.parent / "CHANNEL")
    mme.rename(mme.with_suffix(".MME"))
    assert list(load_measured(mme.parent).tests["test"]) == ["CASE7"]


def test_tests_filtered_differently_or_named_alike_are_refused(tmp_path: Path) -> None:
    written(tmp_path / "one")
    write_test(tmp_path / "one" / "B", "B", {RESULTANT[:15] + "C": (VALUES, "g")}, **GIVEN)
    with pytest.raises(UserError, match="filtered differently"):
        load_measured(tmp_path / "one")
    for folder in "AB":
        write_test(tmp_path / "two" / folder, "SAME", {RESULTANT: (VALUES, "g")}, **GIVEN)
    with pytest.raises(UserError, match="same name"):
        load_measured(tmp_path / "two")


# -- damage ----------------------------------------------------------------------------------


def _cut(text: str) -> str:
    return text[: text.index("Sampling interval")]


DAMAGE: dict[str, Callable[[str], str]] = {
    "empty": lambda text: "",
    "header only": lambda text: "".join(
        line for line in text.splitlines(keepends=True) if ":" in line),
    "short code": lambda text: text.replace(f":{RESULTANT}", ":HEAD"),
    "no interval": lambda text: text.replace("Sampling interval", "Interval"),
    "interval 0": lambda text: text.replace(":0.0001", ":0"),
    "interval missing": lambda text: text.replace(":0.0001", ":NOVALUE"),
    "no start": lambda text: text.replace("Time of first sample", "Start"),
    "text in samples": lambda text: text.replace("\n0.000000E+00\n", "\nzero\n", 1),
    "two columns": lambda text: text.replace("\n0.000000E+00\n", "\n0.0 1.0\n", 1),
    "unit of a mass": lambda text: text.replace(":g\n", ":kg\n"),
    "unit unknown": lambda text: text.replace(":g\n", ":furlong\n"),
    "header cut": _cut,
}  # fmt: skip


@pytest.mark.parametrize("name", DAMAGE)
def test_damaged_channels_are_told_in_one_line(tmp_path: Path, name: str) -> None:
    mme = written(tmp_path)
    edit(channel_file(mme), DAMAGE[name])
    with pytest.raises(UserError) as caught:
        load_measured(tmp_path)
    assert "CASE7" in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_a_truncated_channel_is_noticed(tmp_path: Path) -> None:
    mme = written(tmp_path)
    edit(channel_file(mme), lambda text: text[: len(text) // 2])
    with pytest.raises(UserError, match=r"CASE7\.001"):
        load_measured(tmp_path)


def test_missing_parts_are_named(tmp_path: Path) -> None:
    mme = written(tmp_path)
    channel_file(mme).unlink()
    with pytest.raises(UserError, match="holds no channels of CASE7"):
        load_measured(tmp_path)
    (mme.parent / "Channel" / "CASE7.chn").unlink()
    (mme.parent / "Channel").rmdir()
    with pytest.raises(UserError, match="has no folder 'Channel'"):
        load_measured(tmp_path)


@QUIET
@given(st.integers(0, 400), st.integers(0, 30), st.text(":. \nE+-09Nabc", max_size=6))
def test_mutilated_channels_are_read_or_are_user_errors(
    tmp_path: Path, start: int, length: int, insert: str
) -> None:
    path = channel_file(written(tmp_path))
    text = path.read_text()
    path.write_text(text[:start] + insert + text[start + length :])
    try:
        data = load_measured(tmp_path)
    except UserError as error:
        assert len(str(error).splitlines()) == 1
        return
    assert np.all(np.isfinite(data.signals["CASE7"]["head_acceleration"]))
