"""The reconstruction: one run, printed beside published tables and drawn."""
