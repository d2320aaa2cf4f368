"""Sentences common to the reports of Morris and Sobol' studies."""

from mcstudy.figures import style
from studies.factor_kind import FactorAnalysis


def groups_said(analysis: FactorAnalysis) -> str:
    """Return a sentence on the inputs of each factor."""
    if not analysis.groups:
        return "Every input is a separate factor."
    text = "; ".join(
        f"{group}: {', '.join(style.words(name) for name in names)}"
        for group, names in analysis.groups.items()
    )
    return f"Factors that are groups of inputs: {text}."
