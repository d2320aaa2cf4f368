"""Chipmunk's own functions, as called by the compiled step loop.

Pymunk wraps the C library Chipmunk; one call through Python per step would cost more than the step.
The functions used here are those that ``pymunk.batch`` and ``Space.step`` call, by their addresses.
"""

from typing import Any, NamedTuple

import numba.experimental.function_type  # makes addresses of functions known to Numba  # noqa: F401
import numpy as np
from numba import types
from numpy.typing import NDArray
from pymunk import Space
from pymunk._chipmunk_cffi import ffi, lib
from pymunk.batch import BodyFields, Buffer


class _Function(types.WrapperAddressProtocol):
    """A C function given by its address, callable from compiled code."""

    def __init__(self, name: str, *arguments: Any) -> None:
        self._address = _address(ffi.addressof(lib, name))
        self._signature = types.void(*arguments)

    def __wrapper_address__(self) -> int:
        return self._address

    def signature(self) -> Any:
        return self._signature


def _address(pointer: Any) -> int:
    return int(ffi.cast("uintptr_t", pointer))


STEP_SPACE = _Function("cpSpaceStep", types.intp, types.float64)
"""Function of a space and a duration (s)."""
EACH_BODY = _Function("cpSpaceEachBody", types.intp, types.intp, types.intp)
"""Function of a space, a function to apply to each body, and its data."""
READ_BODY = _address(ffi.addressof(lib, "pmSpaceBodyGetIteratorFuncBatched"))
WRITE_BODY = _address(ffi.addressof(lib, "pmSpaceBodySetIteratorFuncBatched"))


class Transfer(NamedTuple):
    """A transfer of values in one direction between bodies and an array.

    Attributes
    ----------
    data : int
        Address of Pymunk's description.
    place : (1,) array
        Index in the array of the next value; set to 0 before each transfer.
    keep : tuple
        Objects that must stay alive as long as the transfer.
    """

    data: int
    place: NDArray[np.int32]
    keep: tuple[Any, ...]


def transfer(buffer: Buffer, fields: BodyFields) -> Transfer:
    """Return a transfer of some fields of all bodies through a buffer."""
    data = ffi.new("pmBatchedData *")
    data.fields = fields.value
    data.floatArray, data.intArray = buffer._float_arr, buffer._int_arr
    place = ffi.addressof(buffer._float_arr[0], "num")
    view = np.frombuffer(ffi.buffer(place, ffi.sizeof("int")), dtype=np.int32)
    return Transfer(_address(data), view, (data, buffer))


def address_of(space: Space) -> int:
    """Return the address of a space; it must live as long as the address is used."""
    return _address(space._space)
