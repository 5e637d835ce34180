"""Triangulation of polygons: a fan where they are convex, ear clipping elsewhere, with every corner used."""

import logging

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from jointsdf.shapes.readers.ear_clipping import cut_polygons, make_fans

STRAIGHT = 1e-6  # radians: a corner that turns no further lies on an edge, and a fan may leave it without area

logger = logging.getLogger(__name__)


def triangulate(
    vertices: Float[ndarray, "v 3"], corners: Int[ndarray, " c"], sizes: Int[ndarray, " p"], source: str = "mesh"
) -> tuple[Int[ndarray, "f 3"], Int[ndarray, " f"] | None]:
    """Triangulate polygons, each of n corners into n - 2 triangles of its winding, so that no T-junction arises.

    Convex polygons, seen along their Newell normal, become a fan about their first corner; all others are cut by ear
    clipping in the plane of that normal. Polygons that use a vertex out of range, or of infinite coordinates, stay
    fans: `check_mesh` refuses them.

    Args:
        vertices: Positions.
        corners: Vertices of all polygons, one polygon after another.
        sizes: Number of corners of each polygon, at least 3.
        source: Names the mesh in warnings.

    Returns:
        Triangles in the polygons' order, and the polygon of each; None where all polygons are triangles.
    """
    if (sizes == 3).all():
        return corners.reshape(-1, 3).astype(np.int64), None
    cut, polygons = make_fans(sizes), np.repeat(np.arange(len(sizes)), sizes - 2)
    if corners.min() >= 0 and corners.max() < len(vertices) and np.isfinite(points := vertices[corners]).all():
        points = points / max(float(np.abs(points).max()), np.finfo(float).tiny)
        normals, convex = _measure(points, np.cumsum(sizes) - sizes, sizes)
        if not convex.all():
            odd = np.flatnonzero(~np.repeat(convex, sizes))
            places, simple = cut_polygons(points[odd], sizes[~convex], normals[~convex])
            cut[~convex[polygons]] = odd[places]
            _warn_of_crossings(source, simple, len(sizes))
    return corners[cut].astype(np.int64), polygons


def _warn_of_crossings(source: str, simple: Bool[ndarray, " k"], count: int) -> None:
    """Warn of polygons that cross themselves."""
    if crossing := int((~simple).sum()):
        logger.warning(
            "%s: %d of %d polygons cross themselves: where their inside is, is a guess", source, crossing, count
        )


def _measure(
    points: Float[ndarray, "c 3"], starts: Int[ndarray, " p"], sizes: Int[ndarray, " p"]
) -> tuple[Float[ndarray, "p 3"], Bool[ndarray, " p"]]:
    """Newell normal of each polygon, as long as twice its area, and whether a fan cuts it.

    A polygon is convex where it turns to the left at every corner, and once around in all.

    Args:
        points: Corners of all polygons.
        starts: First corner of each.
        sizes: Number of corners of each.
    """
    owner = np.repeat(np.arange(len(sizes)), sizes)
    following = np.arange(1, len(points) + 1)
    following[starts + sizes - 1] = starts
    at = np.ascontiguousarray(points.T)  # coordinates apart: several times as fast
    at = at - at[:, starts][:, owner]
    normals = np.add.reduceat(_cross(at, at[:, following]), starts, axis=1)
    lengths = np.sqrt((normals**2).sum(axis=0))
    upward = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)[:, owner]
    before = at[:, following] - at
    rise = (before * upward).sum(axis=0)
    after, next_rise = before[:, following], rise[following]
    turn = (_cross(before, after) * upward).sum(axis=0)
    angles = np.arctan2(turn, (before * after).sum(axis=0) - rise * next_rise)
    convex = (np.minimum.reduceat(angles, starts) > STRAIGHT) & (np.add.reduceat(angles, starts) < 3 * np.pi)
    return normals.T, convex | (sizes == 3)


def _cross(a: Float[ndarray, "3 c"], b: Float[ndarray, "3 c"]) -> Float[ndarray, "3 c"]:
    """Cross product of each pair of columns."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
