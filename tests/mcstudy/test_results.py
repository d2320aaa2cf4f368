"""The results folder: what is written is read back, nothing half-written is believed."""

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from mcstudy_tools import generator

from mcstudy.errors import StudyError, UserError
from mcstudy.execution.results import ResultsFolder, check_failures, digest, to_json

ROOT = Path(__file__).parents[2]


def table(n: int = 12) -> pd.DataFrame:
    rng = generator(0)
    frame = pd.DataFrame({
        "run": np.arange(n), "replicate": np.arange(n) // 4, "impact_speed": rng.random(n),
        "hic15": rng.normal(1000.0, 300.0, n), "status": ["ok"] * n,
    })  # fmt: skip
    frame.loc[3, ["hic15", "status"]] = [np.nan, "no_head_contact"]
    return frame


RUNS = table()


def files(folder: ResultsFolder) -> set[str]:
    return {str(p.relative_to(folder.path)) for p in folder.path.rglob("*") if p.is_file()}


@pytest.fixture
def folder(tmp_path: Path) -> ResultsFolder:
    return ResultsFolder(tmp_path / "study")


def test_an_untouched_folder_is_not_created(folder: ResultsFolder) -> None:
    assert folder.done() is None
    assert not folder.path.exists()
    with pytest.raises(UserError, match="holds no runs"):
        folder.runs()
    folder.check_same_study({"seed": "1"})


def test_parts_and_the_compacted_table_read_back_to_the_last_bit(folder: ResultsFolder) -> None:
    with folder.open_for_writing():
        for start in (8, 0, 4):
            folder.add_part(RUNS.iloc[start : start + 4])
        pd.testing.assert_frame_equal(folder.runs(), RUNS, check_dtype=False)
        assert digest(folder.runs()) == digest(RUNS)
        folder.compact(folder.runs())
    pd.testing.assert_frame_equal(folder.runs(), RUNS, check_dtype=False)
    assert files(folder) == {".lock", "runs.parquet"}
    # A kill between writing the table and dropping the parts leaves both.
    folder.add_part(RUNS.iloc[4:8])
    assert digest(folder.runs()) == digest(RUNS)


def test_writing_leaves_no_temporary_files_and_replaces_the_old(folder: ResultsFolder) -> None:
    for content in ("old", "new, Fußgänger – 10 m/s²"):
        folder.write_text("a/study.toml", content)
        folder.write_json("manifest.json", {"content": content})
        folder.write_frame("runs.parquet", RUNS)
    assert (folder.path / "a/study.toml").read_text(encoding="utf-8") == content
    # A failed write keeps the old file.
    with pytest.raises(TypeError):
        folder.write_json("manifest.json", {"seed": object()})
    assert folder.read_json("manifest.json") == {"content": content}
    assert files(folder) == {"a/study.toml", "manifest.json", "runs.parquet"}


def test_histories_read_back_by_group(folder: ResultsFolder) -> None:
    head = pd.DataFrame({"time": [0.0, 0.001], "acceleration": [0.0, 12.5]})
    work = pd.DataFrame({"time": [0.0], "contact": [3.0]})
    folder.write_frame("histories/run-000007/head.parquet", head)
    folder.write_frame("histories/run-000007/work.parquet", work)
    found = folder.history(7)
    assert set(found) == {"head", "work"}
    pd.testing.assert_frame_equal(found["head"], head)
    pd.testing.assert_frame_equal(found["work"], work)
    with pytest.raises(UserError, match="no histories were kept for run 8"):
        folder.history(8)


@pytest.mark.parametrize("keep", [0.0, 0.5, 0.99])
def test_a_torn_part_is_set_aside_with_its_runs(folder: ResultsFolder, keep: float) -> None:
    for start in (0, 4, 8):
        folder.add_part(RUNS.iloc[start : start + 4])
    torn = sorted((folder.path / "parts").iterdir())[1]
    content = torn.read_bytes()
    torn.write_bytes(content[: int(keep * len(content))])
    rest = [0, 1, 2, 3, 8, 9, 10, 11]
    assert folder.runs()["run"].tolist() == rest
    assert torn.exists()
    with folder.open_for_writing():
        assert folder.runs()["run"].tolist() == rest
    assert not torn.exists() and torn.with_suffix(".broken").exists()
    folder.add_part(RUNS.iloc[4:8])
    assert digest(folder.runs()) == digest(RUNS)


def test_a_torn_table_is_set_aside_and_the_parts_still_count(folder: ResultsFolder) -> None:
    folder.add_part(RUNS.iloc[8:])
    (folder.path / "runs.parquet").write_bytes(b"PAR1 and then the power went")
    with folder.open_for_writing():
        assert folder.runs()["run"].tolist() == [8, 9, 10, 11]
    assert (folder.path / "runs.broken").exists()
    part = next((folder.path / "parts").iterdir())
    part.write_bytes(b"")
    with pytest.raises(UserError, match="holds no runs"):
        folder.runs()


def test_a_table_with_another_number_than_was_written_is_set_aside(folder: ResultsFolder) -> None:
    folder.add_part(RUNS)
    part = next((folder.path / "parts").iterdir())
    held = pq.read_table(part)
    wrong = pa.array(np.full(len(RUNS), 700.0))
    pq.write_table(held.set_column(held.column_names.index("hic15"), "hic15", wrong), part)
    assert folder.done() is None


