"""Labelled meshes of simple solids."""

from collections.abc import Sequence
from math import pi, sin

import numpy as np
import trimesh
from analytic import box_distance

from jointsdf.values import LabelledMesh

DISC = 48 * sin(2 * pi / 96)  # area of a 96-sided disc by its squared radius: pi to 0.07%


def labelled(solid: trimesh.Trimesh, labels: Sequence[int] | np.ndarray | None = None) -> LabelledMesh:
    """The solid with these labels, or all 0."""
    labels = np.zeros(len(solid.faces)) if labels is None else np.asarray(labels)
    return LabelledMesh(np.array(solid.vertices), np.array(solid.faces), labels.astype(np.int64))


def halves(labels: tuple[int, int] = (4, 9)) -> LabelledMesh:
    """A box of sides 4, 2, 2 about (0.5, 0, 0); the plane x = 0.5 cuts it into two parts, the right one first."""
    box = trimesh.creation.box((4, 2, 2)).subdivide().subdivide().apply_translation((0.5, 0, 0))
    return labelled(box, np.where(box.triangles_center[:, 0] > 0.5, *labels))


def distance_to_halves(points: np.ndarray) -> np.ndarray:
    """Unsigned distance to the surface of `halves`."""
    return np.abs(box_distance(points - [0.5, 0, 0], [2, 1, 1]))


def strip(widths: Sequence[float], labels: Sequence[int], height: float = 1.0) -> LabelledMesh:
    """Rectangles side by side in the plane, two faces each, one label per rectangle."""
    x = np.concatenate([[0.0], np.cumsum(widths)])
    vertices = np.stack([np.repeat(x, 2), np.tile([0.0, height], len(x)), np.zeros(2 * len(x))], axis=1)
    first = 2 * np.arange(len(widths))[:, None]
    faces = np.concatenate([first + np.array(face) for face in ([0, 2, 1], [2, 3, 1])], axis=1).reshape(-1, 3)
    return LabelledMesh(vertices, faces, np.repeat(labels, 2))


def as_trimesh(mesh: LabelledMesh) -> trimesh.Trimesh:
    """The mesh without its labels."""
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


def volume(mesh: LabelledMesh) -> float:
    """Signed volume, by trimesh."""
    return float(as_trimesh(mesh).volume)
