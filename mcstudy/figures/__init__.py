"""Figures: one style, units on every axis, colours that the colour-blind can tell apart."""
