"""The Sobol' study."""
