"""Validation of the diagnosis: detection of effects hidden in data."""
