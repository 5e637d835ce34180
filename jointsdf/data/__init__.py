"""Ground truth -> training points of every step."""
