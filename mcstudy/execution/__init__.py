"""Execution of runs: workers, progress, results folders."""
