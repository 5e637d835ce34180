"""Signed distances of analytic shapes about the origin, negative inside, for numpy arrays and torch tensors alike."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
import torch
from torch import Tensor

Points = TypeVar("Points", np.ndarray, Tensor)


def box_distance(points: Points, half: Sequence[float] | np.ndarray) -> Points:
    """Of an axis-aligned box, by half its extents (Quilez, "Distance functions")."""
    if isinstance(points, Tensor):
        beyond = points.abs() - torch.as_tensor(half, dtype=points.dtype)
        return beyond.clamp_min(0).norm(dim=-1) + beyond.max(dim=-1).values.clamp_max(0)
    beyond = np.abs(points) - np.asarray(half)
    return np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)


def sphere_distance(points: Points, radius: float) -> Points:
    """Of a ball."""
    if isinstance(points, Tensor):
        return points.norm(dim=-1) - radius
    return np.linalg.norm(points, axis=1) - radius


def cylinder_distance(points: Points, radius: float) -> Points:
    """Of an infinite cylinder about the z axis."""
    return sphere_distance(points[:, :2], radius)


def torus_distance(points: np.ndarray, ring: float, tube: float) -> np.ndarray:
    """Of a torus about the z axis, by the radii of its ring and of its tube."""
    return np.hypot(np.hypot(points[:, 0], points[:, 1]) - ring, points[:, 2]) - tube
