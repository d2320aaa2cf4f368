"""How runs are done, watched and kept."""
