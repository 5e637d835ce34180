"""SIREN value, gradient and mixed second derivative in the fewest matrix products, differentiated by hand."""
