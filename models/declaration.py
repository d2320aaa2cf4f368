"""Inputs and outputs of a model as declared in its data file."""

from collections.abc import Callable
from typing import Any

import numpy as np

from models.protocol import Array, Batch, Channel, Input, Model, Output, complete_inputs


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


def read_channels(table: dict[str, Any]) -> dict[str, Channel]:
    """Return the channels of the ``[channels]`` tables of a model's data file, by name."""
    return {
        name: Channel(**{**row, "outputs": tuple(row.get("outputs", ()))})
        for name, row in table["channels"].items()
    }


def run_rows(
    model: Model,
    rows: Array,
    evaluate: Callable[[dict[str, float]], tuple[str, dict[str, float]]],
    started: Callable[[int], None] | None = None,
) -> Batch:
    """Return the batch of (n, inputs) rows, each evaluated independently.

    Parameters
    ----------
    model : Model
    rows : (n, inputs) array
        In the order of ``model.inputs``.
    evaluate : callable
        Returns status and outputs by name for the inputs by name.
    started : callable, optional
        Called with the number of each row before it is evaluated.

    Raises
    ------
    ValueError
        If the shape does not match, or a value lies outside its range.
    """
    names = [item.name for item in model.inputs]
    rows = np.asarray(rows, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] != len(names):
        raise ValueError(f"rows must have shape (n, {len(names)}), given {rows.shape}")
    low = np.array([item.low for item in model.inputs])
    high = np.array([item.high for item in model.inputs])
    outside = ~((rows >= low) & (rows <= high)).all(axis=1)
    if outside.any():
        # The error message for the first such row names the input.
        complete_inputs(model, dict(zip(names, rows[np.argmax(outside)].tolist(), strict=True)))
    table = np.empty((rows.shape[0], len(model.outputs)))
    status = []
    for k, row in enumerate(rows.tolist()):
        if started is not None:
            started(k)
        word, outputs = evaluate(dict(zip(names, row, strict=True)))
        status.append(word)
        table[k] = [outputs[item.name] for item in model.outputs]
    return Batch(table, status)
