"""Materials of a car's panels from a data file."""

from collections.abc import Mapping, Sequence

import numpy as np

from models.shells.material import Materials


def materials_of(
    table: Mapping[str, Mapping[str, float]], names: Sequence[str], strength: float
) -> Materials:
    """Return materials of a data file, one row a name.

    Parameters
    ----------
    table : mapping
        Rows by name, with the fields of ``Materials``.
    names : sequence of str
    strength : float
        Factor on the yield stresses.
    """
    columns = {
        field: np.array([float(table[name][field]) for name in names])
        for field in Materials._fields
    }
    columns["yield_stress"] = strength * columns["yield_stress"]
    return Materials(**columns)
