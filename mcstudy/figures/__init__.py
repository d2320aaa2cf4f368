"""Figures: one style, units on every axis, colours safe for colour-blind readers."""
