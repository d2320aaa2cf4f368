"""The models by name: a new model is one module and one line here."""

import inspect
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

from models.protocol import Model

# name: module and factory, imported on request.
_MODELS = {
    "facet": ("models.facet.model", "FacetModel"),
    "fem": ("models.fem.model", "FemModel"),
    "headform": ("models.headform.model", "HeadformModel"),
    "multibody": ("models.multibody.model", "MultibodyModel"),
    "planar": ("models.planar.model", "PlanarModel"),
}


def model_names() -> tuple[str, ...]:
    """Return the names of all models."""
    return tuple(_MODELS)


def load_model(
    name: str,
    options: Mapping[str, Any] | None = None,
    effects: Mapping[str, Mapping[str, float]] | None = None,
) -> Model:
    """Return a model.

    Parameters
    ----------
    name : str
    options : mapping, optional
        Choices that are not inputs, such as ``vehicle``.
    effects : mapping, optional
        Parameter values of each effect that is switched on, by effect.

    Raises
    ------
    ValueError
        If the model, an option or an effect is unknown.
    """
    if name not in _MODELS:
        raise ValueError(f"unknown model {name!r}: choose one of {', '.join(_MODELS)}")
    module, factory = _MODELS[name]
    build: Callable[..., Model] = getattr(import_module(module), factory)
    chosen = dict(options or {})
    known = [option for option in inspect.signature(build).parameters if option != "effects"]
    if unknown := [option for option in chosen if option not in known]:
        raise ValueError(f"model {name!r} has no option {unknown[0]!r}; it has {', '.join(known)}")
    if effects:
        chosen["effects"] = effects
    return build(**chosen)
