"""The finite-element crash model."""
