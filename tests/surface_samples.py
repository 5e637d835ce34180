"""Small meshes and samples of them."""

import numpy as np
import trimesh
from labelled_meshes import EMPTY
from solids import labelled

from jointsdf.evaluation.protocol import sample_surface
from jointsdf.values import LabelledMesh, SurfaceSamples

NO_SAMPLES = sample_surface(EMPTY, 10, 0)


def cloud(points, labels=None, normals=None) -> SurfaceSamples:
    """Samples that are a mesh of their own: one tiny triangle per point, so that any label per point is possible."""
    points = np.asarray(points, dtype=float)
    count = len(points)
    labels = np.zeros(count, dtype=np.int64) if labels is None else np.asarray(labels)
    normals = np.tile([0.0, 0.0, 1.0], (count, 1)) if normals is None else normals
    corners = points[:, None] + 1e-9 * np.array([[1, 0, 0], [0, 1, 0], [-1, -1, 0]])
    faces = np.arange(3 * count).reshape(-1, 3)
    return SurfaceSamples(LabelledMesh(corners.reshape(-1, 3), faces, labels), points, normals, np.arange(count))


def directions(rng, count):
    vectors = rng.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def cube(shift=(0.0, 0.0, 0.0), labels=None) -> LabelledMesh:
    box = trimesh.creation.box(extents=(1, 1, 1))
    box.apply_translation(shift)
    return labelled(box, labels)


def plate(border_at) -> LabelledMesh:
    """The square [0, 1]^2 in cells of 0.005 x 0.02; label 1 where x > border_at(y), which must fall on cell lines."""
    x, y = np.meshgrid(np.linspace(0, 1, 201), np.linspace(0, 1, 51), indexing="ij")
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    first = (np.arange(200)[:, None] * 51 + np.arange(50)).reshape(-1)
    faces = np.stack([first, first + 51, first + 52, first, first + 52, first + 1], axis=1).reshape(-1, 3)
    centre = vertices[faces].mean(axis=1)
    return LabelledMesh(vertices, faces, (centre[:, 0] > border_at(centre[:, 1])).astype(np.int64))


def score(metric, predicted: LabelledMesh, truth: LabelledMesh, count=2000) -> dict[str, float]:
    return metric(sample_surface(predicted, count, 1), sample_surface(truth, count, 2))
