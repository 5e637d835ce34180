"""Columns of triangles: colours, numbers of their vertices, numbers of the polygons that they were cut from."""

import logging
from collections.abc import Mapping

import numpy as np
from jaxtyping import Float, Int, Shaped
from numpy import ndarray

from jointsdf.shapes.readers.file_mesh import FaceColumn, FileMesh, number_names
from jointsdf.shapes.readers.polygons import triangulate

COLOUR = "colour"

logger = logging.getLogger(__name__)


def polygon_mesh(
    source: str,
    vertices: Float[ndarray, "v 3"],
    corners: Int[ndarray, " c"],
    sizes: Int[ndarray, " p"],
    columns: Mapping[str, FaceColumn],
) -> FileMesh:
    """Cut polygons into triangles, each with its polygon's numbers; warn of faces of fewer than three corners.

    Args:
        source: Names the mesh in messages.
        vertices: Positions.
        corners: Vertices of all polygons, one polygon after another.
        sizes: Number of corners of each polygon.
        columns: Of the polygons.
    """
    proper = sizes >= 3
    if not proper.all():
        logger.warning("%s: %d faces of fewer than three corners are left out", source, int((~proper).sum()))
        corners, sizes = corners[np.repeat(proper, sizes)], sizes[proper]
        columns = {name: FaceColumn(each.values[proper], each.are_ids) for name, each in columns.items()}
    faces, polygons = triangulate(vertices, corners, sizes, source)
    if polygons is not None:
        columns = {name: FaceColumn(each.values[polygons], each.are_ids) for name, each in columns.items()}
    return FileMesh(vertices, faces, polygons=polygons, columns=columns)


def number_colours(colours: Shaped[ndarray, "n c"]) -> Int[ndarray, " n"]:
    """Number distinct colours in the order of their first appearance.

    >>> number_colours(np.array([[9, 0, 0], [0, 0, 0], [9, 0, 0]]))
    array([0, 1, 0])
    """
    return number_names(np.unique(colours, axis=0, return_inverse=True)[1].reshape(-1))


def majority(of_vertices: Shaped[ndarray, " v"], faces: Int[ndarray, "f 3"]) -> Shaped[ndarray, " f"]:
    """The number that most corners of each triangle have, the first corner's where all three differ.

    >>> majority(np.array([5, 7, 7, 9]), np.array([[0, 1, 2], [0, 1, 3]]))
    array([7, 5])
    """
    a, b, c = of_vertices[faces].T
    most: Shaped[ndarray, " f"] = np.where(b == c, b, a)
    return most


def are_inside(mesh: FileMesh) -> bool:
    """Whether there are faces, and none uses a vertex out of range."""
    return bool(mesh.faces.size and mesh.faces.min() >= 0 and mesh.faces.max() < len(mesh.vertices))
