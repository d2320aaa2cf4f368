"""What evidence says on the runs of any sampled results folder, and contours of these runs."""
