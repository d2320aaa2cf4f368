"""The comparison of models: the same inputs through two or more methods."""
