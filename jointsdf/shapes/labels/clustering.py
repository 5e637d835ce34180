"""Clustering of per-face features into connected parts."""

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import minimum_spanning_tree
from scipy.spatial import KDTree

from jointsdf.errors import InputError
from jointsdf.geometry.topology import components

NEAREST = 8  # components, itself included, that a component may be bridged to, besides a chain through all of them
TINY = 1e-9  # of the extent, added to lengths of bridges: a zero is no edge


def cluster_features(
    features: Float[ndarray, "f d"], corners: Float[ndarray, "f 3 3"], num_parts: int
) -> Int[ndarray, " f"]:
    """Cluster faces into connected parts of like features: Ward's method on unit vectors and the graph of faces.

    Components that do not touch are joined by bridges between their nearest faces, so that they can share a part.

    Args:
        features: One vector per face.
        corners: Of the faces, any frame.
        num_parts: From 1 to the number of faces.

    Raises:
        InputError: scikit-learn is not installed.
    """
    try:
        from sklearn.cluster import AgglomerativeClustering
    except ImportError as error:
        raise InputError("cutting PartField's features needs scikit-learn: pip install '.[labels]'") from error
    unit = features / np.maximum(np.linalg.norm(features, axis=1, keepdims=True), np.finfo(float).tiny)
    pairs = _pair_neighbours(corners)
    pairs = np.concatenate([pairs, _find_bridges(corners.mean(axis=1), components(pairs, len(corners)))])
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(corners),) * 2)
    clustering = AgglomerativeClustering(num_parts, connectivity=(graph + graph.T).tocsr(), linkage="ward")
    return np.asarray(clustering.fit(unit).labels_, dtype=np.int64)


def _pair_neighbours(corners: Float[ndarray, "f 3 3"]) -> Int[ndarray, "p 2"]:
    """Pair the faces that share an edge, by the positions of its ends."""
    places = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)[1].reshape(-1, 3)
    edges = np.sort(places[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    order = np.lexsort(edges.T)
    same = (edges[order[1:]] == edges[order[:-1]]).all(axis=1)
    return np.stack([order[:-1][same] // 3, order[1:][same] // 3], axis=1)


def _find_bridges(centres: Float[ndarray, "f 3"], component: Int[ndarray, " f"]) -> Int[ndarray, "b 2"]:
    """Pair the nearest faces of components along a minimum spanning tree between the components' centres."""
    members = np.split(np.argsort(component, kind="stable"), np.cumsum(np.bincount(component))[:-1])
    if len(members) == 1:
        return np.zeros((0, 2), dtype=np.int64)
    middles = np.array([centres[faces].mean(axis=0) for faces in members])
    near = KDTree(middles).query(middles, k=min(NEAREST, len(middles)))[1]
    chain = np.lexsort(middles.T)  # through all of them: the neighbours alone need not be connected
    first = np.concatenate([np.repeat(np.arange(len(near)), near.shape[1]), chain[:-1]])
    second = np.concatenate([near.ravel(), chain[1:]])
    first, second = np.unique(np.sort(np.stack([first, second])[:, first != second], axis=0), axis=1)
    lengths = np.linalg.norm(middles[first] - middles[second], axis=1) + TINY * np.ptp(centres)
    tree = minimum_spanning_tree(coo_array((lengths, (first, second)), shape=(len(members),) * 2)).tocoo()
    bridges = []
    for one, other in zip(tree.row, tree.col, strict=True):
        away, index = KDTree(centres[members[one]]).query(centres[members[other]])
        best = int(np.argmin(away))
        bridges.append((members[one][index[best]], members[other][best]))
    return np.array(bridges, dtype=np.int64)
