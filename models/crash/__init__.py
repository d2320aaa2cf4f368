"""Code shared by all crash models: scenario, contact forces on the segments, record, outputs."""
