"""Study files: what a user writes, checked."""
