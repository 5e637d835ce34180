"""Error view: a fitted mesh in the colours of its distance to the ground truth, those of the slice's error."""

import numpy as np
from jaxtyping import Float, UInt8
from matplotlib import colormaps
from matplotlib.colors import BoundaryNorm
from numpy import ndarray

from jointsdf.geometry.distance import ClosestPoint
from jointsdf.values import LabelledMesh
from jointsdf.viewing.isolines import ERRORS, HEAT


def face_distances(of: LabelledMesh, to: LabelledMesh) -> Float[ndarray, " f"]:
    """Distance of each face's centroid to the other surface, in the meshes' frame."""
    return ClosestPoint(to).query(centroids(of))[0]


def centroids(mesh: LabelledMesh) -> Float[ndarray, "f 3"]:
    """Centroid of each face."""
    middle: ndarray = mesh.vertices[mesh.faces].mean(axis=1)
    return middle


def error_colours(mesh: LabelledMesh, truth: LabelledMesh) -> UInt8[ndarray, "f 3"]:
    """Colour (sRGB) of each face by its distance to the truth as a share of its longest side, in steps of `ERRORS`."""
    side = float(np.ptp(truth.vertices[np.unique(truth.faces)], axis=0).max())
    shares = np.clip(face_distances(mesh, truth) / side, ERRORS[0], ERRORS[-1] * (1 - 1e-9))
    colours: ndarray = colormaps[HEAT](BoundaryNorm(ERRORS, 256)(shares), bytes=True)[:, :3]
    return colours
