"""Crashes kept for runs that differ only in how the signals were recorded."""

import itertools
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from models.crash.outcome import Raw
from models.effects.chain import EffectChain

MOST = 64
"""Crashes kept in a process, some 2 MB each: those of one Jacobian of about ten tests."""

_Key = tuple[int, tuple[float, ...]]
_KEPT: OrderedDict[_Key, Raw | str] = OrderedDict()
"""Crashes of all models by number of the model and inputs, the latest last: a search holds dozens
of models, each with an effect of its own."""
_NUMBERS = itertools.count()


class CrashMemory:
    """The latest crashes by the inputs that act on them.

    An error of the instrument changes the record of a crash, not the crash: a fit of such an error
    runs the step loop once for all its sizes.

    Parameters
    ----------
    chain : EffectChain
        Effects of the model.
    """

    def __init__(self, chain: EffectChain) -> None:
        self._recorded = {
            effect.input_name(name)
            for effect in chain.effects
            if effect.stage == "signal"
            for name in effect.parameters
        }
        self._number = next(_NUMBERS)

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take a number of this process: that of another one may be another model's here."""
        self.__dict__.update(state, _number=next(_NUMBERS))

    def recall(self, values: Mapping[str, float]) -> Raw | str | None:
        """Return the crash of these inputs with their record, or None if it is not kept.

        Parameters
        ----------
        values : mapping of str to float
            All inputs by name.
        """
        if not self._recorded:
            return None
        key = self._key(values)
        found = _KEPT.get(key)
        if found is None:
            return None
        _KEPT.move_to_end(key)
        return found if isinstance(found, str) else replace(found, values=values)

    def keep(self, values: Mapping[str, float], crash: Raw | str) -> None:
        """Keep a crash, or the status that prevented it.

        Arrays that the next run writes are copied.

        Parameters
        ----------
        values : mapping of str to float
            All inputs by name.
        crash : Raw or str
        """
        if not self._recorded:
            return
        if not isinstance(crash, str):
            crash = replace(crash, record=crash.record.copy(), frames=crash.frames.copy())
        _KEPT[self._key(values)] = crash
        if len(_KEPT) > MOST:
            _KEPT.popitem(last=False)

    def _key(self, values: Mapping[str, float]) -> _Key:
        acting = (value for name, value in values.items() if name not in self._recorded)
        return self._number, tuple(acting)
