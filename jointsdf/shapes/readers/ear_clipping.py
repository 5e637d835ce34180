"""Ear clipping of polygons, also concave ones, those with corners on their edges, and those with a bridge to a hole.

Sources: the library mapbox_earcut, which leaves out corners that lie on an edge; where it does, Meisters' two-ears
theorem, "Polygons have ears", American Mathematical Monthly 82 (1975), with the ear of the best shape first.
"""

import mapbox_earcut
import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

THIN = 1e-6  # height of a triangle without area, of its longest side
NEAR = (1e-6, 0.0)  # distances at which a corner is on an edge, of the polygon's extent: the second if no ear is left


def cut_polygons(
    points: Float[ndarray, "c 3"], sizes: Int[ndarray, " p"], normals: Float[ndarray, "p 3"]
) -> tuple[Int[ndarray, "t 3"], Bool[ndarray, " p"]]:
    """Cut polygons of n corners into n - 2 triangles that use each corner; those without area into fans.

    Args:
        points: Corners of all polygons, one polygon after another.
        sizes: Number of corners of each polygon, at least 3.
        normals: Newell normals, as long as twice the area; a polygon is counter-clockwise seen against its own.

    Returns:
        Corners of each triangle by their place in `points`, wound like the polygon, and False for the polygons that
        cross themselves, which have no inside.
    """
    starts, firsts = np.cumsum(sizes) - sizes, np.cumsum(sizes - 2) - (sizes - 2)
    extents = (np.maximum.reduceat(points, starts) - np.minimum.reduceat(points, starts)).max(axis=1)
    has_area = np.linalg.norm(normals, axis=1) > THIN * extents**2
    flat = _project(points, sizes, normals, extents)
    cut = make_fans(sizes)
    whole = np.zeros(len(sizes), dtype=bool)
    for polygon in np.flatnonzero(has_area).tolist():
        start, size, first = starts[polygon], sizes[polygon], firsts[polygon]
        found = mapbox_earcut.triangulate_float64(flat[start : start + size], np.array([size], dtype=np.uint32))
        if len(found) == 3 * (size - 2):
            cut[first : first + size - 2] = found.reshape(-1, 3) + start
            whole[polygon] = True
    whole &= np.minimum.reduceat(_shape(flat, cut), firsts) > THIN
    for polygon in np.flatnonzero(has_area & ~whole).tolist():
        start, size, first = starts[polygon], sizes[polygon], firsts[polygon]
        cut[first : first + size - 2] = clip_ears(flat[start : start + size]) + start
    area = _doubled_area(flat, cut)
    a, b, c = points[cut].transpose(1, 0, 2)
    of_flat = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    excess = np.where(
        has_area,
        np.add.reduceat(np.abs(area) - area, firsts),
        np.add.reduceat(of_flat, firsts) / np.maximum(extents**2, np.finfo(float).tiny),
    )
    return cut, excess <= 4 * THIN * sizes


def make_fans(sizes: Int[ndarray, " p"]) -> Int[ndarray, "t 3"]:
    """Triangles of each polygon about its first corner, by the place of the corners among those of all polygons."""
    owner = np.repeat(np.arange(len(sizes)), sizes - 2)
    step = np.arange(len(owner)) - (np.cumsum(sizes - 2) - (sizes - 2))[owner]
    return np.stack([np.zeros_like(step), step + 1, step + 2], axis=1) + (np.cumsum(sizes) - sizes)[owner, None]


def clip_ears(points: Float[ndarray, "n 2"]) -> Int[ndarray, "t 3"]:
    """Clip ears, always the one of the best shape; a polygon that crosses itself also gives triangles.

    Args:
        points: Corners, counter-clockwise, extent about 1.
    """
    positions = np.unique(points, axis=0, return_inverse=True)[1].reshape(-1)
    ring = np.arange(len(points))
    worth = np.full(len(ring), -np.inf)
    triangles = []
    while len(ring) > 3:
        for near in NEAR:
            if worth.max() == -np.inf:
                worth = np.array([_value_ear(points, positions, ring, at, near) for at in range(len(ring))])
        ears = np.stack([np.roll(ring, 1), ring, np.roll(ring, -1)], axis=1)
        tip = int(worth.argmax() if worth.max() > -np.inf else _shape(points, ears).argmax())
        triangles.append(ears[tip])
        ring, worth = np.delete(ring, tip), np.delete(worth, tip)
        for place in (tip - 1, tip % len(ring)):
            worth[place] = _value_ear(points, positions, ring, place, NEAR[0])
    return np.array([*triangles, ring])


def _value_ear(
    points: Float[ndarray, "n 2"], positions: Int[ndarray, " n"], ring: Int[ndarray, " r"], place: int, near: float
) -> float:
    """Shape of a corner's triangle; -inf where it has no area, or another corner lies in it or on its edges.

    Args:
        points: Corners of the polygon.
        positions: A number for each corner, the same for those at one position.
        ring: Corners that are left.
        place: Of the corner in `ring`.
        near: Distance at which a corner is on an edge.
    """
    ear = ring[[place - 1, place, (place + 1) % len(ring)]]
    shape = float(_shape(points, ear[None])[0])
    if shape <= THIN:
        return -np.inf
    triangle, others = points[ear], points[ring]
    low, high = triangle.min(axis=0) - near, triangle.max(axis=0) + near
    others = others[((others >= low) & (others <= high)).all(axis=1) & ~np.isin(positions[ring], positions[ear])]
    inside = np.ones(len(others), dtype=bool)
    for start, end in zip(triangle, np.roll(triangle, -1, axis=0), strict=True):
        (x, y), (dx, dy) = (others - start).T, end - start
        inside &= dx * y - dy * x >= -near * np.hypot(dx, dy)
    return -np.inf if inside.any() else shape


def _shape(points: Float[ndarray, "n 2"], triangles: Int[ndarray, "t 3"]) -> Float[ndarray, " t"]:
    """Height over the longest side of each triangle, negative where it is clockwise."""
    sides = points[triangles] - points[np.roll(triangles, 1, axis=1)]
    longest = (sides**2).sum(axis=2).max(axis=1, initial=0)
    return np.divide(_doubled_area(points, triangles), longest, out=np.zeros(len(triangles)), where=longest > 0)


def _doubled_area(points: Float[ndarray, "n 2"], triangles: Int[ndarray, "t 3"]) -> Float[ndarray, " t"]:
    """Twice the area of each triangle, negative where it is clockwise."""
    a, b, c = points[triangles].transpose(1, 2, 0)
    doubled: Float[ndarray, " t"] = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    return doubled


def _project(
    points: Float[ndarray, "c 3"],
    sizes: Int[ndarray, " p"],
    normals: Float[ndarray, "p 3"],
    extents: Float[ndarray, " p"],
) -> Float[ndarray, "c 2"]:
    """Coordinates in the plane of each polygon, from its first corner, in its extent; 0 where it has no plane."""
    first = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])
    second = np.cross(normals, first)
    owner = np.repeat(np.arange(len(sizes)), sizes)
    offsets = points - points[np.cumsum(sizes) - sizes][owner]
    flat = np.zeros((len(points), 2))
    for axis, direction in enumerate((first, second)):
        length = np.linalg.norm(direction, axis=1) * extents
        scaled = np.divide(direction, length[:, None], out=np.zeros_like(direction), where=length[:, None] > 0)
        flat[:, axis] = np.einsum("ij,ij->i", offsets, scaled[owner])
    return flat
