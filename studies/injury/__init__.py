"""The injury study."""
