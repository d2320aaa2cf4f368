"""Car surfaces of facets: meshes, their generator and readers, and the distance to them."""
