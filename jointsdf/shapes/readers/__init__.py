"""Readers of mesh, STEP and ABC files: triangles and B-rep patches."""
