"""Outcomes of trials, kept as they come: an interrupted validation goes on where it stopped."""

import hashlib
import json
from collections.abc import Callable, Hashable, Iterator, Sequence
from pathlib import Path
from typing import Protocol, TypeVar

import mcstudy
import models
import studies
from mcstudy.execution.progress import follow, say
from mcstudy.execution.workers import stream_jobs
from mcstudy.typed_json import from_plain, to_plain

PACKAGES = (mcstudy, models, studies)
CODE = (".py", ".toml")
"""Endings of the files on which an outcome depends."""


class Tried(Protocol):
    """Outcome of a trial."""

    @property
    def trial(self) -> Hashable:
        """The trial."""
        ...


_Trial = TypeVar("_Trial", bound=Hashable)
_Outcome = TypeVar("_Outcome", bound=Tried)


def run_trials(
    folder: Path,
    trials: Sequence[_Trial],
    run: Callable[[_Trial], _Outcome],
    kind: type[_Outcome],
    workers: int,
    *,
    quiet: bool,
) -> list[_Outcome]:
    """Return the outcomes of trials, in order; those in the folder are not run again.

    Outcomes of other code are not counted: the file is named after a digest of the code.

    Parameters
    ----------
    folder : path
        Where outcomes are kept, one line each.
    trials : sequence
    run : callable
        Trial to outcome, a function of a module.
    kind : type
        Of the outcomes.
    workers : int
        Processes, -1 for one a core.
    quiet : bool
        No progress line.
    """
    file = folder / f"outcomes-{_digest()}.jsonl"
    held: dict[Hashable, _Outcome] = {outcome.trial: outcome for outcome in _read(file, kind)}
    left = [trial for trial in trials if trial not in held]
    if held:
        say(f"{len(trials) - len(left)} of {len(trials)} trials were run before", quiet=quiet)
    found = stream_jobs(run, left, workers)
    for _ in follow(range(len(left)), "trials", quiet=quiet):
        outcome = next(found)
        with file.open("a", encoding="utf-8") as lines:
            # On a line of its own, even after one that was cut off.
            lines.write("\n" + json.dumps(to_plain(outcome)))
        held[outcome.trial] = outcome
    return [held[trial] for trial in trials]


def _read(file: Path, kind: type[_Outcome]) -> Iterator[_Outcome]:
    """Yield the outcomes of a file; empty lines and one that was cut off are left out."""
    if not file.exists():
        return
    for line in file.read_text(encoding="utf-8").splitlines():
        try:
            yield from_plain(kind, json.loads(line))
        except json.JSONDecodeError:
            continue


def _digest() -> str:
    """Return a digest of the code and data of the packages."""
    digest = hashlib.sha256()
    for package in PACKAGES:
        base = Path(package.__path__[0])
        for file in sorted(path for path in base.rglob("*") if path.suffix in CODE):
            digest.update(file.relative_to(base).as_posix().encode() + file.read_bytes())
    return digest.hexdigest()[:12]
