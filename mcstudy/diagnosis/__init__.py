"""Diagnosis of model discrepancy against measured tests: adequacy, causes, predictive gain."""
