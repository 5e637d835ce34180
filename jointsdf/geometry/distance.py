"""Closest points and exact signed distance of a triangle mesh, by libigl.

The sign of a watertight mesh comes from the angle-weighted pseudonormal (Baerentzen and Aanaes, "Signed distance
computation using the angle weighted pseudonormal", TVCG 2005), exact where the mesh does not fold over itself. A fold
turns the sign of all the space that it is nearest to, so away from the surface the fast winding number (Barill et al.,
SIGGRAPH 2018) decides, which is within 0.02 of a whole number there. The sign of any other mesh, and of closed bodies
that overlap, comes from it everywhere: right away from the holes, a guess near them.
"""

from dataclasses import replace

import igl
import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.spatial import KDTree

from jointsdf.geometry.mesh import face_normals
from jointsdf.geometry.topology import components
from jointsdf.geometry.winding import WindingNumber
from jointsdf.values import LabelledMesh, Normalisation, Shape

ON_SURFACE = 1e-7  # distance below which the closest point tells no direction, of the longest side
AWAY = 0.001  # distance from which winding numbers decide the sign, of the longest side
NEIGHBOURS = 6  # of a point, itself included, that may be on its side of the surface
PIECES = 100_000  # faces of the search tree at most, unless the mesh itself has more
LONG = 1 / 8  # edge above which a face is split, of the longest side
BINS = np.uint16(40)  # along each axis, their cube within 16 bits; points of one visit the same branches of a tree


