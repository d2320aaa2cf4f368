"""Injury criteria and crash measures computed from time histories."""

from models.criteria.clip import clip_level
from models.criteria.filters import filter_cfc
from models.criteria.hic import head_injury_criterion
from models.criteria.impact import contact_window, effective_mass, impact_angle
from models.criteria.rotation import brain_injury_criterion

__all__ = [
    "brain_injury_criterion",
    "clip_level",
    "contact_window",
    "effective_mass",
    "filter_cfc",
    "head_injury_criterion",
    "impact_angle",
]
