"""Diagnosis of a model against measured tests: ``mcstudy diagnose``."""
