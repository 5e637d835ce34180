"""Flatness: how far the prediction of a plane is from that plane."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.geometry.caching import cached_by_identity
from jointsdf.geometry.face_graph import pair_sides
from jointsdf.geometry.mesh import face_areas, face_normals, unit
from jointsdf.geometry.topology import components
from jointsdf.metrics import match_creases, project
from jointsdf.values import SurfaceSamples

COPLANAR = math.cos(math.radians(0.5))  # between the normals of neighbouring faces of one plane
THICKNESS = 1e-4  # distance of a plane's vertices from it at most, of the longest side
SHARE = 0.01  # smallest area of a plane, of the mesh's
CLEAR = 0.005  # distance from which the errors of a crease do not count


class Planes(NamedTuple):
    """Planar patches of a mesh.

    Attributes:
        patch: Patch of each face, -1 where it is in none.
        normals: Unit normal of each patch.
        offsets: Of each plane `normal . x = offset`, in the frame of the samples.
    """

    patch: Int[ndarray, " f"]
    normals: Float[ndarray, "q 3"]
    offsets: Float[ndarray, " q"]


@dataclass(frozen=True)
class Flatness:
    """99th percentile of the distance from predicted samples to the plane of their true patch: `flatness`.

    A patch is a set of connected faces of the truth (neighbours within 0.5 degrees) whose vertices lie within 0.0001 of
    one plane and that has 1% of the area or more. A predicted sample belongs to the patch of its closest true face;
    samples within 0.005 of a true crease, whose errors are those of the edge, do not count. All patches are pooled.
    Lengths in the frame of the samples, where the longest side is 1. NaN where the truth has no such patch, or no
    sample belongs to one, and for an empty prediction. A mesh against itself scores 0: that is the floor.
    """

    @property
    def ceilings(self) -> tuple[str, ...]:
        """The score: what grid and extraction alone cost."""
        return ("flatness",)

    def __call__(self, predicted: SurfaceSamples, truth: SurfaceSamples) -> dict[str, float]:
        """Score the prediction; see the class."""
        planes = find_planes(truth)
        if len(predicted.points) == 0 or len(planes.offsets) == 0:
            return {"flatness": math.nan}
        patch = planes.patch[project(predicted, truth).faces]
        counted = (patch >= 0) & (match_creases(predicted, truth)[0] > CLEAR)
        if not counted.any():
            return {"flatness": math.nan}
        points, patch = predicted.points[counted], patch[counted]
        heights = np.einsum("nd,nd->n", points, planes.normals[patch]) - planes.offsets[patch]
        return {"flatness": float(np.percentile(np.abs(heights), 99))}


@cached_by_identity
def find_planes(samples: SurfaceSamples) -> Planes:
    """Planar patches of the mesh of the samples, see `Flatness`; cached."""
    mesh, faces = samples.mesh, samples.mesh.faces.astype(np.int64)
    vertices = samples.frame.forward(mesh.vertices.astype(np.float64))
    normals, areas = face_normals(vertices, faces), face_areas(mesh)
    first, second = pair_sides(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), len(vertices))
    pairs = np.stack([first // 3, second // 3], axis=1)
    joined = np.einsum("pd,pd->p", normals[pairs[:, 0]], normals[pairs[:, 1]]) > COPLANAR
    patch = components(pairs[joined], len(faces))
    count = int(patch.max(initial=-1)) + 1
    size = np.maximum(np.bincount(patch, areas, count), np.finfo(float).tiny)[:, None]
    means = unit(np.stack([np.bincount(patch, areas * axis, count) for axis in normals.T], axis=1) / size)
    centres = np.stack([np.bincount(patch, areas * axis, count) for axis in vertices[faces].mean(axis=1).T], 1) / size
    offsets = np.einsum("qd,qd->q", means, centres)
    heights = np.einsum("fcd,fd->fc", vertices[faces], means[patch]) - offsets[patch, None]
    thickness = np.zeros(count)
    np.maximum.at(thickness, patch, np.abs(heights).max(axis=1))
    kept = (thickness <= THICKNESS) & (size[:, 0] >= SHARE * areas.sum())
    number = np.where(kept, np.cumsum(kept) - 1, -1)
    return Planes(number[patch], means[kept], offsets[kept])
