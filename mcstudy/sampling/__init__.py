"""Sampling designs in the unit cube."""
