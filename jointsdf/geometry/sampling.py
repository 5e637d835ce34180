"""Random points on triangle meshes: uniform by area, or near the borders of parts."""

import igl
import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from numpy.random import Generator

from jointsdf.geometry.mesh import border_edges, half_longest_side
from jointsdf.values import LabelledMesh

BORDER_SCALES = (-3.3, -1.3)  # log10 of the narrowest and widest noise about a border, of half the longest side


def sample_by_area(
    vertices: Float[ndarray, "v 3"],
    faces: Int[ndarray, "f 3"],
    areas: Float[ndarray, " f"],
    count: int,
    generator: Generator,
) -> tuple[Float[ndarray, "n 3"], Int[ndarray, " n"]]:
    """Draw points uniform by area on a triangle mesh, by folding the unit square onto each face (Turk 1990).

    Args:
        vertices: Positions, any frame.
        faces: Vertex indices.
        areas: Of the faces, up to a common factor.
        count: Number of points.
        generator: Of the draw.

    Returns:
        The points, in the frame of the vertices, and the face of each.
    """
    chosen = _draw_weighted(areas, count, generator)
    s, t = generator.random((2, count, 1))
    s, t = np.where(s + t > 1, 1 - s, s), np.where(s + t > 1, 1 - t, t)
    a, b, c = vertices[faces[chosen].T].astype(np.float64)
    return a + s * (b - a) + t * (c - a), chosen


def sample_near_borders(
    mesh: LabelledMesh, count: int, generator: Generator
) -> tuple[Float[ndarray, "n 3"], Int[ndarray, " n"]]:
    """Draw points of the surface near the borders between its parts; none where there is no border.

    Points uniform along the borders are moved by Gaussian noise, its width drawn log-uniform so that every distance
    from the border occurs, and projected back to the surface.

    Args:
        mesh: Any frame.
        count: Number of points.
        generator: Of the draw.

    Returns:
        The points, in the mesh's frame, and the face of each.
    """
    edges = border_edges(mesh)
    if len(edges) == 0:
        return np.zeros((0, 3)), np.zeros(0, dtype=np.int64)
    start, end = mesh.vertices[edges.T].astype(np.float64)
    chosen = _draw_weighted(np.linalg.norm(end - start, axis=1), count, generator)
    along = start[chosen] + generator.random((count, 1)) * (end - start)[chosen]
    widths = half_longest_side(mesh) * 10 ** generator.uniform(*BORDER_SCALES, (count, 1))
    moved = along + widths * generator.standard_normal((count, 3))
    vertices, faces = mesh.vertices.astype(np.float64), mesh.faces.astype(np.int64)
    _, nearest, points = igl.point_mesh_squared_distance(
        moved, np.ascontiguousarray(vertices), np.ascontiguousarray(faces)
    )
    return points, nearest.astype(np.int64)


def _draw_weighted(weights: Float[ndarray, " w"], count: int, generator: Generator) -> Int[ndarray, " n"]:
    """Draw indices in proportion to the weights."""
    cumulative = np.cumsum(weights)
    chosen = np.searchsorted(cumulative, generator.random(count) * cumulative[-1], side="right")
    return np.minimum(chosen, len(weights) - 1)
