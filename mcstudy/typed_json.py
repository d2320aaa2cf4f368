"""Frozen dataclasses in Python, objects in JSON.

A field without a value is null: NaN and infinity are read back as NaN. A field whose default is
None is left out where it is None.
"""

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import BeforeValidator, TypeAdapter

Content = TypeVar("Content")

Real = Annotated[float, BeforeValidator(lambda value: math.nan if value is None else value)]
"""A number that is null in JSON where it does not exist, and NaN in Python."""


def to_plain(content: Any) -> Any:
    """Return dictionaries, lists and plain values; NumPy values become plain ones."""
    if is_dataclass(content) and not isinstance(content, type):
        held = ((field, getattr(content, field.name)) for field in fields(content))
        return {
            field.name: to_plain(value)
            for field, value in held
            if not (value is None and field.default is None)
        }
    if isinstance(content, Mapping):
        return {str(key): to_plain(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [to_plain(value) for value in content]
    if isinstance(content, np.ndarray):
        return to_plain(content.tolist())
    if isinstance(content, np.generic):
        return to_plain(content.item())
    if isinstance(content, float) and not math.isfinite(content):
        return None
    return content


def from_plain(kind: type[Content], content: Mapping[str, Any]) -> Content:
    """Return a dataclass from what ``to_plain`` gives.

    Parameters
    ----------
    kind : type
        Dataclass.
    content : mapping
        Its fields; others are ignored.

    Raises
    ------
    ValueError
        If a field is missing or of another type.
    """
    return TypeAdapter(kind).validate_python(content)
