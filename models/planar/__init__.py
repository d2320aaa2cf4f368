"""The planar crash model: the body restricted to the plane of the car's travel, with Pymunk."""
