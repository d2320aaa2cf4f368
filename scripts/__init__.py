"""Programs that make what the project ships: example data, pictures, calibrated values."""
