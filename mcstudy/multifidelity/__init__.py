"""Multi-fidelity Monte Carlo: the distribution of a dear model with the help of cheap ones."""
