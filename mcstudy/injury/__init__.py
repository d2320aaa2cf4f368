"""Injury: risk functions, AIS outcomes, and injury-risk curves fitted to censored data."""
