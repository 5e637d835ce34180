"""Scores of a reconstruction, and the reference scores that they are read against."""

from jointsdf.evaluation.protocol import Protocol

__all__ = ["Protocol"]
