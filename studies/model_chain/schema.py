"""The study file of a model chain."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from mcstudy.attribution import find_steps
from mcstudy.studyfile.schema import LARGEST_DESIGN, Design, ModelChoice, ModelsStudy


class ChainModel(ModelChoice):
    """``[models.<label>]``: a model and what it does differently from the one without changes.

    ``n`` is the number of its runs, the first ones of the design, for a model whose runs are dear;
    ``reuse`` the folder of a finished study, or of a cell of one, whose runs are taken over.
    """

    changes: list[Annotated[str, Field(min_length=1, max_length=60)]] = []
    n: Annotated[int, Field(ge=2, le=LARGEST_DESIGN)] | None = None
    reuse: str | None = None


class ModelChain(ModelsStudy):
    """``kind = "model-chain"``: the difference of two models, split over what lies between."""

    kind: Literal["model-chain"]
    models: Annotated[dict[str, ChainModel], Field(min_length=2, max_length=64)]
    design: Design = Design(method="monte-carlo", n=200)

    @model_validator(mode="after")
    def _linked(self) -> "ModelChain":
        for label, model in self.models.items():
            if model.n is not None and model.n > self.design.n:
                raise ValueError(f"models.{label}.n is larger than design.n ({self.design.n})")
        try:
            find_steps(self.changes)
        except ValueError as error:
            raise ValueError(f"models: {error}") from None
        return self

    @property
    def changes(self) -> list[frozenset[str]]:
        """What each model does differently, in order."""
        return [frozenset(model.changes) for model in self.models.values()]
