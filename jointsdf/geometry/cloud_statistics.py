"""Statistics of a point cloud without its surface: noise, density, outliers, rims of what is not covered."""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.spatial import KDTree
from scipy.stats import chi2

from jointsdf.geometry.topology import components

SIZES = (9, 13, 25, 49, 97)  # of the neighbourhoods that surfaces are fitted to, tried in turn
WIDE = 4.5  # radius of a neighbourhood that tells its noise, in standard deviations of the noise
QUADRATIC = 6  # coefficients of a quadratic surface over its plane
SMOOTH = 0.1  # share of the neighbourhoods, those of the least residuals: others meet creases and both sides of walls
LEAST_NOISE = 1e-9  # of the longest side: below are the errors of arithmetic
RIM = 24  # nearest neighbours among which a point at a rim has an open side
ECCENTRICITY = 0.5  # of these: 0.64 on a straight rim (half a disc), 0 amid the surface
LEAST_RIM = 16  # linked points that make a rim
LINK = 4.0  # distance of points of one rim, in distances to the eighth neighbour
NEIGHBOUR = 8  # the distance to which tells the density about a point
USUAL = 0.9  # quantile of the distances to the eighth neighbour that is usual: clouds are denser in some places
FAR = 2.5  # distance to the eighth neighbour, of the usual one, beyond which a point is an outlier


def estimate_noise(points: Float[ndarray, "n 3"], asked: Int[ndarray, " m"], tree: KDTree) -> float:
    """Estimate the standard deviation of the noise across the surface, by the residuals of local quadratic surfaces.

    Each point's neighbours are fitted, in the frame of their principal axes, by a quadratic surface, as jets are in
    Cazals and Pouget (2003). Of the residuals a low quantile is taken, over what it is for Gaussian noise of unit
    variance. Neighbourhoods grow until they are so many times as wide as the noise found.
    Sparse but exact clouds with some flat places have none.

    Args:
        points: The cloud, any frame.
        asked: Indices of the points about which surfaces are fitted.
        tree: Of the points.

    Returns:
        In the frame of the points; 0 where what is found are errors of arithmetic.
    """
    found, side = 0.0, float(np.ptp(points, axis=0).max())
    for size in SIZES:
        if size >= len(points):
            break
        distances, neighbours = tree.query(points[asked], size, workers=-1)
        expected = np.sqrt(chi2.ppf(SMOOTH, size - QUADRATIC) / (size - QUADRATIC))
        found = float(np.quantile(_residuals(points[neighbours]), SMOOTH) / expected)
        if np.median(distances[:, -1]) >= WIDE * found:
            break
    return found if found > LEAST_NOISE * side else 0.0


def _residuals(groups: Float[ndarray, "m k 3"]) -> Float[ndarray, " m"]:
    """Standard deviation of each group of points about its quadratic surface."""
    centred = groups - groups.mean(axis=1, keepdims=True)
    _, axes = np.linalg.eigh(np.einsum("mki,mkj->mij", centred, centred))
    height, u, v = np.moveaxis(centred @ axes, 2, 0)
    scale = np.maximum(np.abs(v).max(axis=1, keepdims=True), np.finfo(float).tiny)
    u, v = u / scale, v / scale
    terms = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=2)
    basis, _ = np.linalg.qr(terms)
    left = height - np.einsum("mkc,mc->mk", basis, np.einsum("mkc,mk->mc", basis, height))
    return np.asarray(np.sqrt((left**2).sum(axis=1) / (groups.shape[1] - QUADRATIC)))


def mark_outliers(distances: Float[ndarray, " n"]) -> Bool[ndarray, " n"]:
    """Mark points that are alone, by their distances to the eighth neighbour (statistical outlier removal).

    A cloud may be ten times as dense in one place as in another. Points within a few gaps of the surface are none.
    """
    return np.asarray(distances > FAR * np.quantile(distances, USUAL))


def count_rims(points: Float[ndarray, "n 3"], tree: KDTree, reach: float) -> tuple[int, int]:
    """Count the rims of what a cloud does not cover: connected sets of points whose neighbours lie on one side.

    A point is at a rim where the centroid of its neighbours is far from it, seen along their normal (as in Bendels,
    Schnabel and Klein 2006, "half-disc criterion").

    Args:
        points: The cloud.
        tree: Of the points.
        reach: Distance at which two points of a rim are linked.

    Returns:
        Number of rims, and of the points at them.
    """
    at_rim = np.flatnonzero(_rim_eccentricity(points, tree) > ECCENTRICITY)
    pairs = KDTree(points[at_rim]).query_pairs(reach, output_type="ndarray") if len(at_rim) else np.zeros((0, 2), int)
    sizes = np.bincount(components(pairs.astype(np.int64), len(at_rim))) if len(at_rim) else np.zeros(0, int)
    rims = sizes[sizes >= LEAST_RIM]
    return len(rims), int(rims.sum())


def _rim_eccentricity(points: Float[ndarray, "n 3"], tree: KDTree) -> Float[ndarray, " n"]:
    """Eccentricity of each point among its neighbours, seen along their normal."""
    around = tree.query(points, RIM + 1, workers=-1)[1][:, 1:]
    offsets = points[around] - points[:, None]
    centred = offsets - offsets.mean(axis=1, keepdims=True)
    normals = np.linalg.eigh(np.einsum("nki,nkj->nij", centred, centred))[1][..., 0]
    return eccentricity(offsets, normals)


def eccentricity(offsets: Float[ndarray, "n k 3"], normals: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
    """Distance of the centroid of points over their mean distance, seen along a normal: 0 amid them, 1 far away.

    Args:
        offsets: From each place to the points about it.
        normals: Unit vectors along which each place looks.
    """
    flat = offsets - np.einsum("nki,ni->nk", offsets, normals)[..., None] * normals[:, None]
    mean_distance = np.linalg.norm(flat, axis=2).mean(axis=1)
    return np.asarray(np.linalg.norm(flat.mean(axis=1), axis=1) / np.maximum(mean_distance, np.finfo(float).tiny))
