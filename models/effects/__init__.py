"""Named physical effects that extend a model; off unless they are switched on."""
