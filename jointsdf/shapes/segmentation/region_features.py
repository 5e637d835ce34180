"""Features of smooth regions and of their borders, by which regions are merged: creases, thickness, curvature."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.geometry.face_graph import CREASE, FaceGraph
from jointsdf.geometry.mesh import face_areas
from jointsdf.shapes.segmentation.ray_features import ambient_occlusion, shape_diameter, spread_points
from jointsdf.values import LabelledMesh

RIGHT_ANGLE = np.pi / 2
TINY = 1e-12  # diagonals: least length to divide by


@dataclass(frozen=True)
class RegionFeatures:
    """Features of each region, and of each pair of regions that touch.

    Attributes:
        areas: Share of the whole area, > 0.
        thickness: Mean logarithm of the shape diameter, in diagonals of the mesh.
        hollow: Likeness to the wall of a hole or pocket, the larger of inward curvature and ambient occlusion: 0..1.
        pairs: Two regions that touch, the smaller index first; each pair once.
        lengths: Of their shared border, in diagonals of the mesh.
        concave: Mean concave angle along that border, in right angles.
        convex: Mean convex angle along that border, in right angles.
    """

    areas: Float[ndarray, " r"]
    thickness: Float[ndarray, " r"]
    hollow: Float[ndarray, " r"]
    pairs: Int[ndarray, "b 2"]
    lengths: Float[ndarray, " b"]
    concave: Float[ndarray, " b"]
    convex: Float[ndarray, " b"]


def measure_regions(mesh: LabelledMesh, graph: FaceGraph, regions: Int[ndarray, " f"]) -> RegionFeatures:
    """Measure the regions of a mesh and their borders, independently of the mesh's size and pose.

    Args:
        mesh: Any frame.
        graph: Of the mesh.
        regions: Region of each face, 0, 1, ...
    """
    count = int(regions.max()) + 1
    diagonal = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    weights = face_areas(mesh) / diagonal**2
    areas = np.bincount(regions, weights, minlength=count)
    surface = spread_points(mesh)
    thickness = surface.region_means(np.log(shape_diameter(surface)), regions)
    occluded = surface.region_means(ambient_occlusion(surface), regions)
    sides = regions[graph.pairs]
    lengths = graph.lengths / diagonal
    inside = sides[:, 0] == sides[:, 1]
    bend = np.bincount(sides[inside, 0], (graph.angles * lengths)[inside], minlength=count)
    curled = np.clip(-bend / np.sqrt(areas), 0.0, 1.0)
    hollow = np.maximum(curled, occluded)
    sides, lengths, angles = np.sort(sides[~inside], axis=1), lengths[~inside], graph.angles[~inside]
    perimeter = np.bincount(sides.ravel(), np.repeat(lengths, 2), minlength=count)
    turning = np.maximum(-bend, 0) / np.maximum(perimeter / 2, TINY)
    concave, convex = _edge_creases(sides, angles, turning, curled)
    keys, index = np.unique(sides[:, 0] * count + sides[:, 1], return_inverse=True)
    total = np.bincount(index, lengths, minlength=len(keys))
    safe = np.maximum(total, TINY)
    concave, convex = (np.bincount(index, lengths * angle, minlength=len(keys)) / safe for angle in (concave, convex))
    pairs = np.stack([keys // count, keys % count], axis=1)
    return RegionFeatures(areas / areas.sum(), thickness, hollow, pairs, safe, concave, convex)


def _edge_creases(
    sides: Int[ndarray, "p 2"],
    angles: Float[ndarray, " p"],
    turning: Float[ndarray, " r"],
    curled: Float[ndarray, " r"],
) -> tuple[Float[ndarray, " p"], Float[ndarray, " p"]]:
    """Concave and convex angle of each edge between two regions, in right angles.

    A fillet meets its neighbours without a crease: there the edge gets the angle by which the fillet turns, so that
    the faces on its two sides are not merged through it. Two pieces of one hollow are no such case.
    """
    one, other = curled[sides].T
    through = np.minimum(turning[sides].max(axis=1), RIGHT_ANGLE) * np.abs(one - other)
    concave = np.where(np.abs(angles) < CREASE, np.maximum(-angles, through), np.maximum(-angles, 0.0))
    convex = np.maximum(angles, 0.0)
    return np.minimum(concave / RIGHT_ANGLE, 1.0), np.minimum(convex / RIGHT_ANGLE, 1.0)
