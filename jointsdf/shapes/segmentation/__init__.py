"""Geometric segmentation: smooth regions merged hierarchically into parts."""
