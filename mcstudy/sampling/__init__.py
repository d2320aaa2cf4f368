"""Where in the unit cube a study samples."""
