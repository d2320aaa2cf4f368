"""Sensitivity from the runs of any results folder."""
