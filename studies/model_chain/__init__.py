"""The model chain: models that differ in one thing at a time, on the same draws."""
