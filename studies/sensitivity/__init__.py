"""Given-data sensitivity from the runs of a results folder."""
