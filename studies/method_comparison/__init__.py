"""The method comparison: one case through several methods, each run once."""
