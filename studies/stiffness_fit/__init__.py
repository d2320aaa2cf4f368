"""Stiffness from headform tests: a curve per test, their corridor, and the resulting HIC15."""
