"""The facet model: a car of facets and a body of facets on the multibody tree."""
