"""Units of the criteria."""

STANDARD_GRAVITY = 9.80665
"""m/s2 in one g (exact by convention, 3rd CGPM 1901)."""
