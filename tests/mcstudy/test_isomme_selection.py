"""Which ISO-MME channels are the head acceleration, and when they were sampled."""

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from mcstudy.errors import UserError
from mcstudy.measurement.isomme import HeadSignal, head_acceleration, read_test
from mcstudy.measurement.measured_data import load_measured

Array = NDArray[np.float64]

PULSE = np.concatenate([np.zeros(20), 100.0 * np.sin(np.linspace(0.0, math.pi, 80))])
OTHER = 0.5 * PULSE
IMPLICIT = {"Reference channel": "implicit", "Sampling interval": "0.0001",
            "Time of first sample": "-0.002"}  # fmt: skip


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


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    return Folder(tmp_path)


def assert_is(found: HeadSignal, values: Array) -> None:
    np.testing.assert_allclose(found.channel.values, values, atol=1e-4)


# -- one head, one sensor ---------------------------------------------------------------------


@pytest.mark.parametrize("order", [1, -1])
def test_two_heads_are_listed_and_the_option_chooses(folder: Folder, order: int) -> None:
    heads = [("11HEADCG00H3AC?A", PULSE), ("13HEADCG00H3AC?A", OTHER)]
    for code, values in heads[::order]:
        folder.triple(code, values)
    with pytest.raises(UserError, match=r"has 2 head accelerations: .*11HEADCG00H3AC.A") as caught:
        folder.head()
    assert "13HEADCG00H3AC?A" in str(caught.value)
    assert "--channel" in str(caught.value)
    for code, values in heads:
        assert_is(folder.head(code), values)
    assert_is(folder.head("13*"), OTHER)


def test_a_redundant_sensor_is_a_second_candidate(folder: Folder) -> None:
    folder.triple("11HEADCG00H3AC?A").triple("11HEADRD00H3AC?A", OTHER)
    with pytest.raises(UserError, match="has 2 head accelerations"):
        folder.head()
    assert_is(folder.head("11HEADRD*"), OTHER)


def test_channels_that_stand_twice_are_chosen_by_their_files(folder: Folder) -> None:
    folder.add("11HEADCG00H3ACRA").add("11HEADCG00H3ACRA", OTHER)
    with pytest.raises(UserError, match=r"--channel 'T1.001'"):
        folder.head()
    assert_is(folder.head("T1.002"), OTHER)


def test_axes_of_two_sensors_are_no_triple(folder: Folder) -> None:
    folder.add("11HEADCG00H3ACXA").add("11HEADCG00H3ACYA").add("11HEADRD00H3ACZA")
    with pytest.raises(UserError, match="has no head acceleration"):
        folder.head()


def test_an_unknown_choice_lists_what_there_is(folder: Folder) -> None:
    folder.add("11HEADCG00H3ACRA")
    with pytest.raises(UserError, match=r"no head acceleration is '12\*'.*11HEADCG00H3ACRA"):
        folder.head("12*")


# -- data status ------------------------------------------------------------------------------


@pytest.mark.parametrize("status", ["channel failed", "Channel Failed", "meaningless data",
                                    "no data", "questionable data", "system failed"])  # fmt: skip
@pytest.mark.parametrize("first", [True, False])
def test_a_failed_channel_is_left_for_a_good_one(folder: Folder, status: str, first: bool) -> None:
    if first:
        folder.add("10HEADCG00RDACRA", OTHER, data_status=status)
    folder.add("10HEADCG0000ACRA", PULSE, data_status="ok")
    if not first:
        folder.add("10HEADCG00RDACRA", OTHER, data_status=status)
    found = folder.head()
    assert_is(found, PULSE)
    assert any("10HEADCG00RDACRA" in note and status.lower() in note for note in found.notes)


def test_a_test_whose_only_head_failed_is_refused_and_may_be_forced(folder: Folder) -> None:
    folder.triple("10HEADCG0000AC?A", data_status="channel failed")
    with pytest.raises(UserError, match=r"channel failed.*--channel"):
        folder.head()
    found = folder.head("10HEADCG0000AC?A")
    assert_is(found, PULSE)
    assert any("has data status 'channel failed'" in note for note in found.notes)


