"""Optimisation of one field: objective, loop, checkpoints, matrix products."""
