"""The Morris study."""
