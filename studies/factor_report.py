"""What reports of studies that exchange factors have in common."""

from collections.abc import Mapping
from typing import Any

from mcstudy.figures import style


def groups_said(analysis: Mapping[str, Any]) -> str:
    """Say which inputs make up which factor."""
    if not analysis["groups"]:
        return "Every input is a factor of its own."
    text = "; ".join(
        f"{group}: {', '.join(style.words(name) for name in names)}"
        for group, names in analysis["groups"].items()
    )
    return f"Factors that are groups of inputs: {text}."
