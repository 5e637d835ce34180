"""Bodies put together and damaged, and the signs of the distance to what is loaded of them."""

from collections.abc import Callable

import numpy as np
import trimesh
from trimesh.transformations import translation_matrix

from jointsdf.geometry.distance import ExactDistance
from jointsdf.shapes.arrays import from_arrays
from jointsdf.values import Shape

Inside = Callable[[np.ndarray], np.ndarray]


def box(size: float | tuple[float, ...], at: tuple[float, ...] = (0, 0, 0), *, inverted: bool = False):
    """A box by its extents and its middle."""
    mesh = trimesh.creation.box(np.broadcast_to(size, 3), transform=translation_matrix(at))
    if inverted:
        mesh.invert()
    return mesh


def in_box(size: float | tuple[float, ...], at: tuple[float, ...] = (0, 0, 0)) -> Inside:
    return lambda points: (np.abs(points - at) < np.broadcast_to(size, 3) / 2).all(axis=1)


def joined(*meshes: trimesh.Trimesh) -> tuple[np.ndarray, np.ndarray]:
    both = trimesh.util.concatenate(meshes)
    return np.array(both.vertices), np.array(both.faces)


def loaded(vertices: np.ndarray, faces: np.ndarray) -> Shape:
    return from_arrays(vertices, faces, labels="none", name="it")


def signed(shape: Shape, points: np.ndarray) -> np.ndarray:
    return ExactDistance(shape.mesh, watertight=shape.watertight, folded=shape.folded).signed(points)


def points_about(shape: Shape, count: int = 20000) -> np.ndarray:
    """Points uniform in a box a little larger than the mesh's, and near the surface."""
    generator = np.random.default_rng(7)
    low, high = shape.mesh.vertices.min(axis=0), shape.mesh.vertices.max(axis=0)
    size = (high - low).max()
    anywhere = generator.uniform(low - 0.1 * size, high + 0.1 * size, (count, 3))
    surface = trimesh.Trimesh(shape.mesh.vertices, shape.mesh.faces, process=False)
    on, _ = trimesh.sample.sample_surface(surface, count, seed=7)
    return np.concatenate([anywhere, on + 0.01 * size * generator.standard_normal((count, 3))])


def wrong_signs(shape: Shape, inside: Inside) -> float:
    """Share of the points on the wrong side."""
    points = points_about(shape)
    return float(((signed(shape, points) < 0) != inside(points)).mean())
