"""Crashes kept for runs that differ only in how the signals were recorded."""

from collections.abc import Hashable, Mapping
from dataclasses import replace

from models.crash.outcome import Raw
from models.effects.chain import EffectChain
from models.recent import Recent

MOST = 64
"""Crashes kept in a process, some 2 MB each: those of one Jacobian of about ten tests."""

_Key = tuple[Hashable, tuple[tuple[str, float], ...]]
_KEPT: Recent[_Key, Raw | str] = Recent(MOST)
"""Crashes of all models by setup and inputs."""


class CrashMemory:
    """The latest crashes by the inputs that act on them, shared by the models of a process.

    An error of the instrument changes the record of a crash, not the crash: models that differ in
    such errors alone run the step loop once for all their kinds and sizes.

    Parameters
    ----------
    chain : EffectChain
        Effects of the model.
    """

    def __init__(self, chain: EffectChain) -> None:
        self._chain = chain

    def recall(self, setup: Hashable, values: Mapping[str, float]) -> Raw | str | None:
        """Return the crash of these inputs with their record, or None if it is not kept.

        Parameters
        ----------
        setup : hashable
            What a crash depends on beside its inputs, such as the vehicle and the step.
        values : mapping of str to float
            All inputs by name.
        """
        found = _KEPT.get(self._key(setup, values))
        if found is None or isinstance(found, str):
            return found
        return replace(found, values=values, chain=self._chain)

    def keep(self, setup: Hashable, values: Mapping[str, float], crash: Raw | str) -> None:
        """Keep a crash, or the status that prevented it.

        Arrays that the next run writes are copied.

        Parameters
        ----------
        setup : hashable
            As in ``recall``.
        values : mapping of str to float
            All inputs by name.
        crash : Raw or str
        """
        if not isinstance(crash, str):
            crash = replace(crash, record=crash.record.copy(), frames=crash.frames.copy())
        _KEPT.put(self._key(setup, values), crash)

    def _key(self, setup: Hashable, values: Mapping[str, float]) -> _Key:
        return setup, tuple(self._chain.acting(values).items())
