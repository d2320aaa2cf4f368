"""Crash models behind one protocol: pedestrian, vehicle, contact and the solvers."""
