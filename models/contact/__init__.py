"""Contact: force-penetration laws and the geometry of ellipsoids against surfaces."""
