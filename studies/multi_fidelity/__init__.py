"""Multi-fidelity Monte Carlo: the distribution of a dear model at the price of cheap ones."""
