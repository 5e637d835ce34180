"""Evaluation: scores of a reconstruction, and reference scores (sampling floor, grid ceiling)."""

from jointsdf.evaluation.protocol import Protocol

__all__ = ["Protocol"]
