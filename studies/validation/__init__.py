"""Validation: the models against closed forms, published numbers and measurements.

One module a part; ``parts.py`` lists them, ``references.toml`` holds the references.
"""