def test_a_resultant_of_a_failed_axis_failed_as_well(folder: Folder) -> None:
    folder.triple("10HEADCG0000AC?A").add("10HEADCG0000ACRA", OTHER)
    text = (folder.base / "Channel" / "T1.002").read_text()
    (folder.base / "Channel" / "T1.002").write_text("Data status :channel failed\n" + text)
    with pytest.raises(UserError, match="has no head acceleration"):
        folder.head()


@pytest.mark.parametrize("status", ["ok", "OK", "", "NOVALUE", "linearised data"])
def test_sound_words_of_the_data_status(folder: Folder, status: str) -> None:
    assert_is(folder.add("10HEADCG0000ACRA", data_status=status).head(), PULSE)


# -- what was computed ------------------------------------------------------------------------


def test_axes_come_before_the_resultant_that_is_made_of_them(folder: Folder) -> None:
    folder.add("10HEADCG0000ACRA", OTHER).triple("10HEADCG0000AC?A")
    found = folder.head()
    assert_is(found, PULSE)
    assert any("not used: 10HEADCG0000ACRA" in note for note in found.notes)


@pytest.mark.parametrize(("raw", "twins"), [("0", "ABCD"), ("P", "AD"), ("A", "BCD"), ("B", "DC")])
def test_the_least_filtered_twin_is_taken(folder: Folder, raw: str, twins: str) -> None:
    for letter in twins:
        folder.triple(f"10HEADCG0000AC?{letter}", OTHER)
    folder.triple(f"10HEADCG0000AC?{raw}")
    found = folder.head()
    assert_is(found, PULSE)
    assert found.channel.code.endswith(raw)


def test_a_level_held_for_3_ms_and_a_calculation_are_no_sensors(folder: Folder) -> None:
    folder.add("10HEAD003CH3ACRA", OTHER)
    folder.add("10HEADCG0000ACRA", PULSE, data_source="transducer")
    folder.add("10HEADCM0000ACRA", OTHER, data_source="calculation")
    assert_is(folder.head(), PULSE)


# -- channels that nobody needs ---------------------------------------------------------------


def test_odd_channels_that_are_not_wanted_do_not_matter(folder: Folder) -> None:
    folder.add("11HICR0015H3ACRX", ["1684"], sampling_interval="-")
    folder.add("11TIRS000000TI00", PULSE, unit="s", sampling_interval="-")
    folder.add("not mapped", PULSE)
    folder.add(None, ["text"])
    folder.add("10CHST0000H3ACXA", ["rubbish", "here"])
    folder.add("11HEAD003CH3ACRA", ["88.2"])
    assert_is(folder.add("10HEADCG0000ACRA").head(), PULSE)


def test_the_index_names_a_channel_without_a_code(folder: Folder) -> None:
    folder.add(None)
    index = folder.base / "Channel" / "T1.chn"
    index.write_text("Name of channel 001 :10HEADCG0000ACRA / Head resultant\n")
    assert_is(folder.head(), PULSE)


# -- times ------------------------------------------------------------------------------------


def test_an_explicit_reference_channel_wins_over_the_nominal_interval(folder: Folder) -> None:
    times = 0.5 + 2e-4 * np.arange(PULSE.size)
    folder.add("10HEADCG0000ACRA", reference_channel="explicit",
               reference_channel_name="11TIRS000000TI00")  # fmt: skip
    folder.add("11TIRS000000TI00", times, unit="s", sampling_interval="-")
    found = folder.head()
    np.testing.assert_allclose(found.channel.time, times, rtol=1e-6)
    assert any("not its sampling interval of 0.0001 s" in note for note in found.notes)


def test_times_in_milliseconds(folder: Folder) -> None:
    folder.add("10HEADCG0000ACRA", reference_channel="explicit", sampling_interval="-")
    folder.add("11TIRS000000TI00", 0.1 * np.arange(PULSE.size), unit="ms")
    np.testing.assert_allclose(folder.head().channel.time, 1e-4 * np.arange(100), atol=1e-9)


def test_an_explicit_reference_that_is_missing_is_refused(folder: Folder) -> None:
    folder.add("10HEADCG0000ACRA", reference_channel="explicit", reference_channel_name="TIME 1")
    with pytest.raises(UserError, match=r"T1\.001: its times stand in a reference channel 'TIME"):
        folder.head()


