"""Listing of models with their inputs and outputs, and of effects."""

from typing import Any

from mcstudy.errors import UserError
from models.effects.registry import EFFECTS, load_effect
from models.registry import load_model, model_names

__all__ = ["describe", "describe_effect", "describe_effects", "model_names"]


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
    fields = ["name", "unit", "nominal", "low", "high", "meaning", "source"]
    if any(item.ignored for item in model.inputs):
        fields.append("ignored")
    return {
        "name": name,
        "version": model.version,
        "inputs": [{field: getattr(item, field) for field in fields} for item in model.inputs],
        "outputs": [
            {"name": item.name, "unit": item.unit, "meaning": item.meaning}
            for item in model.outputs
        ],
    }


def describe_effect(name: str) -> dict[str, Any]:
    """Return an effect of the catalogue as plain data.

    Raises
    ------
    UserError
        If there is no such effect.
    """
    try:
        effect = load_effect(name)
    except ValueError as error:
        raise UserError(str(error)) from None
    return {
        "name": name,
        "title": effect.title,
        "models": list(effect.models),
        "signature": effect.signature,
        "confusable": list(effect.confusable),
        "separated_by": effect.separated_by,
        "source": effect.source,
        "parameters": [
            {
                "name": key,
                "input": effect.input_name(key),
                "unit": entry.input.unit,
                "none": entry.none,
                "prior": f"{entry.prior}",
                "range": f"{entry.input.low:g} to {entry.input.high:g}",
                "meaning": entry.input.meaning,
            }
            for key, entry in effect.parameters.items()
        ],
    }


def describe_effects() -> list[dict[str, Any]]:
    """Return all effects of the catalogue as plain data."""
    return [describe_effect(name) for name in EFFECTS]
