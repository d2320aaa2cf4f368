"""Pipelines: each kind of study composes methods and models into one analysis."""
