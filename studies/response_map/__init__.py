"""The map of outputs over two inputs."""
