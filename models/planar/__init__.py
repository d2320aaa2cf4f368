"""The planar crash model: the body held in the plane of the car's travel, stepped by Pymunk."""
