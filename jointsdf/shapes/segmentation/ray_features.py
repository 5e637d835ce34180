"""What rays from the surface meet: how thick a region is, and how deep in a pocket."""

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
PLASTIC = 1.324717957244746  # generates the evenly spread sequence of points


def surroundings(mesh: LabelledMesh, regions: Int[ndarray, " f"]) -> tuple[Float[ndarray, " r"], Float[ndarray, " r"]]:
    """Thickness and occlusion of each region, means over its area.

    Thickness is the logarithm of the second shortest of five inward rays (the second, so that the narrow side of a
    plate is as thin as its wide ones), in diagonals of the mesh. Occlusion, 0..1, is the share of nine outward rays
    that meet the mesh again, counted from open ground to the inside of a pocket.

    Args:
        mesh: Any frame.
        regions: Region of each face, 0, 1, ...
    """
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    corners = ((mesh.vertices - (low + high) / 2) / np.linalg.norm(high - low))[mesh.faces]
    faces, points, frames, weights = _samples(corners, face_areas(mesh))
    thickness = np.log(np.clip(np.sort(_reach(corners, points, frames, -1.0, (STEEP,)), axis=0)[1], LIFT, 1.0))
    met = (_reach(corners, points, frames, 1.0, (STEEP, FLAT)) < np.inf).mean(axis=0)
    occlusion = np.clip((met - POCKET[0]) / (POCKET[1] - POCKET[0]), 0.0, 1.0)
    total = np.bincount(regions[faces], weights)
    thickness, occlusion = (np.bincount(regions[faces], weights * values) / total for values in (thickness, occlusion))
    return thickness, occlusion


def _samples(
    corners: Float[ndarray, "f 3 3"], areas: Float[ndarray, " f"]
) -> tuple[ndarray, ndarray, ndarray, ndarray]:
    """Points spread over the faces in proportion to area: their faces, positions, frames (rows) and areas."""
    edges = np.roll(corners, -1, axis=1) - corners
    longest = np.argmax(np.linalg.norm(edges, axis=2).round(9), axis=1)
    turned = (longest[:, None] + np.arange(3)) % 3  # the frame and the points do not depend on a face's first corner
    corners, edges = (np.take_along_axis(values, turned[..., None], axis=1) for values in (corners, edges))
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
    return faces, np.einsum("nc,ncd->nd", shares, corners[faces]), frames[faces], (areas / counts)[faces]


def _reach(
    corners: Float[ndarray, "f 3 3"],
    points: Float[ndarray, "n 3"],
    frames: Float[ndarray, "n 3 3"],
    side: float,
    tilts: tuple[float, ...],
) -> Float[ndarray, "r n"]:
    """How far rays go: one along the normal, and four around it for each tilt; infinite where they meet nothing.

    Args:
        corners: Of the faces, in diagonals of the mesh about its centre.
        points: Where the rays start, same frame.
        frames: Two tangents and the normal at each point.
        side: 1 for outward, -1 for inward.
        tilts: Angles to the normal, radians.
    """
    along, across, normal = frames.swapaxes(0, 1)
    normal = side * normal
    around = (along, across, -along, -across)
    tilted = [np.cos(tilt) * normal + np.sin(tilt) * tangent for tilt in tilts for tangent in around]
    directions = np.stack([normal, *tilted])
    origins = np.broadcast_to(points + LIFT * normal, directions.shape)
    return ray_lengths(corners, origins.reshape(-1, 3), directions.reshape(-1, 3)).reshape(len(directions), -1)
