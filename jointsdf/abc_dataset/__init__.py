"""Meshes and B-rep patches of the catalogue's ABC shapes, from files or archives of the dataset, or by download."""
