"""The car: front profile, stiffness corridors and prescribed motion."""
