"""Random points on meshes: uniform by area, as many of every part, near the borders of parts, or beside creases."""

import igl
import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from numpy.random import Generator

from jointsdf.geometry.creases import REACH, find_creases
from jointsdf.geometry.distance import ClosestPoint
from jointsdf.geometry.mesh import border_edges, face_areas, face_normals, half_longest_side
from jointsdf.values import LabelledMesh

BORDER_SCALES = (-3.3, -1.3)  # log10 of the narrowest and widest noise about a border, of half the longest side


BESIDE = (0.001, 0.008)  # distances from a crease, of half the longest side: 0.1 to 0.9 cells of a grid of 256
FARTHEST = 0.1  # of the distance from the crease: how far a point may be moved by its projection
SAME_SIDE = 0.9  # least cosine between the normal of the face that a point lands on and that of its side


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


def sample_parts(
    mesh: LabelledMesh, count: int, generator: Generator
) -> tuple[Float[ndarray, "n 3"], Int[ndarray, " n"]]:
    """Draw equally many points of every part, uniform by area on each: stratified sampling with equal allocation.

    Args:
        mesh: Any frame.
        count: Points over all parts, rounded down to a multiple of their number, but one of each at least; 0 for none.
        generator: Of the draw.

    Returns:
        The points, in the mesh's frame, and the face of each: part after part, none of unlabelled faces.
    """
    areas = face_areas(mesh)
    points, faces = [np.zeros((0, 3))], [np.zeros(0, dtype=np.int64)]
    for part in mesh.part_ids if count else ():
        own, each = np.flatnonzero(mesh.labels == part), max(1, count // len(mesh.part_ids))
        at, chosen = sample_by_area(mesh.vertices, mesh.faces[own], areas[own], each, generator)
        points.append(at)
        faces.append(own[chosen])
    return np.concatenate(points), np.concatenate(faces)


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


def sample_beside_creases(
    mesh: LabelledMesh, count: int, generator: Generator
) -> tuple[Float[ndarray, "n 3"], Int[ndarray, " n"]]:
    """Draw points of the surface close to its creases, uniform along them, on one or the other side.

    A point on the crease is moved by `BESIDE` in the plane of one side, away from the crease, and projected to the
    surface. What lands elsewhere is left out, as on a narrower wall: there are fewer points then.

    Args:
        mesh: Any frame.
        count: Number of points.
        generator: Of the draw.

    Returns:
        The points, in the mesh's frame, and the face of each; none where there is no crease.
    """
    half = half_longest_side(mesh)
    creases = find_creases(mesh, REACH * 2 * half) if count else None
    if creases is None or len(creases.starts) == 0:
        return np.zeros((0, 3)), np.zeros(0, dtype=np.int64)
    along = creases.ends - creases.starts
    lengths = np.linalg.norm(along, axis=1)
    chosen = _draw_weighted(lengths, count, generator)
    start = creases.starts[chosen] + generator.random((count, 1)) * along[chosen]
    normals = creases.normals[chosen, generator.integers(2, size=count)]
    away = np.cross(along[chosen], normals)
    offsets = half * generator.uniform(*BESIDE, count)
    away *= (offsets / np.linalg.norm(away, axis=1))[:, None]
    moved = np.stack([start + away, start - away])  # one of them is on the surface, nearly
    surface = ClosestPoint(mesh)
    distances, faces = (found.reshape(2, count) for found in surface.query(moved.reshape(-1, 3)))
    agree = np.einsum("snd,nd->sn", face_normals(mesh.vertices, mesh.faces)[faces], normals) > SAME_SIDE
    agree &= distances < FARTHEST * offsets
    side = np.where(agree, distances, np.inf).argmin(axis=0)
    kept = np.flatnonzero(agree.any(axis=0))
    side = side[kept]
    return surface.nearest(moved[side, kept]), faces[side, kept]


def _draw_weighted(weights: Float[ndarray, " w"], count: int, generator: Generator) -> Int[ndarray, " n"]:
    """Draw indices in proportion to the weights."""
    cumulative = np.cumsum(weights)
    chosen = np.searchsorted(cumulative, generator.random(count) * cumulative[-1], side="right")
    return np.minimum(chosen, len(weights) - 1)
