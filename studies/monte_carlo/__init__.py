"""The Monte Carlo study."""
