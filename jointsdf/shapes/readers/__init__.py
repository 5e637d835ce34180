"""Mesh, STEP and ABC files -> triangles and B-rep patches."""