class ClosestPoint:
    """The closest point of a mesh, its search tree built once.

    Boxes of long faces overlap, and a search visits all that hold its point, so the tree holds pieces of such faces.

    Args:
        mesh: The surface, at least one face. Points and distances are in its frame and unit.
    """

    def __init__(self, mesh: LabelledMesh) -> None:
        assert not mesh.is_empty, "no distance to an empty mesh"
        self.vertices = np.ascontiguousarray(mesh.vertices, dtype=np.float64)
        self.faces = np.ascontiguousarray(mesh.faces, dtype=np.int64)
        self.size = float(np.ptp(self.vertices, axis=0).max())
        longest = LONG * self.size
        self._pieces, self._whole = (self.vertices, self.faces), np.arange(len(self.faces))
        if igl.edge_lengths(self.vertices, self.faces).max() > longest:
            corners, self._whole = split_long_faces(self.vertices[self.faces], longest)
            self._pieces = corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)
        self._tree = igl.AABB()
        self._tree.init(*self._pieces)

    def query(self, points: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, " n"], Int[ndarray, " n"]]:
        """Distance to the closest point of the surface, and the face that holds it."""
        squared, pieces, _ = self._search(points)
        return np.sqrt(squared), self._whole[pieces]

    def nearest(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """The closest point of the surface itself."""
        places: Float[ndarray, "n 3"] = self._search(points)[2]
        return places

    def _search(self, points: Float[ndarray, "n 3"]) -> list[ndarray]:
        """Squared distance, piece and place of the closest point of the surface."""
        order = spatial_order(points)
        back = np.argsort(order)
        return [found[back] for found in self._tree.squared_distance(*self._pieces, _ordered(points, order))]


class ExactDistance:
    """Signed distance to a mesh, negative inside, in the frame and unit of the mesh's vertices.

    Args:
        mesh: The surface. Faces counter-clockwise seen from outside, no degenerate face, at least one.
        watertight: Whether every edge has exactly two faces: pseudonormal, else winding number.
        folded: Whether such faces overlap or fold over: winding number all the same.
    """

    def __init__(self, mesh: LabelledMesh, *, watertight: bool, folded: bool = False) -> None:
        self.closest = ClosestPoint(mesh)
        self._by_pseudonormal = watertight and not folded
        self._winding_number = WindingNumber(self.closest.vertices, self.closest.faces)

    def signed(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """Distance to the closest point of the surface, negative inside.

        Args:
            points: In the frame of the mesh's vertices.
        """
        if self._by_pseudonormal:
            return self._pseudonormal(points)
        # libigl's own fast-winding distance scales the value by 1 - 2w, and w is approximate: only its sign is used.
        distances, _ = self.closest.query(points)
        return np.where(self._winding_number.encloses(_ordered(points, slice(None))), -1.0, 1.0) * distances

    def gradients(self, points: Float[ndarray, "n 3"], distances: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
        """Unit gradient of the distance: away from the closest point of the surface, or towards it inside; 0 on it.

        Args:
            points: In the frame of the mesh's vertices.
            distances: Of the points, signed.
        """
        away = points - self.closest.nearest(points)
        lengths = np.linalg.norm(away, axis=1, keepdims=True)
        directions = np.divide(away, lengths, out=np.zeros_like(away), where=lengths > ON_SURFACE * self.closest.size)
        return directions * np.sign(distances)[:, None]

    def one_sided(self, points: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, " n"], Float[ndarray, "n 3"]]:
        """Signed distance, and the normal of the closest face: the gradient, but for points nearest to a crease.

        Args:
            points: In the frame of the mesh's vertices.
        """
        _, faces = self.closest.query(points)
        return self.signed(points), face_normals(self.closest.vertices, self.closest.faces[faces])

    def closest_face(self, points: Float[ndarray, "n 3"]) -> Int[ndarray, " n"]:
        """Index of the face that holds the closest point of the surface.

        Args:
            points: In the frame of the mesh's vertices.
        """
        return self.closest.query(points)[1]

    def _pseudonormal(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        sign = igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
        order = spatial_order(points)
        distances = np.zeros(len(points))
        if len(points):
            asked = _ordered(points, order)
            distances[order] = igl.signed_distance(asked, self.closest.vertices, self.closest.faces, sign)[0]
        far = np.flatnonzero(np.abs(distances) > AWAY * self.closest.size)
        if len(far):
            deepest, group = group_by_side(points[far], np.abs(distances[far]))
            inside = self._winding_number.encloses(points[far[deepest]])
            distances[far] = np.where(inside[group], -1, 1) * np.abs(distances[far])
        return distances


def network_distance(shape: Shape, normalisation: Normalisation) -> ExactDistance:
    """Exact signed distance of a shape in the network frame.

    Args:
        shape: Ground truth, file frame.
        normalisation: File frame -> network frame.
    """
    vertices = normalisation.forward(shape.mesh.vertices)
    return ExactDistance(replace(shape.mesh, vertices=vertices), watertight=shape.watertight, folded=shape.folded)


def group_by_side(
    points: Float[ndarray, "n 3"], distances: Float[ndarray, " n"]
) -> tuple[Int[ndarray, " g"], Int[ndarray, " n"]]:
    """Group points that no surface separates: the ball of a point's distance about it holds none.

    Args:
        points: At least one.
        distances: To the surface, without sign.

    Returns:
        The point of each group that is farthest from the surface, and the group of each point.
    """
    apart, other = KDTree(points).query(points, np.arange(1, min(NEIGHBOURS, len(points)) + 1), workers=-1)
    within = apart < np.maximum(distances[:, None], distances[other])
    one = np.repeat(np.arange(len(points)), within.sum(axis=1))
    group = components(np.stack([one, other[within]], axis=1), len(points))
    order = np.lexsort((-distances, group))
    return order[np.unique(group[order], return_index=True)[1]], group


def split_long_faces(
    corners: Float[ndarray, "f 3 3"], longest: float
) -> tuple[Float[ndarray, "p 3 3"], Int[ndarray, " p"]]:
    """Longest-edge bisection of faces until no edge is longer, or there are `PIECES`.

    Args:
        corners: Of the faces, any frame.
        longest: Longest edge, same unit.

    Returns:
        The pieces, and the face of each.
    """
    whole = np.arange(len(corners))
    while True:
        lengths = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
        long = lengths.max(axis=1) > longest
        if not long.any() or len(corners) + np.count_nonzero(long) > PIECES:
            return corners, whole
        first = lengths[long].argmax(axis=1)
        a, b, c = (corners[long, (first + turn) % 3] for turn in range(3))
        middle = (a + b) / 2
        corners = np.concatenate([corners[~long], np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
        whole = np.concatenate([whole[~long], whole[long], whole[long]])


def spatial_order(points: Float[ndarray, "n 3"]) -> Int[ndarray, " n"]:
    """Sort points by the bins of a grid, so that each query is near the one before it."""
    if len(points) == 0:
        return np.arange(0)
    low, high = points.min(axis=0), points.max(axis=0)
    side = float((high - low).max()) or 1.0
    x, y, z = np.minimum((points - low) * (BINS / side), BINS - 1).astype(np.uint16).T  # 16 bits: sorted by counting
    return np.argsort((x * BINS + y) * BINS + z, kind="stable")


def _ordered(points: Float[ndarray, "n 3"], order: Int[ndarray, " n"] | slice) -> Float[ndarray, "n 3"]:
    return np.ascontiguousarray(points[order], dtype=np.float64)
