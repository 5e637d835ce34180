"""Denoising of a point cloud: robust local planes, then bilateral steps along their normals.

The planes are found by consensus, as those of `local_planes.py`, but over neighbourhoods that are wide for the noise,
and they do not pass through their points. Then points and normals are smoothed together over neighbours of like normals
and like heights, as in bilateral mesh denoising (Fleishman, Drori and Cohen-Or 2003) and in robust implicit moving
least squares (Oeztireli, Guennebaud and Gross 2009), so that edges stay. Normals have no sides yet: sides are told by
free space, which noise would close in bores and slots, so denoising comes first.
"""

from itertools import combinations

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.spatial import KDTree

from jointsdf.data.local_planes import LEAST_SINE, ROUNDS, TINY, geman_mcclure_weight
from jointsdf.geometry.cloud_statistics import estimate_noise
from jointsdf.geometry.mesh import unit

NEIGHBOURS = (24, 36, 48)  # sizes of neighbourhoods, of which the first wide enough is taken
LEAST_RADIUS = 4.5  # of a neighbourhood, in noise levels
LEAST_NOISE = 0.021  # in distances to the 16th neighbour: less is borne by the planes of exact clouds
SPACING_NEIGHBOUR = 16
ANCHORS = 8  # neighbours whose triples span the candidates
JUDGES = 32  # neighbours that vote for a candidate
PLANE_WIDTH = 2.0  # height above a plane at which a neighbour's weight is 1/4, in noise levels
FIRST_WIDTH = 5 / 3  # of the consensus and the first round, in plane widths
OWN_PLANE = 3.0  # greatest distance of a point from its own plane, in noise levels
STEP_WIDTH = 2.5  # of the bilateral steps, in noise levels
LIKENESS = 0.1  # 1 - |cosine| of normals at which a neighbour's weight is 1/e
STEPS = 3
MOST_ASKED = 2000  # points, evenly spread over the cloud's order, that tell its noise and its gaps
BATCH = 2048  # points whose planes are fitted at once
TRIPLES = np.array(list(combinations(range(ANCHORS), 3)))


def denoise(points: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"]] | None:
    """Points moved to where the surface is, and their normals; None where the cloud is exact.

    Args:
        points: The cloud, any frame.

    Returns:
        The points, and unit normals of either sign.
    """
    tree = KDTree(points)
    asked = np.arange(0, len(points), len(points) // MOST_ASKED + 1)
    some, noise = points[asked], estimate_noise(points, asked, tree)
    if noise <= LEAST_NOISE * _radius(some, tree, min(SPACING_NEIGHBOUR, len(points) - 1)):
        return None
    wide = (count for count in NEIGHBOURS if count < len(points) and _radius(some, tree, count) > LEAST_RADIUS * noise)
    count = next(wide, min(NEIGHBOURS[-1], len(points) - 1))
    neighbours = tree.query(points, count + 1, workers=-1)[1][:, 1:]
    pieces = np.array_split(points[neighbours] - points[:, None], len(points) // BATCH + 1)
    normals, heights = (np.concatenate(column) for column in zip(*(_planes(p, noise) for p in pieces), strict=True))
    points = points + heights[:, None] * normals
    for _ in range(STEPS):
        points, normals = _bilateral_step(points, normals, neighbours, noise)
    return points, normals


def _radius(points: Float[ndarray, "n 3"], tree: KDTree, neighbour: int) -> float:
    """Median distance of some points to that neighbour."""
    return float(np.median(tree.query(points, [neighbour + 1], workers=-1)[0]))


def _planes(offsets: Float[ndarray, "n k 3"], noise: float) -> tuple[Float[ndarray, "n 3"], Float[ndarray, " n"]]:
    """Planes near the points: unit normals, and the heights at which they pass."""
    width = np.full((len(offsets), 1), PLANE_WIDTH * noise)
    normals, heights = _choose_by_consensus(offsets, FIRST_WIDTH * width, OWN_PLANE * noise)
    for factor in np.geomspace(FIRST_WIDTH, 1, ROUNDS):
        weights = geman_mcclure_weight(np.einsum("nki,ni->nk", offsets, normals) - heights[:, None], factor * width)
        centres = np.einsum("nk,nki->ni", weights, offsets) / np.maximum(weights.sum(axis=1, keepdims=True), TINY)
        about = offsets - centres[:, None]
        axes = np.linalg.eigh(np.einsum("nk,nki,nkj->nij", weights, about, about, optimize=True))[1]
        normals = axes[:, :, 0]
        heights = (centres * normals).sum(axis=1)
    return normals, heights


def _choose_by_consensus(
    offsets: Float[ndarray, "n k 3"], width: Float[ndarray, "n 1"], reach: float
) -> tuple[Float[ndarray, "n 3"], Float[ndarray, " n"]]:
    """Plane through three neighbours with the largest sum of neighbours' weights, of those within reach of the point.

    The neighbours are of the outer two thirds, so that noise tilts the planes little.
    """
    count = offsets.shape[1]
    anchors = offsets[:, np.linspace(count // 3, count - 1, ANCHORS).astype(int)]
    first, *sides = (anchors[:, column] for column in TRIPLES.T)
    one, other = (side - first for side in sides)
    across = np.cross(one, other)
    sizes = np.linalg.norm(across, axis=2)
    wide = sizes > LEAST_SINE * np.linalg.norm(one, axis=2) * np.linalg.norm(other, axis=2)
    candidates = across / np.maximum(sizes, TINY)[..., None]
    heights = np.einsum("nci,nci->nc", candidates, first)
    judges = offsets[:, np.unique(np.linspace(0, count - 1, min(count, JUDGES)).astype(int))]
    above = judges @ candidates.transpose(0, 2, 1) - heights[:, None]
    votes = geman_mcclure_weight(above, width[:, None]).sum(axis=1) * wide * (np.abs(heights) < reach)
    chosen = np.arange(len(offsets)), votes.argmax(axis=1)
    return candidates[chosen], heights[chosen]


def _bilateral_step(
    points: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"], neighbours: Int[ndarray, "n k"], noise: float
) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"]]:
    """One step of all points along their normals, onto the mean of the planes of like neighbours; and mean normals."""
    offsets = points[neighbours] - points[:, None]
    squares = (offsets**2).sum(axis=2)
    cosines = np.einsum("nki,ni->nk", normals[neighbours], normals)
    alike = normals[neighbours] * np.sign(cosines)[..., None]
    heights = np.einsum("nki,nki->nk", offsets, alike)
    weights = np.exp(-2 * squares / np.maximum(squares[:, -1:], TINY) - ((1 - np.abs(cosines)) / LIKENESS) ** 2)
    weights *= geman_mcclure_weight(heights, np.array([[STEP_WIDTH * noise]]))
    rise = (weights * heights).sum(axis=1) / np.maximum(weights.sum(axis=1), TINY)
    mean = normals + np.einsum("nk,nki->ni", weights, alike)
    return points + rise[:, None] * normals, unit(mean)
