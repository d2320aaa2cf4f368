"""What there is to run: models with their inputs and outputs."""

from typing import Any

from mcstudy.errors import UserError
from models.registry import load_model, model_names

__all__ = ["describe", "model_names"]


def describe(name: str) -> dict[str, Any]:
    """Return name, version, inputs and outputs of a model as plain data.

    Raises
    ------
    UserError
        If there is no such model.
    """
    try:
        model = load_model(name)
    except ValueError as error:
        raise UserError(str(error)) from None
    fields = ("name", "unit", "nominal", "low", "high", "meaning", "source")
    return {
        "name": name,
        "version": model.version,
        "inputs": [{field: getattr(item, field) for field in fields} for item in model.inputs],
        "outputs": [
            {"name": item.name, "unit": item.unit, "meaning": item.meaning}
            for item in model.outputs
        ],
    }
