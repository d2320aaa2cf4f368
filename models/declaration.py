"""Inputs and outputs of a model as its data file declares them."""

from collections.abc import Callable
from typing import Any

import numpy as np

from models.protocol import Array, Batch, Input, Model, Output, complete_inputs


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


def run_rows(
    model: Model, rows: Array, evaluate: Callable[[dict[str, float]], tuple[str, dict[str, float]]]
) -> Batch:
    """Return the batch of (n, inputs) rows, each evaluated on its own.

    Parameters
    ----------
    model : Model
    rows : (n, inputs) in the order of ``model.inputs``.
    evaluate : gives status and outputs by name for the inputs by name.

    Raises
    ------
    ValueError
        If the shape does not fit, or a value lies outside its range.
    """
    names = [item.name for item in model.inputs]
    rows = np.asarray(rows, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] != len(names):
        raise ValueError(f"rows must have shape (n, {len(names)}), given {rows.shape}")
    table = np.empty((rows.shape[0], len(model.outputs)))
    status = []
    for k, row in enumerate(rows):
        values = complete_inputs(model, dict(zip(names, row.tolist(), strict=True)))
        word, outputs = evaluate(values)
        status.append(word)
        table[k] = [outputs[item.name] for item in model.outputs]
    return Batch(table, status)
