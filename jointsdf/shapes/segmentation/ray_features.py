"""Shape diameter and ambient occlusion of a surface, by rays cast from points on it.

Sources: Shapira et al., "Consistent mesh partitioning and skeletonisation using the shape diameter function", The
Visual Computer 2008; Zhukov et al., "An ambient light illumination model", EGWR 1998.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.geometry.mesh import face_areas
from jointsdf.geometry.rays import ray_lengths
from jointsdf.values import LabelledMesh

SAMPLES = 40_000  # points on the whole surface, besides one in each face
STEEP, FLAT = np.radians(35.0), np.radians(65.0)  # tilts of rays to the normal
POCKET = 0.3, 0.7  # shares of outward rays that meet the mesh: on open ground, in a pocket
LIFT = 1e-4  # of the rays' origins off the surface, of the diagonal
PLASTIC = 1.324717957244746  # plastic number: generates the R2 sequence (Roberts 2018)
DIGITS = 9  # decimals by which lengths are compared, so that machines agree


@dataclass(frozen=True)
class SurfacePoints:
    """Points spread evenly over a mesh, in diagonals of the mesh about the centre of its box.

    Attributes:
        corners: Of the mesh's faces.
        points: Positions.
        faces: The face of each point.
        frames: Two tangents and the normal at each point (rows).
        areas: Area that each point stands for, mesh units squared.
    """

    corners: Float[ndarray, "f 3 3"]
    points: Float[ndarray, "n 3"]
    faces: Int[ndarray, " n"]
    frames: Float[ndarray, "n 3 3"]
    areas: Float[ndarray, " n"]

    def region_means(self, values: Float[ndarray, " n"], regions: Int[ndarray, " f"]) -> Float[ndarray, " r"]:
        """Mean of a value of the points over the area of each region 0, 1, ..; `regions` gives that of each face."""
        of_point = regions[self.faces]
        return np.bincount(of_point, self.areas * values) / np.bincount(of_point, self.areas)


def spread_points(mesh: LabelledMesh) -> SurfacePoints:
    """Spread points over the faces in proportion to area, by the R2 low-discrepancy sequence in each face.

    Args:
        mesh: Any frame, no degenerate face. The points do not depend on which corner of a face is the first.
    """
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    faces_corners = ((mesh.vertices - (low + high) / 2) / np.linalg.norm(high - low))[mesh.faces]
    areas = face_areas(mesh)
    edges = np.roll(faces_corners, -1, axis=1) - faces_corners
    longest = np.argmax(np.linalg.norm(edges, axis=2).round(DIGITS), axis=1)
    turned = (longest[:, None] + np.arange(3)) % 3
    corners, edges = (np.take_along_axis(values, turned[..., None], axis=1) for values in (faces_corners, edges))
    normal = np.cross(edges[:, 0], edges[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    along = edges[:, 0] / np.linalg.norm(edges[:, 0], axis=1, keepdims=True)
    frames = np.stack([along, np.cross(normal, along), normal], axis=1)
    counts = np.maximum(np.ceil(SAMPLES * areas / areas.sum()).astype(np.int64), 1)
    faces = np.repeat(np.arange(len(areas)), counts)
    rank = np.arange(len(faces)) - np.repeat(np.cumsum(counts) - counts, counts)
    first, second = ((0.5 + rank / PLASTIC**power) % 1.0 for power in (1, 2))
    first, second = 1 - np.sqrt(1 - first), second * np.sqrt(1 - first)
    shares = np.stack([first, second, 1 - first - second], axis=1)
    points = np.einsum("nc,ncd->nd", shares, corners[faces])
    return SurfacePoints(faces_corners, points, faces, frames[faces], (areas / counts)[faces])


def shape_diameter(surface: SurfacePoints) -> Float[ndarray, " n"]:
    """Local thickness at each point, in diagonals of the mesh: the second shortest of five inward rays.

    Differs from: Shapira et al., who take a weighted mean of the rays in a cone. By the second shortest, the narrow
    side of a plate is as thin as its wide ones.
    """
    return np.clip(np.sort(_cast(surface, -1.0, (STEEP,)), axis=0)[1], LIFT, 1.0)


def ambient_occlusion(surface: SurfacePoints) -> Float[ndarray, " n"]:
    """Share of nine outward rays at each point that meet the mesh, scaled from 0 on open ground to 1 in a pocket."""
    met = (_cast(surface, 1.0, (STEEP, FLAT)) < np.inf).mean(axis=0)
    return np.clip((met - POCKET[0]) / (POCKET[1] - POCKET[0]), 0.0, 1.0)


def _cast(surface: SurfacePoints, side: float, tilts: tuple[float, ...]) -> Float[ndarray, "r n"]:
    """Cast rays along the normal, and four around it for each tilt: their lengths, infinite where they miss.

    Args:
        surface: Starts of the rays.
        side: 1 for outward, -1 for inward.
        tilts: Angles to the normal, radians.
    """
    along, across, normal = surface.frames.swapaxes(0, 1)
    normal = side * normal
    around = (along, across, -along, -across)
    tilted = [np.cos(tilt) * normal + np.sin(tilt) * tangent for tilt in tilts for tangent in around]
    directions = np.stack([normal, *tilted])
    origins = np.broadcast_to(surface.points + LIFT * normal, directions.shape)
    lengths = ray_lengths(surface.corners, origins.reshape(-1, 3), directions.reshape(-1, 3))
    return lengths.reshape(len(directions), -1)
