"""Programs that make example data, gallery figures and calibrated values."""
