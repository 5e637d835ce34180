"""Scores of a reconstruction, and the reference scores that they are read against."""
