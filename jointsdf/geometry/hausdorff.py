"""Two-sided distance between surfaces: where one of them is farther than a bound from the other, certified."""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from jointsdf.geometry.distance import ClosestPoint
from jointsdf.geometry.mesh import unit

ROUNDS = 48  # of cutting; what is undecided then is within rounding of the bound, and counts as beyond it
FLAT = 1e-9  # height below which a triangle is taken for its sides, of the longest side


def faces_beyond(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], other: ClosestPoint, bound: float
) -> Bool[ndarray, " f"]:
    """Faces with a point farther than a bound from another surface: one side of a bound on the Hausdorff distance.

    Branch and bound as of Tang, Lee and Kim ("Interactive Hausdorff distance computation for general polygonal models",
    SIGGRAPH 2009), by cuts that follow the other surface. The distance to one triangle is convex, so a piece of a face
    is within the bound if its corners are, of one triangle: the one closest to the piece's centroid. A piece with a
    centroid beyond the bound shows its face to be. Any other is cut along a side of that triangle.

    Args:
        vertices: Positions, in the frame of the other surface.
        faces: Vertex indices.
        other: The other surface.
        bound: Largest distance, same unit.
    """
    used, corner = np.unique(faces, return_inverse=True)
    far = other.query(vertices[used])[0] > bound
    beyond = np.asarray(far[corner.reshape(-1, 3)].any(axis=1))
    owners = np.flatnonzero(~beyond)
    pieces = vertices[faces[owners]]
    for _ in range(ROUNDS):
        if not len(pieces):
            break
        distances, nearest = other.query(pieces.mean(axis=1))
        beyond[owners[distances > bound]] = True
        triangles = other.vertices[other.faces[nearest]]
        inward = _inward_distances(pieces, triangles)
        within = _distances(pieces, triangles, inward, FLAT * other.size).max(axis=1) <= bound
        kept = ~within & ~beyond[owners]
        pieces, owners = _cut(pieces[kept], inward[kept], owners[kept], FLAT * other.size)
    beyond[owners] = True
    return beyond


def _inward_distances(points: Float[ndarray, "n k 3"], triangles: Float[ndarray, "n 3 3"]) -> Float[ndarray, "n k 3"]:
    """Distances of points from the three planes on a triangle's sides at right angles to it, positive inside."""
    along = np.roll(triangles, -1, axis=1) - triangles
    inward = unit(np.cross(_normals(triangles)[:, None], along))
    distances: Float[ndarray, "n k 3"] = points @ inward.swapaxes(1, 2) - (inward * triangles).sum(axis=2)[:, None]
    return distances


def _distances(
    points: Float[ndarray, "n k 3"],
    triangles: Float[ndarray, "n 3 3"],
    inward: Float[ndarray, "n k 3"],
    flat: float,
) -> Float[ndarray, "n k"]:
    """Distances of points from a triangle; from its sides, which are no nearer, where it is lower than `flat`."""
    normals = _normals(triangles)
    distances = np.abs((points @ normals[..., None])[..., 0] - (normals * triangles[:, 0]).sum(axis=1)[:, None])
    sides = np.roll(triangles, -1, axis=1) - triangles
    longest = np.sqrt((sides**2).sum(axis=2).max(axis=1))
    solid = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) > flat * longest
    outside, corner = np.nonzero((inward < 0).any(axis=2) | ~solid[:, None])
    along, offsets = sides[outside], points[outside, corner][:, None] - triangles[outside]
    squared = np.maximum((along**2).sum(axis=2), np.finfo(float).tiny)
    share = np.clip((along * offsets).sum(axis=2) / squared, 0, 1)
    distances[outside, corner] = np.sqrt(((offsets - share[..., None] * along) ** 2).sum(axis=2).min(axis=1))
    return distances


def _normals(triangles: Float[ndarray, "n 3 3"]) -> Float[ndarray, "n 3"]:
    return unit(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]))


def _cut(
    pieces: Float[ndarray, "n 3 3"], inward: Float[ndarray, "n 3 3"], owners: Int[ndarray, " n"], flat: float
) -> tuple[Float[ndarray, "m 3 3"], Int[ndarray, " m"]]:
    """Cut triangles by the side that they reach farthest beyond; in two across the longest edge where none cuts them.

    Args:
        pieces: The triangles.
        inward: Distance of each corner from the plane of each side, positive inside.
        owners: The face of each.
        flat: Distance from a plane that counts as none.
    """
    which = np.arange(len(pieces))
    low, high = inward.min(axis=1), inward.max(axis=1)
    crossed = np.where((low < -flat) & (high > flat), low, np.inf)
    side = crossed.argmin(axis=1)
    values = inward[which, :, side]
    uncut = np.flatnonzero(crossed[which, side] == np.inf)
    first = np.linalg.norm(np.roll(pieces[uncut], -1, axis=1) - pieces[uncut], axis=2).argmax(axis=1)
    values[uncut] = 0.0
    values[uncut, first], values[uncut, (first + 1) % 3] = -1.0, 1.0
    positive = values > 0
    apart = np.where(positive.sum(axis=1) == 1, positive.argmax(axis=1), positive.argmin(axis=1))
    turn = (apart[:, None] + np.arange(3)) % 3  # the corner on a side of its own first
    a, b, c = np.take_along_axis(pieces, turn[..., None], 1).swapaxes(0, 1)
    at_a, at_b, at_c = np.take_along_axis(values, turn, 1).T[..., None]
    ab, ac = a + at_a / (at_a - at_b) * (b - a), a + at_a / (at_a - at_c) * (c - a)
    cut = np.concatenate([np.stack(three, axis=1) for three in ((a, ab, ac), (ab, b, c), (ab, c, ac))])
    area = np.linalg.norm(np.cross(cut[:, 1] - cut[:, 0], cut[:, 2] - cut[:, 0]), axis=1)
    solid = area > flat**2
    return cut[solid], np.tile(owners, 3)[solid]
