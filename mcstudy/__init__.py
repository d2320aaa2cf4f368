"""Methods: what one does with any crash model."""
