"""Point clouds as shapes: their files, labels and report."""
