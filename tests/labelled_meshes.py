"""Cubes and spheres with part labels."""

from collections.abc import Callable

import numpy as np
import trimesh

from jointsdf.values import LabelledMesh

EMPTY = LabelledMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64), np.zeros(0, dtype=np.int64))


def box(part: Callable[[np.ndarray], np.ndarray], size: float = 1.0) -> LabelledMesh:
    """A cube whose faces are labelled from their normals."""
    mesh = trimesh.creation.box(extents=[size] * 3)
    return LabelledMesh(np.array(mesh.vertices), np.array(mesh.faces), part(np.array(mesh.face_normals)))


def by_side(normals: np.ndarray) -> np.ndarray:
    return (10 * np.argmax(np.abs(normals), axis=1) + (normals.sum(axis=1) > 0)).astype(np.int64)


def sphere(radius: float, subdivisions: int = 4) -> LabelledMesh:
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    labels = (np.array(mesh.triangles_center)[:, 2] > 0).astype(np.int64)
    return LabelledMesh(np.array(mesh.vertices), np.array(mesh.faces), labels)
