"""Matching of the faces of two files of one mesh by position, whatever the order of faces and vertices."""

import logging

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.spatial import KDTree

from jointsdf.errors import InputError

TOLERANCE = 1e-5  # of the longest side; text files and 32-bit floats round below it

logger = logging.getLogger(__name__)


def match_faces(source: str, theirs: Float[ndarray, "g 3 3"], ours: Float[ndarray, "f 3 3"]) -> Int[ndarray, " f"]:
    """Find for each of our faces their face at the same place, by nearest centres; warn where the order differs.

    Both are compared with the middle of their box at the origin and its longest side 1: PartField rescales meshes.

    Args:
        source: What messages call their mesh.
        theirs: Corners of each face, any frame without rotation.
        ours: Corners of each face.

    Returns:
        Indices of their faces.

    Raises:
        InputError: Theirs is another mesh.
    """
    if len(theirs) != len(ours):
        raise InputError(f"{source} has {len(theirs)} faces, the mesh has {len(ours)}: it is of another mesh")
    theirs, ours = in_box(theirs), in_box(ours)
    if np.abs(theirs.mean(axis=1) - ours.mean(axis=1)).max() <= TOLERANCE:
        return np.arange(len(ours))
    for key in (_centres_and_normals, _centres):  # faces that touch differ in their normals only
        there, here = key(theirs), key(ours)
        away, index = KDTree(there).query(here)
        back = KDTree(here).query(there)[0]
        if max(away.max(), back.max()) <= 2 * TOLERANCE:
            logger.warning("%s: its faces are in another order than the mesh's; matched by their centres", source)
            return np.asarray(index, dtype=np.int64)
    lost = int((away > 2 * TOLERANCE).sum())
    raise InputError(
        f"{source} is of another mesh: of its {len(theirs)} faces and the mesh's {len(ours)}, "
        f"{max(lost, 1)} lie elsewhere; give the labels of this mesh"
    )


def in_box(corners: Float[ndarray, "f 3 3"]) -> Float[ndarray, "f 3 3"]:
    """Move the middle of the faces' box to the origin and scale its longest side to 1."""
    points = corners.reshape(-1, 3)
    low, high = points.min(axis=0), points.max(axis=0)
    return (corners - (low + high) / 2) / max((high - low).max(), np.finfo(float).tiny)


def _centres(corners: Float[ndarray, "f 3 3"]) -> Float[ndarray, "f 3"]:
    return np.asarray(corners.mean(axis=1))


def _centres_and_normals(corners: Float[ndarray, "f 3 3"]) -> Float[ndarray, "f 6"]:
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])  # as long as twice the area
    return np.concatenate([corners.mean(axis=1), normals], axis=1)
