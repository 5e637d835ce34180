"""Winding of patches with the same on both sides, as the walls between bodies that touch: by their borders."""

import numpy as np
from jaxtyping import Bool, Int
from numpy import ndarray
from scipy.sparse import coo_array

from jointsdf.geometry.mesh import edge_keys


def wind_partitions(
    faces: Int[ndarray, "f 3"], patch: Int[ndarray, " f"], undecided: Bool[ndarray, " p"]
) -> Bool[ndarray, " p"]:
    """Find the undecided patches to turn, so that faces traverse each edge as often in one direction as in the other.

    The surface of solids has no boundary as a chain (homology). Two walls with one border, as between bodies that
    touch, face away from each other; the rest is wound greedily, the patches with the most decided borders first.

    Args:
        faces: Vertex indices, wound to agree within each patch.
        patch: Patch of each face, numbered from 0.
        undecided: Patches whose winding is open; that of the others is taken as right.
    """
    turned = np.zeros(len(undecided), dtype=bool)
    if not undecided.any():
        return turned
    _, edge = np.unique(edge_keys(faces, int(faces.max()) + 1), return_inverse=True)
    direction = np.where(faces < np.roll(faces, -1, axis=1), 1, -1).ravel()
    border = coo_array((direction, (np.repeat(patch, 3), edge))).tocsr()
    border.eliminate_zeros()
    rows = {index: slice(*border.indptr[index : index + 2]) for index in np.flatnonzero(undecided).tolist()}
    single: dict[tuple[bytes, bytes], int] = {}  # by border
    for index, row in rows.items():
        traversed = border.data[row]
        key = border.indices[row].tobytes(), (traversed * traversed[:1]).tobytes()
        other = single.pop(key, None)
        if other is None:
            single[key] = index
        else:
            turned[index] = (traversed[:1] == border.data[rows[other]][:1]).any()
    net = np.where(undecided, 0, 1) @ border
    left = np.array(sorted(single.values()), dtype=np.int64)
    for index in left[np.argsort(-np.abs(border[left] @ net), kind="stable")]:
        edges, traversed = border.indices[rows[index]], border.data[rows[index]]
        turned[index] = traversed @ net[edges] > 0
        net[edges] += np.where(turned[index], -1, 1) * traversed
    return turned
