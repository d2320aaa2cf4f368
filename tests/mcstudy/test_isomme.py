"""ISO-MME folders: written and read back, and which channels are the head acceleration, when."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcstudy_tools import Array, quiet
from numpy.testing import assert_allclose

from mcstudy.errors import UserError
from mcstudy.measurement.isomme import (
    HeadSignal,
    find_tests,
    head_acceleration,
    read_test,
    write_test,
)
from mcstudy.measurement.measured_data import load_measured

RESULTANT = "D0HEADCG00PCACRA"
AXES = tuple(f"D0HEADCG00PCAC{axis}A" for axis in "XYZ")
PULSE = np.concatenate([np.zeros(20), 100.0 * np.sin(np.linspace(0.0, math.pi, 80))])
OTHER = 0.5 * PULSE
GIVEN = {"start": -0.002, "interval": 1e-4, "velocity": 8.333333333, "mass": 2.5}


def written(
    folder: Path, values: Array = PULSE, unit: str = "g", name: str = "CASE7", code: str = RESULTANT
) -> Path:
    return write_test(folder / name, name, {code: (values, unit)}, title="A drop", **GIVEN)


def edit(path: Path, change: Callable[[str], str]) -> None:
    old = path.read_text(encoding="utf-8")
    new = change(old)
    assert new != old
    path.write_text(new, encoding="utf-8")


def channel_file(mme: Path, number: int = 1) -> Path:
    return mme.parent / "Channel" / f"{mme.stem}.{number:03d}"


def test_files_are_those_of_the_standard(tmp_path: Path) -> None:
    # Folder, index and one file a channel; names padded to 28 columns (injury.md section 4).
    codes = {AXES[0]: (PULSE, "m/(s*s)"), AXES[1]: (PULSE, "g")}
    mme = write_test(tmp_path / "CASE7", "CASE7", codes, title="Time: 12:30", **GIVEN)
    names = {str(path.relative_to(mme.parent)) for path in tmp_path.rglob("*") if path.is_file()}
    channels = {f"Channel/CASE7.{end}" for end in ("chn", "001", "002")}
    assert names == {"CASE7.mme", *channels}
    lines = channel_file(mme).read_text().splitlines()
    header = [line for line in lines if ":" in line]
    assert all(line[28] == ":" for line in header)
    assert {
        "Reference channel           :implicit", f"Channel code                :{AXES[0]}",
        "Unit                        :m/(s*s)", "Number of samples           :100",
    } <= set(header)  # fmt: skip
    assert lines[len(header) :] == [f"{v:.6E}" for v in PULSE]
    index = (mme.parent / "Channel" / "CASE7.chn").read_text()
    assert "Number of channels          :2" in index
    assert f"Name of channel 002         :{AXES[1]}" in index
    assert "Title                       :Time: 12:30" in mme.read_text()


def test_written_and_read_back(tmp_path: Path) -> None:
    values = PULSE.copy()
    values[[3, 50]] = math.nan
    codes = {RESULTANT: (values, "g"), "D0HEADCG00PCAVY0": (2.0 * PULSE, "rad/s")}
    test = read_test(write_test(tmp_path / "A", "A1", codes, title="Hood: B", **GIVEN))
    assert (test.name, test.title, test.mass) == ("A1", "Hood: B", 2.5)
    assert test.velocity == pytest.approx(8.333333333, rel=1e-9)
    first, second = test.channels
    assert (first.code, first.unit, first.filter) == (RESULTANT, "g", "CFC1000")
    assert (second.code, second.unit, second.filter) == ("D0HEADCG00PCAVY0", "rad/s", "none")
    assert_allclose(first.time, -0.002 + 1e-4 * np.arange(100), atol=1e-15)
    assert_allclose(first.values, values, rtol=1e-6)
    assert_allclose(second.values, 2.0 * PULSE, rtol=1e-6)
    # A missing title stays missing.
    mme = write_test(tmp_path / "T", "T", codes, **GIVEN)
    assert read_test(mme).title == ""


@quiet(40)
@given(
    values=st.lists(st.floats(-1e30, 1e30, allow_subnormal=False), min_size=2, max_size=40),
    start=st.floats(-10.0, 10.0),
    interval=st.floats(1e-6, 1.0),
)
def test_numbers_come_back(
    tmp_path: Path, values: list[float], start: float, interval: float
) -> None:
    codes = {RESULTANT: (np.array(values), "g")}
    test = read_test(write_test(tmp_path / "T", "T", codes, start=start, interval=interval))
    assert_allclose(test.channels[0].values, values, rtol=5.1e-7)
    expected = start + interval * np.arange(len(values))
    assert_allclose(test.channels[0].time, expected, rtol=1e-8, atol=1e-8 * abs(start))
    assert math.isnan(test.velocity) and math.isnan(test.mass)


@pytest.mark.parametrize(
    "code", ["", "SHORT", RESULTANT + "A", "D0headCG00PCACRA", "D0HEAD:G00PCACRA"]
)
def test_codes_have_sixteen_characters(tmp_path: Path, code: str) -> None:
    with pytest.raises(ValueError, match="16"):
        written(tmp_path, code=code)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("unit", "size"), [
    ("g", 1.0), ("m/s2", 9.80665), ("m/(s*s)", 9.80665), ("m/s^2", 9.80665), ("m/s²", 9.80665),
])  # fmt: skip
def test_accelerations_are_in_g_and_a_resultant_alone_keeps_its_sign(
    tmp_path: Path, unit: str, size: float
) -> None:
    mme = written(tmp_path, size * (PULSE - 0.4), unit)
    if unit == "m/s²":
        path = channel_file(mme)
        path.write_bytes(path.read_text(encoding="utf-8").encode("latin-1"))
    found = head_acceleration(read_test(mme)).channel
    assert (found.unit, found.code) == ("g", RESULTANT)
    assert_allclose(found.values, PULSE - 0.4, rtol=1e-6)


def test_resultant_of_three_axes_in_mixed_units_without_missing_samples(tmp_path: Path) -> None:
    x, y, z = PULSE, -0.5 * PULSE, np.linspace(-3.0, 3.0, PULSE.size)
    y[:5] = y[90:] = math.nan
    codes = {AXES[0]: (x, "g"), AXES[1]: (9.80665 * y, "m/s2"), AXES[2]: (z, "g"),
             "D0HEADCG00PCAVXA": (x, "rad/s"), "D0CHST0000PCACRA": (x, "g")}  # fmt: skip
    mme = write_test(tmp_path / "T", "T", codes, **GIVEN)
    assert "NOVALUE" in channel_file(mme, 2).read_text()
    found = head_acceleration(read_test(mme)).channel
    assert found.code == RESULTANT
    assert_allclose(found.time, -0.002 + 1e-4 * np.arange(5, 90), atol=1e-12)
    assert_allclose(found.values, np.sqrt(x**2 + y**2 + z**2)[5:90], rtol=2e-6)


@pytest.mark.parametrize("codes", [AXES[:2], ("D0HEADCG00PCAVRA",), ("D0CHST0000PCACRA",)])
def test_tests_without_head_acceleration(tmp_path: Path, codes: tuple[str, ...]) -> None:
    test = read_test(write_test(tmp_path / "T", "T7", dict.fromkeys(codes, (PULSE, "g")), **GIVEN))
    with pytest.raises(UserError, match=r"T7\.mme: .*no head acceleration"):
        head_acceleration(test)


def test_axes_on_other_times_or_filtered_differently_are_refused(tmp_path: Path) -> None:
    mme = write_test(tmp_path / "T", "T", dict.fromkeys(AXES, (PULSE, "g")), **GIVEN)
    edit(channel_file(mme, 3), lambda text: text.replace(":-0.002", ":-0.001"))
    with pytest.raises(UserError, match="differ in time"):
        head_acceleration(read_test(mme))
    codes = {code[:15] + letter: (PULSE, "g") for code, letter in zip(AXES, "A0D", strict=True)}
    with pytest.raises(UserError, match="filter"):
        head_acceleration(read_test(write_test(tmp_path / "U", "U", codes, **GIVEN)))


@pytest.mark.parametrize("missing", ["velocity", "mass"])
def test_speed_and_mass_must_be_given(tmp_path: Path, missing: str) -> None:
    values = {key: value for key, value in GIVEN.items() if key != missing}
    mme = write_test(tmp_path / "T", "T", {RESULTANT: (PULSE, "g")}, **values)
    assert math.isnan(getattr(read_test(mme), missing))
    with pytest.raises(UserError, match="'Velocity test object 1' and 'Mass test object 1'"):
        load_measured(tmp_path)


@pytest.mark.parametrize(("text", "value"), [
    ("+8.25", 8.25), ("-8.25", -8.25), ("8.25 m/s", 8.25), (".5", 0.5), ("8.25E+00", 8.25),
    ("1e1", 10.0), ("NOVALUE", math.nan), ("", math.nan), ("30 km/h", 30.0 / 3.6),
    *((bad, None) for bad in ("fast", "8,25", "30 knots", "12 kg")),
])  # fmt: skip
def test_speed_as_laboratories_write_it(tmp_path: Path, text: str, value: float | None) -> None:
    mme = written(tmp_path)
    edit(mme, lambda old: old.replace(":8.33333333", f":{text}"))
    if value is None:
        with pytest.raises(UserError, match="not a number in m/s"):
            _ = read_test(mme).velocity
    else:
        assert read_test(mme).velocity == pytest.approx(value, nan_ok=True)


def test_several_tests_in_subfolders_are_one_set(tmp_path: Path) -> None:
    for k, name in enumerate(("B2", "A1", "C3")):
        write_test(
            tmp_path / name, name, {RESULTANT: ((k + 1.0) * PULSE, "g")}, title=f"Test {name}",
            start=-0.002 * k, interval=1e-4, velocity=8.0 + k, mass=2.5 + k,
        )  # fmt: skip
    assert [path.stem for path in find_tests(tmp_path)] == ["A1", "B2", "C3"]
    data = load_measured(tmp_path)
    assert list(data.tests["test"]) == ["A1", "B2", "C3"]
    assert (data.header.model, data.header.title) == ("headform", "Test A1")
    assert data.input_value("impact_speed", 0, "m/s") == (9.0, 0.0)
    assert data.input_value("headform_mass", 2, "kg") == (4.5, 0.0)
    time, values = data.signal("B2", "head_acceleration", "g")
    assert time[0] == 0.0
    assert_allclose(values, PULSE, rtol=1e-6)


def test_a_test_folder_itself_and_capital_letters(tmp_path: Path) -> None:
    mme = written(tmp_path)
    (mme.parent / "Channel").rename(mme.parent / "CHANNEL")
    mme.rename(mme.with_suffix(".MME"))
    assert list(load_measured(mme.parent).tests["test"]) == ["CASE7"]


def test_tests_filtered_differently_or_named_alike_are_refused(tmp_path: Path) -> None:
    written(tmp_path / "one")
    written(tmp_path / "one", name="B", code=RESULTANT[:15] + "C")
    with pytest.raises(UserError, match="filtered differently"):
        load_measured(tmp_path / "one")
    for folder in "AB":
        write_test(tmp_path / "two" / folder, "SAME", {RESULTANT: (PULSE, "g")}, **GIVEN)
    with pytest.raises(UserError, match="same name"):
        load_measured(tmp_path / "two")


DAMAGE: dict[str, Callable[[str], str]] = {
    "empty": lambda text: "",
    "header only": lambda text: "".join(
        line for line in text.splitlines(keepends=True) if ":" in line),
    "half": lambda text: text[: len(text) // 2],
    "short code": lambda text: text.replace(f":{RESULTANT}", ":HEAD"),
    "no interval": lambda text: text.replace("Sampling interval", "Interval"),
    "interval 0": lambda text: text.replace(":0.0001", ":0"),
    "interval missing": lambda text: text.replace(":0.0001", ":NOVALUE"),
    "no start": lambda text: text.replace("Time of first sample", "Start"),
    "text in samples": lambda text: text.replace("\n0.000000E+00\n", "\nzero\n", 1),
    "two columns": lambda text: text.replace("\n0.000000E+00\n", "\n0.0 1.0\n", 1),
    "unit of a mass": lambda text: text.replace(":g\n", ":kg\n"),
    "unit unknown": lambda text: text.replace(":g\n", ":furlong\n"),
    "header cut": lambda text: text[: text.index("Sampling interval")],
}  # fmt: skip


@pytest.mark.parametrize("name", DAMAGE)
def test_damaged_channels_are_told_in_one_line(tmp_path: Path, name: str) -> None:
    edit(channel_file(written(tmp_path)), DAMAGE[name])
    with pytest.raises(UserError, match="CASE7") as caught:
        load_measured(tmp_path)
    assert len(str(caught.value).splitlines()) == 1


def test_missing_parts_are_named(tmp_path: Path) -> None:
    mme = written(tmp_path)
    channel_file(mme).unlink()
    with pytest.raises(UserError, match="holds no channels of CASE7"):
        load_measured(tmp_path)
    (mme.parent / "Channel" / "CASE7.chn").unlink()
    (mme.parent / "Channel").rmdir()
    with pytest.raises(UserError, match="has no folder 'Channel'"):
        load_measured(tmp_path)


@quiet(40)
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


IMPLICIT = {"Reference channel": "implicit", "Sampling interval": "0.0001",
            "Time of first sample": "-0.002"}  # fmt: skip
HEAD = "10HEADCG0000ACRA"
TIMES = "11TIRS000000TI00"


class Folder:
    """A test folder that is written channel by channel."""

    def __init__(self, base: Path) -> None:
        self.base, self.count = base / "T1", 0
        (self.base / "Channel").mkdir(parents=True)
        self.mme("Velocity test object 1  :9.7", "Mass test object 1  :3.5")

    def mme(self, *lines: str) -> None:
        (self.base / "T1.mme").write_text("\n".join(["Title :A drop", *lines]))

    def add(self, code: str | None, values: Array | list[str] = PULSE, **header: str) -> "Folder":
        """Add a channel; ``unit="g"`` is header 'Unit', ``data_status`` is 'Data status'."""
        self.count += 1
        named = {key.capitalize().replace("_", " "): value for key, value in header.items()}
        whole = ({} if code is None else {"Channel code": code}) | {"Unit": "g"} | IMPLICIT | named
        samples = [v if isinstance(v, str) else f"{v:.6E}" for v in values]
        lines = [f"{key:<28}:{value}" for key, value in whole.items() if value != "-"]
        path = self.base / "Channel" / f"T1.{self.count:03d}"
        path.write_text("\n".join([*lines, *samples, ""]))
        return self

    def triple(self, code: str, values: Array = PULSE, **header: str) -> "Folder":
        """Add x, y and z: the signal in x."""
        for axis, size in (("X", 1.0), ("Y", 0.0), ("Z", 0.0)):
            self.add(code.replace("?", axis), size * values, **header)
        return self

    def head(self, *wanted: str) -> HeadSignal:
        return head_acceleration(read_test(self.base / "T1.mme"), wanted)

    def refuses(self, message: str, *wanted: str) -> str:
        with pytest.raises(UserError, match=message) as caught:
            self.head(*wanted)
        return str(caught.value)


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    return Folder(tmp_path)


def check(found: HeadSignal, values: Array = PULSE, note: str = "") -> None:
    assert_allclose(found.channel.values, values, atol=1e-4)
    assert any(note in told for told in found.notes) or not note


@pytest.mark.parametrize("order", [1, -1])
def test_two_heads_are_listed_and_the_option_chooses(folder: Folder, order: int) -> None:
    heads = [("11HEADCG00H3AC?A", PULSE), ("13HEADCG00H3AC?A", OTHER)]
    for code, values in heads[::order]:
        folder.triple(code, values)
    message = folder.refuses(r"has 2 head accelerations: .*11HEADCG00H3AC.A")
    assert "13HEADCG00H3AC?A" in message and "--channel" in message
    for code, values in heads:
        check(folder.head(code), values)
    check(folder.head("13*"), OTHER)
    folder.refuses(r"no head acceleration is '12\*'.*11HEADCG00H3AC", "12*")


def test_a_redundant_sensor_is_a_second_candidate(folder: Folder) -> None:
    folder.triple("11HEADCG00H3AC?A").triple("11HEADRD00H3AC?A", OTHER)
    folder.refuses("has 2 head accelerations")
    check(folder.head("11HEADRD*"), OTHER)


def test_channels_that_stand_twice_are_chosen_by_their_files(folder: Folder) -> None:
    folder.add(HEAD).add(HEAD, OTHER)
    folder.refuses(r"--channel 'T1.001'")
    check(folder.head("T1.002"), OTHER)


def test_axes_of_two_sensors_are_no_triple(folder: Folder) -> None:
    folder.add("11HEADCG00H3ACXA").add("11HEADCG00H3ACYA").add("11HEADRD00H3ACZA")
    folder.refuses("has no head acceleration")


@pytest.mark.parametrize("status", ["channel failed", "Channel Failed", "meaningless data",
                                    "no data", "questionable data", "system failed"])  # fmt: skip
@pytest.mark.parametrize("first", [True, False])
def test_a_failed_channel_is_left_for_a_good_one(folder: Folder, status: str, first: bool) -> None:
    channels = [("10HEADCG00RDACRA", OTHER, status), (HEAD, PULSE, "ok")]
    for code, values, told in channels if first else channels[::-1]:
        folder.add(code, values, data_status=told)
    found = folder.head()
    check(found)
    assert any("10HEADCG00RDACRA" in note and status.lower() in note for note in found.notes)


def test_a_test_whose_only_head_failed_is_refused_and_may_be_forced(folder: Folder) -> None:
    folder.triple("10HEADCG0000AC?A", data_status="channel failed")
    folder.refuses(r"channel failed.*--channel")
    check(folder.head("10HEADCG0000AC?A"), note="has data status 'channel failed'")


def test_a_resultant_of_a_failed_axis_failed_as_well(folder: Folder) -> None:
    folder.triple("10HEADCG0000AC?A").add(HEAD, OTHER)
    path = folder.base / "Channel" / "T1.002"
    path.write_text("Data status :channel failed\n" + path.read_text())
    folder.refuses("has no head acceleration")


@pytest.mark.parametrize("status", ["ok", "OK", "", "NOVALUE", "linearised data"])
def test_sound_words_of_the_data_status(folder: Folder, status: str) -> None:
    check(folder.add(HEAD, data_status=status).head())


def test_axes_come_before_the_resultant_that_is_made_of_them(folder: Folder) -> None:
    folder.add(HEAD, OTHER).triple("10HEADCG0000AC?A")
    check(folder.head(), note=f"not used: {HEAD}")


@pytest.mark.parametrize(("raw", "twins"), [("0", "ABCD"), ("P", "AD"), ("A", "BCD"), ("B", "DC")])
def test_the_least_filtered_twin_is_taken(folder: Folder, raw: str, twins: str) -> None:
    for letter in twins:
        folder.triple(f"10HEADCG0000AC?{letter}", OTHER)
    found = folder.triple(f"10HEADCG0000AC?{raw}").head()
    check(found)
    assert found.channel.code.endswith(raw)


def test_channels_that_are_computed_or_not_wanted_do_not_matter(folder: Folder) -> None:
    folder.add("10HEAD003CH3ACRA", OTHER).add("10HEADCM0000ACRA", OTHER, data_source="calculation")
    folder.add("11HICR0015H3ACRX", ["1684"], sampling_interval="-")
    folder.add(TIMES, PULSE, unit="s", sampling_interval="-")
    folder.add("not mapped").add(None, ["text"]).add("10CHST0000H3ACXA", ["rubbish", "here"])
    folder.add("11HEAD003CH3ACRA", ["88.2"])
    check(folder.add(HEAD, data_source="transducer").head())


def test_the_index_names_a_channel_without_a_code(folder: Folder) -> None:
    index = folder.add(None).base / "Channel" / "T1.chn"
    index.write_text(f"Name of channel 001 :{HEAD} / Head resultant\n")
    check(folder.head())


@pytest.mark.parametrize(("letter", "stated", "name"), [
    ("A", "-", "CFC1000"), ("X", "180", "CFC180"), ("P", "CFC 60", "CFC60"), ("0", "1000", "none"),
    ("X", "-", "none"), ("D", "1000", "CFC60"), ("B", "-", "CFC600"), ("C", "-", "CFC180"),
])  # fmt: skip
def test_the_filter_is_that_of_the_code_else_of_the_header(
    folder: Folder, letter: str, stated: str, name: str
) -> None:
    found = folder.add(f"10HEADCG0000ACR{letter}", channel_frequency_class=stated).head()
    assert found.channel.filter == name
    assert load_measured(folder.base).header.signals["head_acceleration"].filter == name
    told = any("its header CFC1000" in note for note in found.notes)
    assert told == (letter == "D")


def test_what_was_taken_stands_in_the_notes(folder: Folder) -> None:
    folder.triple("10HEADCG0000AC?A").add("10CHST0000H3ACRA")
    (note,) = load_measured(folder.base).notes["T1"]
    assert note == "head acceleration is 10HEADCG0000AC?A (T1.001, T1.002, T1.003), CFC1000"


def test_speed_and_mass_are_those_of_the_channels_test_object(folder: Folder) -> None:
    folder.mme("Velocity test object 1 :0", "Mass test object 1 :1200 KG",
               "Velocity test object 2 :34.92 Km/h", "Mass test object 2 :3.5 Kg")  # fmt: skip
    data = load_measured(folder.add("20HEADCG0000ACRA").base)
    assert data.input_value("impact_speed", 0, "m/s") == pytest.approx((9.7, 0.0))
    assert data.input_value("headform_mass", 0, "kg") == pytest.approx((3.5, 0.0))


def test_an_explicit_reference_channel_wins_over_the_nominal_interval(folder: Folder) -> None:
    times = 0.5 + 2e-4 * np.arange(PULSE.size)
    folder.add(HEAD, reference_channel="explicit", reference_channel_name=TIMES)
    found = folder.add(TIMES, times, unit="s", sampling_interval="-").head()
    assert_allclose(found.channel.time, times, rtol=1e-6)
    check(found, note="not its sampling interval of 0.0001 s")
    other = Folder(folder.base.parent / "in ms")
    other.add(HEAD, reference_channel="explicit", sampling_interval="-")
    other.add(TIMES, 0.1 * np.arange(PULSE.size), unit="ms")
    assert_allclose(other.head().channel.time, 1e-4 * np.arange(100), atol=1e-9)


def test_a_channel_of_times_that_differs_from_the_interval_is_told(folder: Folder) -> None:
    found = folder.add(HEAD).add(TIMES, 2e-4 * np.arange(PULSE.size), unit="s").head()
    assert_allclose(np.diff(found.channel.time), 1e-4)
    check(found, note="T1.002 differs")


@pytest.mark.parametrize(("header", "message"), [
    ({"reference_channel": "explicit", "reference_channel_name": "TIME 1"},
     r"T1\.001: its times stand in a reference channel 'TIME"),
    ({"sampling_interval": "-"}, r"T1\.001: 'Sampling interval'"),
    ({"sampling_interval": "NOVALUE"}, r"T1\.001: 'Sampling interval'"),
])  # fmt: skip
def test_without_interval_and_reference_there_are_no_times(
    folder: Folder, header: dict[str, str], message: str
) -> None:
    folder.add(HEAD, **header).refuses(message)


def test_values_that_are_none_are_told_at_the_ends_and_refused_inside(folder: Folder) -> None:
    values = [f"{v:.3f}" for v in PULSE]
    found = folder.add(HEAD, ["NOVALUE", "-inf", *values, "inf", "INF", "nan"]).head()
    assert found.channel.values.size == PULSE.size
    assert any("5 samples without a value" in note for note in found.notes)
    inside = Folder(folder.base.parent / "b").add(HEAD, [*values[:50], "inf", *values[50:]])
    inside.refuses(r"no value 3.000 ms, in the middle")


@pytest.mark.parametrize(("sample", "hint"), [("1,5", "decimal comma"), ("1_0", ""), ("ok", "")])
def test_a_sample_that_is_no_number_has_a_line(folder: Folder, sample: str, hint: str) -> None:
    folder.add(HEAD, [*(["0.0"] * 10), sample])
    folder.refuses(rf"T1\.001: line 16: '{sample}' is no number.*{hint}")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
@pytest.mark.parametrize("comment", ["checked \N{HORIZONTAL ELLIPSIS} ok", "Prüfstand", "a\x0cb"])
def test_channel_files_of_any_editor(folder: Folder, encoding: str, comment: str) -> None:
    folder.add(HEAD, comments=comment)
    for path in (folder.base / "Channel" / "T1.001", folder.base / "T1.mme"):
        path.write_bytes(path.read_text().replace("\n", "\r\n").encode(encoding))
    check(folder.head())
