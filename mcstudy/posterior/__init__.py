"""Posterior of inputs given evidence, from a bank of runs: weights, draws, calibration, ratios."""
