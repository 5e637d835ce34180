"""Bisection of smooth regions into connected pieces, by geodesic distance."""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra

TINY = 1e-12  # least length of an edge of the graph: a zero is no edge
DIGITS, SIZE_DIGITS = 9, 12  # decimals by which lengths and areas are compared, so that machines agree


def bisect_regions(
    regions: Int[ndarray, " f"],
    pairs: Int[ndarray, "p 2"],
    lengths: Float[ndarray, " p"],
    centres: Float[ndarray, "f 3"],
    areas: Float[ndarray, " f"],
    count: int,
    smallest: float,
) -> tuple[Int[ndarray, " f"], Int[ndarray, "s 2"]]:
    """Bisect the largest region until there are `count`, or none can be bisected.

    Args:
        regions: Region of each face, 0, 1, ..; each connected.
        pairs: Faces that share an edge.
        lengths: Distance between their centres.
        centres: Of the faces, in the unit of `lengths`.
        areas: Of the faces, any unit.
        count: Wanted number of regions.
        smallest: Least area of a piece.

    Returns:
        The new regions, and for each cut the region that keeps its number and the new one.
    """
    weights = coo_array((np.maximum(lengths, TINY), tuple(pairs.T)), shape=(len(regions), len(regions))).tocsr()
    pieces = regions.copy()
    size = np.bincount(pieces, areas)
    divisible = np.bincount(pieces) > 1
    cuts: list[tuple[int, int]] = []
    while len(size) < count and divisible.any():
        largest = int(np.argmax(np.where(divisible, size.round(SIZE_DIGITS), -1.0)))
        faces = np.flatnonzero(pieces == largest)
        far = _far_half(weights[faces][:, faces], centres[faces], areas[faces])
        halves = areas[faces[~far]].sum(), areas[faces[far]].sum()
        if min(halves) < smallest:
            divisible[largest] = False
            continue
        cuts.append((largest, len(size)))
        pieces[faces[far]] = len(size)
        size[largest] = halves[0]
        divisible[largest] = (~far).sum() > 1
        size, divisible = np.append(size, halves[1]), np.append(divisible, far.sum() > 1)
    return pieces, np.array(cuts, dtype=np.int64).reshape(-1, 2)


def _far_half(weights: csr_array, centres: Float[ndarray, "n 3"], areas: Float[ndarray, " n"]) -> Bool[ndarray, " n"]:
    """Select the half of a connected region, by area, that is nearer to the second of two ends along the surface.

    Both halves are connected: on the shortest way to an end, the lead of the way to the other end never falls.
    """
    start = int(np.argmax(np.linalg.norm(centres - centres.mean(axis=0), axis=1).round(DIGITS)))
    one = int(np.argmax(dijkstra(weights, directed=False, indices=start).round(DIGITS)))
    to_one = dijkstra(weights, directed=False, indices=one)
    to_other = dijkstra(weights, directed=False, indices=int(np.argmax(to_one.round(DIGITS))))
    place = np.unique((to_one - to_other).round(DIGITS), return_inverse=True)[1]
    below = np.cumsum(np.bincount(place, areas))
    last = int(np.argmin(np.abs(below / below[-1] - 0.5).round(DIGITS)))
    far: Bool[ndarray, " n"] = place > last
    return far
