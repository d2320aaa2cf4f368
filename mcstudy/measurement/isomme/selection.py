"""Selection of the head acceleration among the channels of a test.

One rule: the three axes, or the resultant, of one test object and one fine location, with a sound
data status; measured before computed channels, the least filtered copy before the others. Where
more than one head or sensor remains, the user chooses.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np

from mcstudy import units
from mcstudy.errors import UserError
from mcstudy.measurement.isomme.files import FILTERS, RAW, SOUND, Channel, ChannelFile, Test

AXES = "XYZ"
RESULTANT = "R"
_RANKS = (RAW, "P", *FILTERS)
"""Last characters of codes, the least filtered first; P is filtered by the recorder alone."""


@dataclass(frozen=True)
class HeadSignal:
    """The head acceleration of a test: resultant (g), its test object, notes."""

    channel: Channel
    object: int
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Candidate:
    """One sensor's head acceleration: three axes, or a resultant."""

    files: tuple[ChannelFile, ...]

    @property
    def rank(self) -> tuple[int, bool]:
        """Degree of processing: filter, and whether it is a resultant."""
        letter = self.files[0].code[15]
        known = _RANKS.index(letter) if letter in _RANKS else len(_RANKS)
        return known, len(self.files) == 1

    @property
    def derived(self) -> int:
        """Degree of derivation: 1 if computed by its data source, 2 for a 3 ms level."""
        if all(re.fullmatch("3[A-Z]", file.code[8:10]) for file in self.files):
            return 2
        return int(all(re.search("calc|comput|deriv", file.source) for file in self.files))

    def __str__(self) -> str:
        code = self.files[0].code
        shown = code if len(self.files) == 1 else f"{code[:14]}?{code[15]}"
        return f"{shown} ({', '.join(file.path.name for file in self.files)})"


def head_acceleration(test: Test, wanted: Sequence[str] = ()) -> HeadSignal:
    """Return the resultant head acceleration (g) of a test.

    Parameters
    ----------
    test : Test
    wanted : sequence of str
        Codes of the channels to take, or names of their files; ``?`` stands for any character,
        ``*`` for any number of them. Such channels are taken whatever their data status.

    Raises
    ------
    UserError
        If no head acceleration or more than one remains, or it cannot be used; the message lists
        the channels.
    """
    heads = [f for f in test.files if _is_head(f)]
    if wanted:
        chosen = [f for f in heads if _matches(f, wanted)]
        if not chosen:
            raise UserError(
                f"{test.path}: no head acceleration is {' or '.join(wanted)!r}; it has "
                f"{_listed(heads)}"
            )
        heads = chosen
    sound = [f for f in heads if f.status in SOUND]
    failed = [f for f in heads if f.status not in SOUND]
    candidates = _candidates(test, sound, failed)
    if not candidates and wanted:
        candidates, failed = _candidates(test, heads, []), []
    if not candidates:
        raise UserError(
            f"{test.path}: has no head acceleration, resultant (??HEAD??????ACR?) or in x, y and z"
            + _told(failed)
        )
    if not wanted:
        nearest = min(c.derived for c in candidates)
        candidates = [c for c in candidates if c.derived == nearest]
    if len(candidates) > 1:
        raise UserError(
            f"{test.path}: has {len(candidates)} head accelerations: "
            f"{'; '.join(map(str, candidates))}; choose one, for example with "
            f"{_choice(candidates[0], candidates)}"
        )
    taken = candidates[0]
    channel = _combine(test, [test.read(file) for file in taken.files])
    left = [f for f in heads if f not in taken.files]
    notes = [f"head acceleration is {taken}, {_filter_words(channel)}"]
    unsound = [f for f in taken.files if f.status not in SOUND]
    notes += [f"{f.code} ({f.path.name}) has data status {f.status!r}" for f in unsound]
    if left:
        notes.append(f"not used: {_listed(left)}")
    return HeadSignal(channel, taken.files[0].object, (*notes, *channel.notes))


def _is_head(file: ChannelFile) -> bool:
    """Return whether a channel is a history of head acceleration."""
    code = file.code
    return (
        len(code) == 16
        and code[2:6] == "HEAD"
        and code[12:14] == "AC"
        and code[14] in AXES + RESULTANT
        and file.count > 1
    )


def _matches(file: ChannelFile, wanted: Sequence[str]) -> bool:
    return any(
        fnmatchcase(name.upper(), pattern.upper())
        for name in (file.code, file.path.name)
        for pattern in wanted
    )