def test_a_channel_of_times_that_differs_from_the_interval_is_told(folder: Folder) -> None:
    folder.add("10HEADCG0000ACRA")
    folder.add("11TIRS000000TI00", 2e-4 * np.arange(PULSE.size), unit="s")
    found = folder.head()
    np.testing.assert_allclose(np.diff(found.channel.time), 1e-4)
    assert any("T1.002 differs" in note for note in found.notes)


@pytest.mark.parametrize("start", ["-", "NOVALUE"])
def test_without_interval_and_reference_there_are_no_times(folder: Folder, start: str) -> None:
    folder.add("10HEADCG0000ACRA", sampling_interval=start)
    with pytest.raises(UserError, match=r"T1\.001: 'Sampling interval'"):
        folder.head()


# -- samples and text -------------------------------------------------------------------------


def test_values_that_are_none_are_told_at_the_ends_and_refused_inside(folder: Folder) -> None:
    values = [f"{v:.3f}" for v in PULSE]
    folder.add("10HEADCG0000ACRA", ["NOVALUE", "-inf", *values, "inf", "INF", "nan"])
    found = folder.head()
    assert found.channel.values.size == PULSE.size
    assert any("5 samples without a value" in note for note in found.notes)
    inside = Folder(folder.base.parent / "b")
    inside.add("10HEADCG0000ACRA", [*values[:50], "inf", *values[50:]])
    with pytest.raises(UserError, match=r"no value 3.000 ms, in the middle"):
        inside.head()


@pytest.mark.parametrize(("sample", "hint"), [("1,5", "decimal comma"), ("1_0", ""), ("ok", "")])
def test_a_sample_that_is_no_number_is_told_with_its_line(
    folder: Folder, sample: str, hint: str
) -> None:
    folder.add("10HEADCG0000ACRA", [*(["0.0"] * 10), sample])
    with pytest.raises(UserError, match=rf"T1\.001: line 16: '{sample}' is no number.*{hint}"):
        folder.head()


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
@pytest.mark.parametrize("comment", ["checked \N{HORIZONTAL ELLIPSIS} ok", "Prüfstand", "a\x0cb"])
def test_channel_files_of_any_editor(folder: Folder, encoding: str, comment: str) -> None:
    folder.add("10HEADCG0000ACRA", comments=comment)
    for path in (folder.base / "Channel" / "T1.001", folder.base / "T1.mme"):
        path.write_bytes(path.read_text().replace("\n", "\r\n").encode(encoding))
    assert_is(folder.head(), PULSE)


# -- speed and mass ---------------------------------------------------------------------------


def test_speed_and_mass_are_those_of_the_channels_test_object(folder: Folder) -> None:
    folder.mme("Velocity test object 1 :0", "Mass test object 1 :1200 KG",
               "Velocity test object 2 :34.92 Km/h", "Mass test object 2 :3.5 Kg")  # fmt: skip
    folder.add("20HEADCG0000ACRA")
    data = load_measured(folder.base)
    assert data.input_value("impact_speed", 0, "m/s") == pytest.approx((9.7, 0.0))
    assert data.input_value("headform_mass", 0, "kg") == pytest.approx((3.5, 0.0))


def test_what_was_taken_stands_in_the_notes(folder: Folder) -> None:
    folder.triple("10HEADCG0000AC?A").add("10CHST0000H3ACRA")
    (note,) = load_measured(folder.base).notes["T1"]
    assert note == "head acceleration is 10HEADCG0000AC?A (T1.001, T1.002, T1.003), CFC1000"


@pytest.mark.parametrize(("letter", "stated", "name"), [
    ("A", "-", "CFC1000"), ("X", "180", "CFC180"), ("P", "CFC 60", "CFC60"), ("0", "1000", "none"),
    ("X", "-", "none"), ("D", "1000", "CFC60"),
])  # fmt: skip
def test_the_filter_is_that_of_the_code_else_of_the_header(
    folder: Folder, letter: str, stated: str, name: str
) -> None:
    folder.add(f"10HEADCG0000ACR{letter}", channel_frequency_class=stated)
    found = folder.head()
    assert found.channel.filter == name
    told = any("its header CFC1000" in note for note in found.notes)
    assert told == (letter == "D")