def test_a_part_that_the_writer_compacts_away_meanwhile_is_no_crash(
    folder: ResultsFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder.add_part(RUNS)
    read = pq.read_table

    def compact_first(file: Path) -> object:
        monkeypatch.setattr(pq, "read_table", read)
        folder.compact(RUNS)
        return read(file)

    monkeypatch.setattr(pq, "read_table", compact_first)
    assert digest(folder.runs()) == digest(RUNS)


@pytest.mark.parametrize("sizes", [(12,), (1, 11), (4, 4, 4), (1,) * 12])
def test_digest_depends_neither_on_the_order_of_rows_nor_on_the_layout_of_parts(
    folder: ResultsFolder, sizes: tuple[int, ...]
) -> None:
    assert digest(RUNS.sample(frac=1.0, random_state=1)) == digest(RUNS)
    ends = np.cumsum(sizes)
    for size, end in zip(sizes, ends, strict=True):
        folder.add_part(RUNS.iloc[end - size : end])
    assert digest(folder.runs()) == digest(RUNS)


@pytest.mark.parametrize(("column", "value"), [
    ("hic15", np.nextafter(RUNS["hic15"][5], np.inf)), ("hic15", np.nan), ("impact_speed", 0.0),
    ("replicate", 9), ("status", "unstable"),
])  # fmt: skip
def test_digest_changes_with_any_number(column: str, value: float | str) -> None:
    runs = table()
    runs.loc[5, column] = value
    assert digest(runs) != digest(RUNS)
    assert digest(RUNS.rename(columns={column: "other"})) != digest(RUNS) != digest(table(11))


HOLD = """
import sys
from mcstudy.execution.results import ResultsFolder
with ResultsFolder(sys.argv[1]).open_for_writing():
    print("held", flush=True)
    sys.stdin.read()
"""


def test_a_second_writer_is_refused_until_the_first_is_done(folder: ResultsFolder) -> None:
    command = [sys.executable, "-c", HOLD, str(folder.path)]
    with subprocess.Popen(
        command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(UserError, match="another run writes into this folder"):
            folder.open_for_writing().__enter__()
        holder.communicate("")
    # The lock holds within one process as well, and goes with an error.
    with folder.open_for_writing():  # noqa: SIM117
        with pytest.raises(UserError, match="another run"):
            ResultsFolder(folder.path).open_for_writing().__enter__()
    with pytest.raises(RuntimeError), folder.open_for_writing():
        raise RuntimeError
    with folder.open_for_writing():
        pass


def test_a_folder_that_cannot_be_created_is_a_user_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "file", tmp_path / "file" / "study"):
        with pytest.raises(UserError, match="cannot be written"):
            ResultsFolder(path).open_for_writing().__enter__()


def test_another_study_is_refused_by_what_differs(folder: ResultsFolder) -> None:
    numbers = {"seed": "1", "model": '"toy"', "inputs.stature": "{}"}
    folder.write_json("manifest.json", {"numbers": numbers})
    folder.check_same_study(numbers)
    for topics, named in (
        (numbers | {"seed": "2"}, "differs in seed)"),
        (numbers | {"fixed.age": "7"}, "differs in fixed.age)"),
        ({"seed": "1", "model": '"toy"'}, "differs in inputs.stature)"),
        (numbers | {"seed": "2", "model": '"other"'}, "differs in model, seed)"),
    ):
        with pytest.raises(UserError) as caught:
            folder.check_same_study(topics)
        assert named in str(caught.value) and str(folder.path) in str(caught.value)


@pytest.mark.parametrize("content", ["", "{", "[1, 2]", "\x00"])
def test_json_that_is_none_is_a_user_error(folder: ResultsFolder, content: str) -> None:
    folder.write_text("manifest.json", content)
    with pytest.raises(UserError, match=r"manifest\.json"):
        folder.read_json("manifest.json")
    with pytest.raises(UserError, match=r"manifest\.json"):
        folder.check_same_study({})
    with pytest.raises(UserError, match="cannot be read"):
        folder.read_json("missing.json")


def test_json_has_plain_numbers_and_null_for_what_is_none(folder: ResultsFolder) -> None:
    text = to_json({
        "nan": math.nan,
        "inf": [math.inf, -np.inf],
        "array": np.array([[1.0, np.nan], [2.5, 3.0]]),
        "numpy": (np.float64(0.1), np.int64(7), np.bool_(True), np.float32(np.nan)),
        "text": "Fußgänger",
        "none": None,
        3: {"nested": np.float64(np.nan)},
    })  # fmt: skip
    assert json.loads(text) == {
        "nan": None,
        "inf": [None, None],
        "array": [[1.0, None], [2.5, 3.0]],
        "numpy": [0.1, 7, True, None],
        "text": "Fußgänger",
        "none": None,
        "3": {"nested": None},
    }
    assert "NaN" not in text
    assert text.endswith("}\n")
    values = generator(3).normal(size=50).tolist()
    folder.write_json("analysis.json", {"values": values})
    assert folder.read_json("analysis.json")["values"] == values


def test_failures_above_the_limit_fail_the_study_and_are_counted() -> None:
    check_failures({"ok": 98, "unstable": 2}, {"unstable"}, 0.02)
    check_failures({"ok": 50, "no_head_contact": 50}, set(), 0.0)
    check_failures({}, set(), 0.0)
    counts = {"ok": 960, "unstable": 25, "step_limit": 5, "no_head_contact": 10}
    with pytest.raises(StudyError) as caught:
        check_failures(counts, {"unstable", "step_limit"}, 0.02)
    assert "3.0% of the runs failed (5 step_limit, 25 unstable)" in str(caught.value)
    assert "max_failure_rate = 2.0%" in str(caught.value)
