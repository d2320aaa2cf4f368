"""The headform impactor test: a free headform strikes a point of the car's front."""
