"""The results folder of a study: layout, writing and reading.

::

    study.toml      the file as run
    manifest.json   versions, seed, model, machine, wall time, counts, digest
    parts/          chunks as they arrive, gone once compacted
    runs.parquet    one row a run: run id, replicate, every input, every output, status
    histories/      time histories of chosen runs
    analysis.json   every number that the report prints
    figures/        PNG and SVG
    report.html     self-contained
"""

import contextlib
import hashlib
import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from mcstudy.errors import StudyError, UserError
from mcstudy.simulator import HistoryLike
from mcstudy.typed_json import from_plain, to_plain

Analysis = TypeVar("Analysis")

RUNS = "runs.parquet"
ANALYSIS = "analysis.json"
_DIGEST = b"mcstudy.digest"
_CELL = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,79}(/[A-Za-z0-9][A-Za-z0-9_.-]{0,79})?")


class ResultsFolder:
    """A results folder.

    Parameters
    ----------
    path : Path
        The folder; created by ``open_for_writing`` only.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self._writing = False

    # -- writing ---------------------------------------------------------------------------

    @contextlib.contextmanager
    def open_for_writing(self) -> Iterator[None]:
        """Create the folder and hold its lock.

        Raises
        ------
        UserError
            If another process writes into the folder, or it cannot be created.
        """
        import fcntl

        try:
            self.path.mkdir(parents=True, exist_ok=True)
            handle = (self.path / ".lock").open("w")
        except OSError as error:
            raise UserError(f"{self.path}: cannot be written ({error})") from None
        with handle:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise UserError(
                    f"{self.path}: another run writes into this folder; wait or choose --out"
                ) from None
            self._writing = True
            try:
                yield
            finally:
                self._writing = False

    def write_text(self, name: str, text: str) -> None:
        """Write a text file atomically: a reader sees the old one or the new one."""
        target = self.path / name
        target.parent.mkdir(parents=True, exist_ok=True)
        with _replacing(target) as temporary:
            # A path may hold bytes that are not valid text.
            temporary.write_text(text, encoding="utf-8", errors="replace")

    def write_json(self, name: str, content: Any) -> None:
        """Write a JSON file atomically; NaN becomes null."""
        self.write_text(name, to_json(content))

    def write_frame(self, name: str, frame: pd.DataFrame) -> None:
        """Write a Parquet file atomically."""
        target = self.path / name
        target.parent.mkdir(parents=True, exist_ok=True)
        with _replacing(target) as temporary:
            pq.write_table(pa.Table.from_pandas(frame, preserve_index=False), temporary)

    def _write_runs(self, name: str, frame: pd.DataFrame) -> None:
        """Write a table of runs atomically with its digest, which detects torn files."""
        target = self.path / name
        target.parent.mkdir(parents=True, exist_ok=True)
        table = pa.Table.from_pandas(frame, preserve_index=False)
        held = {_DIGEST: digest(table.to_pandas()).encode()}
        with _replacing(target) as temporary:
            metadata = (table.schema.metadata or {}) | held
            pq.write_table(table.replace_schema_metadata(metadata), temporary)

    def add_part(self, frame: pd.DataFrame) -> None:
        """Keep a chunk of runs."""
        first = int(frame["run"].iloc[0])
        self._write_runs(f"parts/part-{first:09d}-{len(frame):06d}.parquet", frame)

    def add_histories(self, run: int, histories: Mapping[str, HistoryLike]) -> None:
        """Keep the time histories of a run, by group; ``history`` reads them back."""
        for group, history in histories.items():
            frame = pd.DataFrame({"time": history.time} | dict(history.channels))
            self.write_frame(f"{_history_folder(run)}/{group}.parquet", frame)

    def compact(self, frame: pd.DataFrame) -> None:
        """Write ``runs.parquet`` and drop the parts."""
        self._write_runs(RUNS, frame)
        for part in self._parts():
            part.unlink()
        with contextlib.suppress(OSError):
            (self.path / "parts").rmdir()

    # -- reading ---------------------------------------------------------------------------

    def _parts(self) -> list[Path]:
        return sorted((self.path / "parts").glob("part-*.parquet"))

    def done(self) -> pd.DataFrame | None:
        """Return all runs on disk, sorted by run id, or None if there are none."""
        files = [self.path / RUNS] if (self.path / RUNS).exists() else []
        frames = []
        for file in files + self._parts():
            try:
                frames.append(read_runs(file))
            except FileNotFoundError:
                # Another process compacted the parts meanwhile: their runs are in the table now.
                return self.done()
            except ValueError:
                # A torn file is renamed, and its runs are repeated.
                if self._writing:
                    file.rename(file.with_suffix(".broken"))
        if not frames:
            return None
        runs = pd.concat(frames, ignore_index=True).drop_duplicates("run")
        ordered: pd.DataFrame = runs.sort_values("run", ignore_index=True)
        return ordered

    def progress(self) -> tuple[int, dict[str, int]]:
        """Return the number of completed runs, in the folder or its cells, in all and by status."""
        design = self.design()
        counts: Counter[str] = Counter()
        for cell in design["cells"]:
            inner = ResultsFolder(self.path / "cells" / cell)
            if (inner.path / "manifest.json").exists():
                counts.update(inner.progress()[1])
        runs = self.done()
        if runs is not None:
            # A folder may hold runs of an earlier, larger design.
            counts.update(runs["status"][runs["run"] < design["n"]].astype(str).tolist())
        return counts.total(), dict(counts.most_common())

    def design(self, *counts: str) -> dict[str, Any]:
        """Return the design from the manifest: at least ``n``, ``block`` and ``cells``.

        Parameters
        ----------
        *counts : str
            Further whole numbers that it must have.

        Raises
        ------
        UserError
            If it is missing or invalid.
        """
        place = self.path / "manifest.json"
        design = self.read_json("manifest.json").get("design")
        if not isinstance(design, dict):
            raise UserError(f"{place}: has no table 'design'")
        found: dict[str, Any] = {"block": 1, "cells": []} | design
        for key in ("n", "block", *counts):
            value = found.get(key)
            if not isinstance(value, int) or isinstance(value, bool) or not 0 < value < 2**53:
                raise UserError(f"{place}: design.{key} must be a whole number above 0")
        cells = found["cells"]
        plain = isinstance(cells, list) and all(isinstance(cell, str) for cell in cells)
        if not plain or any(not _CELL.fullmatch(cell) for cell in cells):
            raise UserError(f"{place}: design.cells must be names of folders")
        return found

    def runs(self, numbers: Sequence[str] = ()) -> pd.DataFrame:
        """Return the table of runs.

        Parameters
        ----------
        numbers : sequence of str
            Columns that must exist and hold numbers.

        Raises
        ------
        UserError
            If the folder holds no runs, or a column is missing or holds something else.
        """
        found = self.done()
        if found is None and (self.path / RUNS).exists():
            raise UserError(f"{self.path / RUNS}: is no table of runs; run the study again")
        if found is None or found.empty:
            raise UserError(f"{self.path}: holds no runs; run the study first")
        for name in numbers:
            if name not in found.columns:
                raise UserError(
                    f"{self.path}: its runs have no column {name!r}; run the study again"
                )
            if found[name].dtype.kind not in ("iu" if name == "replicate" else "fiu"):
                raise UserError(f"{self.path}: column {name!r} of its runs holds no numbers")
        return found

    def read_json(self, name: str) -> dict[str, Any]:
        """Return a JSON file of the folder.

        Raises
        ------
        UserError
            If it is missing or not JSON.
        """
        try:
            content = json.loads((self.path / name).read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise UserError(f"{self.path / name}: cannot be read ({error})") from None
        if not isinstance(content, dict):
            raise UserError(f"{self.path / name}: is not a JSON object")
        return content

    def read_analysis(self, kind: type[Analysis]) -> Analysis:
        """Return the analysis of the folder.

        Parameters
        ----------
        kind : type
            Its dataclass.

        Raises
        ------
        UserError
            If it is missing, or not of this kind.
        """
        content = self.read_json(ANALYSIS)
        try:
            return from_plain(kind, content)
        except ValueError as error:
            raise UserError(
                f"{self.path / ANALYSIS}: is no {kind.__name__}; write it again with "
                f"'mcstudy report' ({str(error)[:200]})"
            ) from None

    def history(self, run: int) -> dict[str, pd.DataFrame]:
        """Return the kept time histories of a run: a frame with a ``time`` column by group.

        Raises
        ------
        UserError
            If the run's histories were not kept.
        """
        folder = self.path / _history_folder(run)
        files = sorted(folder.glob("*.parquet"))
        if not files:
            raise UserError(f"{folder}: no histories were kept for run {run}")
        return {file.stem: pq.read_table(file).to_pandas() for file in files}

    def check_same_study(self, topics: Mapping[str, str]) -> None:
        """Check that the folder holds no runs of a study with other numbers.

        Raises
        ------
        UserError
            Naming what differs.
        """
        if not (self.path / "manifest.json").exists():
            return
        held = self.read_json("manifest.json").get("numbers", {})
        differing = sorted(k for k in {*held, *topics} if held.get(k) != topics.get(k))
        if differing:
            raise UserError(
                f"{self.path}: holds another study (it differs in {', '.join(differing[:4])}); "
                "choose another --out or remove the folder"
            )


def _history_folder(run: int) -> str:
    return f"histories/run-{run:06d}"


@contextlib.contextmanager
def _replacing(target: Path) -> Iterator[Path]:
    """Yield a temporary path and move it over ``target`` on success."""
    temporary = target.with_name(f".{target.name}.tmp")
    try:
        yield temporary
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)


def to_json(content: Any) -> str:
    """Return JSON text; dataclasses become objects, NaN and infinity null."""
    return json.dumps(to_plain(content), indent=2, allow_nan=False) + "\n"


def read_runs(file: Path) -> pd.DataFrame:
    """Return a table of runs.

    Raises
    ------
    ValueError
        If the file is torn, corrupted or no table of runs.
    """
    try:
        table = pq.read_table(file)
        frame: pd.DataFrame = table.to_pandas()
    except FileNotFoundError:
        raise
    except (pa.ArrowException, OSError, ValueError, TypeError, KeyError) as error:
        raise ValueError(f"{file}: {error}") from None
    held = (table.schema.metadata or {}).get(_DIGEST)
    if not {"run", "status"} <= set(frame.columns) or frame["run"].dtype.kind not in "iu":
        raise ValueError(f"{file}: is no table of runs")
    if held is not None and held != digest(frame).encode():
        raise ValueError(f"{file}: its numbers are not those that were written")
    return frame


def digest(frame: pd.DataFrame) -> str:
    """Return a digest of the numbers of a table of runs, independent of how they were run."""
    ordered = frame.sort_values("run")
    total = hashlib.sha256()
    for name in ordered.columns:
        column = ordered[name]
        total.update(name.encode())
        if column.dtype.kind in "fiu":
            total.update(np.ascontiguousarray(column.to_numpy()).tobytes())
        else:
            total.update("\n".join(column.astype(str)).encode())
    return total.hexdigest()


def status_counts(runs: pd.DataFrame) -> dict[str, int]:
    """Return the number of runs by status, the most frequent first."""
    return {str(k): int(v) for k, v in runs["status"].value_counts().items()}


def check_failures(counts: Mapping[str, int], failed: set[str], limit: float) -> None:
    """Check the share of failed runs against the study's limit.

    Parameters
    ----------
    counts : mapping
        Number of runs by status.
    failed : set of str
        Statuses that count as failed.
    limit : float
        Largest share of failed runs.

    Raises
    ------
    StudyError
        If the share exceeds the limit.
    """
    total = sum(counts.values())
    lost = {status: n for status, n in counts.items() if status in failed}
    share = sum(lost.values()) / total if total else 0.0
    if share > limit:
        detail = ", ".join(f"{n} {status}" for status, n in sorted(lost.items()))
        raise StudyError(
            f"{share:.1%} of the runs failed ({detail}), above max_failure_rate = {limit:.1%}"
        )
