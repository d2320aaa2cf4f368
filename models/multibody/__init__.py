"""The three-dimensional multibody core: ellipsoid segments, spherical joints, compliant contact."""
