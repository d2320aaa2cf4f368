"""Sensitivity: how much of an output's variance each input explains."""
