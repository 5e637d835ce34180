"""Value, gradient and mixed second derivative of a SIREN in the fewest matrix products, backward by hand."""
