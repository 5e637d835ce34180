"""Marching cubes in slabs against scikit-image over the whole grid, and level sets through grid points."""

import numpy as np
import pytest
from level_sets import Sdf, as_trimesh, drilled_box, plate, torus
from scipy.spatial import KDTree
from skimage.measure import marching_cubes

from jointsdf.extraction.extractor import Extraction
from jointsdf.values import BOX


@pytest.mark.parametrize(
    ("sdf", "resolution"),
    [(drilled_box, 97), (torus, 97), (plate, 97), pytest.param(drilled_box, 256, marks=pytest.mark.slow)],
)
def test_mesh_is_that_of_marching_cubes_over_the_whole_grid_at_once(sdf: Sdf, resolution: int) -> None:
    """Same vertices, same faces, both up to order: slabs are welded as if there were none."""
    axis = np.linspace(-BOX, BOX, resolution).astype(np.float32)
    points = axis[np.indices((resolution,) * 3).reshape(3, -1).T]
    values = np.concatenate([sdf(part) for part in np.array_split(points, 64)]).astype(np.float32)
    vertices, faces, *_ = marching_cubes(values.reshape((resolution,) * 3), 0.0, allow_degenerate=False)
    vertices = vertices.astype(np.float64) * (2 * BOX / (resolution - 1)) - BOX
    found = Extraction(resolution).surface(sdf)
    distance, which = KDTree(vertices).query(found.vertices)
    assert distance.max() < 1e-7  # float32 of a whole grid's coordinate
    assert len(np.unique(which)) == len(which) == len(vertices)
    assert {frozenset(face) for face in which[found.faces].tolist()} == {frozenset(face) for face in faces.tolist()}
    assert as_trimesh(found).volume > 0


@pytest.mark.parametrize("method", ["sparse", "dense"])
def test_zeros_at_grid_points_leave_no_degenerate_face(method: str) -> None:
    step = np.float32(2 * BOX / 32)
    surface = Extraction(33, method).surface(lambda points: np.abs(np.rint(points / step)).sum(axis=1) - 9)
    mesh = as_trimesh(surface)
    assert mesh.is_watertight
    assert mesh.euler_number == 2
    assert mesh.area_faces.min() > 1e-6
    assert mesh.volume == pytest.approx(4 / 3 * (9 * float(step)) ** 3, rel=1e-6)  # an octahedron


def test_a_single_zero_is_an_empty_mesh() -> None:
    def touching(points: np.ndarray) -> np.ndarray:
        return np.rint(np.abs(points).sum(axis=1) / (2 * BOX / 16))

    assert len(Extraction(17).surface(touching).faces) == 0
