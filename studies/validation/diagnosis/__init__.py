"""Validation of the diagnosis: effects are hidden in data and must be found."""
