"""Volume, area, centre of mass and inertia of a solid, with area and centroid of its parts: of a mesh, or of sums."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.geometry.mesh import face_areas
from jointsdf.values import LabelledMesh


@dataclass(frozen=True)
class PartMeasure:
    """Surface of one part.

    Attributes:
        area: Frame units squared.
        centroid: Of the surface; NaN without area.
    """

    area: float
    centroid: Float[ndarray, "3"]


@dataclass(frozen=True)
class Measures:
    """Measures of a solid of density 1.

    Attributes:
        volume: Frame units cubed.
        area: Of its surface, frame units squared.
        centre: Of mass.
        inertia: Tensor about the centre of mass, frame units to the fifth.
        parts: By part id, ascending; -1 is the surface without a part.
    """

    volume: float
    area: float
    centre: Float[ndarray, "3"]
    inertia: Float[ndarray, "3 3"]
    parts: Mapping[int, PartMeasure]


def measure_parts(
    labels: Int[ndarray, " n"], areas: Float[ndarray, " n"], middles: Float[ndarray, "n 3"]
) -> dict[int, PartMeasure]:
    """Area and centroid of each part, of pieces of surface with their middles."""
    ids, number = np.unique(labels, return_inverse=True)
    of_part = np.bincount(number, areas, minlength=len(ids)).astype(np.float64)  # without pieces they are whole numbers
    sums = np.stack([np.bincount(number, areas * middles[:, k], minlength=len(ids)) for k in range(3)], axis=1)
    sums = sums.astype(np.float64)
    centroids = np.divide(sums, of_part[:, None], out=np.full_like(sums, np.nan), where=of_part[:, None] > 0)
    return {
        int(part): PartMeasure(float(area), centroid)
        for part, area, centroid in zip(ids, of_part, centroids, strict=True)
    }


def measure_mesh(mesh: LabelledMesh) -> Measures:
    """Measures of the solid that a closed mesh encloses, exact by the divergence theorem (Eberly, "Polyhedral mass
    properties", 2002).

    Args:
        mesh: Closed, not empty; faces counter-clockwise seen from outside.
    """  # noqa: D205
    corners = mesh.vertices.astype(np.float64)[mesh.faces]
    middle = (corners.min(axis=(0, 1)) + corners.max(axis=(0, 1))) / 2  # sums about it keep their digits
    found = trimesh.triangles.mass_properties(corners - middle)
    areas = face_areas(mesh)
    return Measures(
        float(found.volume),
        float(areas.sum()),
        np.asarray(found.center_mass) + middle,
        np.asarray(found.inertia),
        measure_parts(mesh.labels, areas, corners.mean(axis=1)),
    )


def inertia_of(volume: float, first: Float[ndarray, "3"], second: Float[ndarray, "3 3"]) -> Float[ndarray, "3 3"]:
    """Inertia tensor about the centre of mass, from the integrals of 1, x and x x^T (Steiner's theorem).

    >>> inertia_of(2.0, np.array([2.0, 0, 0]), np.diag([3.0, 1, 1])).tolist()
    [[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]]
    """
    about = second - np.outer(first, first) / volume
    tensor: Float[ndarray, "3 3"] = np.trace(about) * np.eye(3) - about + 0.0
    return tensor
