"""Car fronts of shells: panels, their generator, the reader of a user's own deck."""
