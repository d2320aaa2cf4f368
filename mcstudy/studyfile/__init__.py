"""Study files: schema, checks, input space."""
