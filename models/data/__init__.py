"""Data files of the models: every value with its unit and its source."""

import functools
import tomllib
from importlib.resources import files
from typing import Any


@functools.cache
def load(name: str) -> dict[str, Any]:
    """Return a TOML file of this folder, e.g. ``load("gait/running.toml")``.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    """
    text = files("models.data").joinpath(name).read_text(encoding="utf-8")
    return tomllib.loads(text)


def names(folder: str) -> tuple[str, ...]:
    """Return the names, without ending, of the TOML files in a folder of data."""
    found = files("models.data").joinpath(folder).iterdir()
    return tuple(sorted(f.name.removesuffix(".toml") for f in found if f.name.endswith(".toml")))
