"""Tests of single body parts, as dummies, volunteers and donors undergo them."""
