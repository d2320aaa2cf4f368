"""The posterior study: what evidence says of the speed, or of any other quantity of a crash."""
