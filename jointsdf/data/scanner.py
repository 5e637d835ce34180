"""Simulated laser scanner: what views from all around see of a mesh, with noise of the range, by ray casting."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from jointsdf.errors import require_integer, require_number
from jointsdf.geometry.mesh import face_normals
from jointsdf.geometry.rays import ray_hits
from jointsdf.values import LabelledMesh

MOST_VIEWS = 1000
DISTANCE = 3.0  # of the scanner from the middle, radii of the sphere about the mesh
GRAZING = np.cos(np.radians(80.0))  # least cosine between a ray and the face's normal: what is flatter sends no echo


@dataclass(frozen=True)
class Scanner:
    """A scanner that is put up at several places around a part.

    Attributes:
        views: Number of places, spread evenly over a sphere (Fibonacci lattice); 0 for no scanner.
        noise: Standard deviation of the measured range, along the ray, as a share of the part's longest side.

    Raises:
        InputError: A value out of its range.
    """

    views: int = 0
    noise: float = 0.0

    def __post_init__(self) -> None:
        """Check the ranges."""
        require_integer("data.corruption.scanner.views", self.views, 0, MOST_VIEWS)
        require_number("data.corruption.scanner.noise", self.noise, 0, 1)

    def scan(
        self, mesh: LabelledMesh, rays: int, places: Generator, generator: Generator
    ) -> tuple[Float[ndarray, "h 3"], Int[ndarray, " h"]]:
        """Cast rays from the places to uniform points of the disc that the mesh's bounding sphere shows to them.

        Args:
            mesh: File frame.
            rays: Their number over all places, dealt to these at random.
            places: Turns the places about the mesh; the same state gives the same places.
            generator: Of the rays and of their noise.

        Returns:
            Where rays meet the mesh first, moved along the ray by the noise, file frame; and the faces met. Rays that
            miss it, or graze it, give no point.
        """
        corners = mesh.vertices[mesh.faces].astype(np.float64)
        low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        middle, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
        corners = (corners - middle) / radius
        towards = spread_directions(self.views, places)[generator.integers(self.views, size=rays)]
        side = np.linalg.cross(towards, np.eye(3)[np.abs(towards).argmin(axis=1)])
        side /= np.linalg.norm(side, axis=1, keepdims=True)
        turn, away = 2 * np.pi * generator.random((rays, 1)), np.sqrt(generator.random((rays, 1)))
        aims = away * (np.cos(turn) * side + np.sin(turn) * np.linalg.cross(towards, side))
        origins = DISTANCE * towards
        directions = (aims - origins) / np.linalg.norm(aims - origins, axis=1, keepdims=True)
        lengths, faces = ray_hits(corners, origins, directions)
        normals = face_normals(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))[faces]
        slopes = np.einsum("ij,ij->i", directions, normals)
        met = np.isfinite(lengths) & (np.abs(slopes) > GRAZING)
        origins, directions, faces = origins[met], directions[met], faces[met]
        # on the face's plane again: the rays were cast in 32 bits
        ranges = np.einsum("ij,ij->i", corners[faces, 0] - origins, normals[met]) / slopes[met]
        ranges += generator.normal(0, self.noise * (high - low).max() / radius, len(ranges)) if self.noise else 0
        return middle + radius * (origins + ranges[:, None] * directions), faces


def spread_directions(count: int, generator: Generator) -> Float[ndarray, "n 3"]:
    """Unit vectors spread evenly over the sphere, turned at random: the Fibonacci lattice (Gonzalez 2010)."""
    number = np.arange(count)
    height, turn = (2 * number + 1) / count - 1, np.pi * (1 + np.sqrt(5)) * number
    width = np.sqrt(1 - height**2)
    lattice = np.stack([width * np.cos(turn), width * np.sin(turn), height], axis=1)
    return np.asarray(Rotation.random(rng=generator).apply(lattice))
