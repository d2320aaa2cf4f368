"""Diagnosis: what a simulation gets wrong against measured tests, why, and what a cure gains."""
