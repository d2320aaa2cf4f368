"""Inputs and outputs of a model as its data file declares them."""

from collections.abc import Iterator
from typing import Any

from models.protocol import Array, Input, Model, Output, complete_inputs


def read_inputs(table: dict[str, Any]) -> tuple[Input, ...]:
    """Return the inputs of the ``[inputs]`` tables of a model's data file."""
    return tuple(
        Input(
            name=name,
            unit=row["unit"],
            meaning=row["meaning"],
            nominal=float(row["nominal"]),
            low=float(row["range"][0]),
            high=float(row["range"][1]),
            source=row["source"],
        )
        for name, row in table["inputs"].items()
    )


def read_outputs(table: dict[str, Any]) -> tuple[Output, ...]:
    """Return the outputs of the ``[outputs]`` table of a model's data file."""
    return tuple(Output(name, *row) for name, row in table["outputs"].items())


def named_rows(model: Model, rows: Array) -> Iterator[dict[str, float]]:
    """Yield the inputs by name of each row of a batch.

    Parameters
    ----------
    model : Model
    rows : (n, inputs) in the order of ``model.inputs``.

    Raises
    ------
    ValueError
        If the shape does not fit, or a value lies outside its range.
    """
    names = [item.name for item in model.inputs]
    if rows.ndim != 2 or rows.shape[1] != len(names):
        raise ValueError(f"rows must have shape (n, {len(names)}), given {rows.shape}")
    for row in rows:
        yield complete_inputs(model, dict(zip(names, row.tolist(), strict=True)))
