"""Methods for uncertainty quantification with any crash model."""