def _candidates(
    test: Test, files: Sequence[ChannelFile], failed: Sequence[ChannelFile]
) -> list[_Candidate]:
    """Return the least processed head accelerations of each sensor."""
    sensors: dict[tuple[str, str], list[ChannelFile]] = {}
    for file in files:
        sensors.setdefault((file.code[:2], file.code[6:12]), []).append(file)
    broken = {(f.code[:2], f.code[6:12]) for f in failed if f.code[14] in AXES}
    found, mixed = [], ""
    for sensor, own in sensors.items():
        letters = {f.code[15] for f in own}
        options = []
        for letter in sorted(letters):
            by_axis = {
                axis: [f for f in own if f.code[14:16] == axis + letter]
                for axis in AXES + RESULTANT
            }
            axes = [by_axis[axis] for axis in AXES]
            if all(axes):
                options += [_Candidate(c) for c in _products(axes)]
            # The resultant of a failed axis is invalid as well.
            if by_axis[RESULTANT] and sensor not in broken:
                options += [_Candidate((f,)) for f in by_axis[RESULTANT]]
        if not options and {f.code[14] for f in own} >= set(AXES):
            mixed = f"{test.path}: the head acceleration's components are filtered differently"
        best = min((o.rank for o in options), default=None)
        found += [o for o in options if o.rank == best]
    if mixed and not found:
        raise UserError(mixed)
    return found


def _products(axes: Sequence[Sequence[ChannelFile]]) -> list[tuple[ChannelFile, ...]]:
    """Return the triples of three axes; each file is in one of them.

    Axes that occur twice are paired in the order of their files.
    """
    count = max(len(files) for files in axes)
    return [tuple(files[min(k, len(files) - 1)] for files in axes) for k in range(count)]


def _combine(test: Test, parts: Sequence[Channel]) -> Channel:
    """Return the resultant (g) of channels."""
    if any(p.time.shape != parts[0].time.shape or np.any(p.time != parts[0].time) for p in parts):
        raise UserError(f"{test.path}: the head acceleration's components differ in time")
    if len({part.filter for part in parts}) > 1:
        raise UserError(f"{test.path}: the head acceleration's components are filtered differently")
    try:
        scale = np.array([units.factor(part.unit, "g") for part in parts])
    except ValueError as error:
        raise UserError(f"{test.path}: {parts[0].code}: {error}") from None
    code = parts[0].code[:14] + RESULTANT + parts[0].code[15:]
    values = np.array([part.values for part in parts])
    kept = np.isfinite(values).all(axis=0)
    with np.errstate(over="ignore"):
        # Overflow gives infinity.
        values = scale[:, None] * values
        # A resultant channel stays as it is: its noise before contact may be of either sign.
        found = values[0] if len(parts) == 1 else np.sqrt((values**2).sum(axis=0))
    notes = [note for part in parts for note in part.notes]
    inside = np.flatnonzero(kept)
    if inside.size:
        lost = inside[0] + kept.size - 1 - inside[-1]
        if lost:
            notes.append(f"{lost} samples without a value at the ends of the record are left out")
        if inside.size < inside[-1] - inside[0] + 1:
            first = inside[0] + int(np.argmin(kept[inside[0] :]))
            raise UserError(
                f"{test.path}: {code}: no value {1e3 * parts[0].time[first]:.3f} ms, in the middle "
                "of the record"
            )
    return Channel(code, "g", parts[0].time[kept], found[kept], parts[0].filter, tuple(notes))


def _filter_words(channel: Channel) -> str:
    return "not filtered or unknown" if channel.filter == "none" else channel.filter


def _told(failed: Sequence[ChannelFile]) -> str:
    """Return the failed channels and the option to take them nevertheless."""
    if not failed:
        return ""
    names = ", ".join(f"{f.code} ({f.path.name}): {f.status!r}" for f in failed)
    return f"; by their data status not used: {names}; --channel takes one all the same"


def _listed(files: Sequence[ChannelFile]) -> str:
    """Return channels with their files and, where it is not sound, their data status."""
    names = [
        f"{f.code} ({f.path.name}{'' if f.status in SOUND else f', {f.status}'})" for f in files
    ]
    return ", ".join(names) or "none"


def _choice(candidate: _Candidate, among: Sequence[_Candidate]) -> str:
    """Return the options that choose a candidate among others: its code, or its files."""
    code = candidate.files[0].code
    wanted = code if len(candidate.files) == 1 else f"{code[:14]}?{code[15]}"
    others = [f for other in among if other is not candidate for f in other.files]
    if not any(_matches(f, [wanted]) for f in others):
        return f"--channel '{wanted}'"
    return " ".join(f"--channel '{f.path.name}'" for f in candidate.files)
