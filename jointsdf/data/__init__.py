"""Training points of every step, drawn from a ground-truth shape."""
