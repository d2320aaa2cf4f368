"""The reconstruction: one run, compared with published tables and drawn."""
