"""Measurements: folders of measured data and ISO-MME tests."""
