"""Figures of a study: plots of rows, loss curves, pictures of meshes, and their command line."""
