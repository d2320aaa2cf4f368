"""Named physical effects that extend a model; off unless switched on."""
