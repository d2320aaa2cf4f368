"""Injury-risk curves fitted to censored cases."""
