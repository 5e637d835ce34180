"""Training cloud of a shape, and the pool of points at which its signed distance is taken."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from numpy.random import Generator, Philox
from scipy.spatial import KDTree

from jointsdf.errors import require_integer
from jointsdf.geometry.face_graph import face_graph, smooth_regions
from jointsdf.geometry.mesh import face_areas, face_normals
from jointsdf.geometry.sampling import sample_by_area, sample_near_borders
from jointsdf.values import BOX, UNLABELLED, LabelledMesh, Normalisation

POOL_SCALES = (-3.0, -1.0)  # log10 of the narrowest and widest near-surface noise of the pool, network length units
STEP_BITS = 48  # of a stream's key that hold the step; the purpose is above them
CLOUD, POOL, LABELS, STEPS, BORDERS, REGIONS = range(6)  # one random stream each


def stream(seed: int, purpose: int, step: int = 0) -> Generator:
    """Counter-based generator (Philox: Salmon et al. 2011) of one purpose and step.

    It has no state to save between steps, and draws the same on every machine.

    Args:
        seed: Of the run.
        purpose: `CLOUD`, `POOL`, ...
        step: Training step, below 2^48.

    Raises:
        InputError: A negative seed.

    >>> stream(0, CLOUD).random() == stream(0, CLOUD).random() != stream(0, POOL).random()
    True
    """
    require_integer("seed", seed, 0)
    return Generator(Philox(key=[seed, (purpose << STEP_BITS) + step]))


@dataclass(frozen=True)
class Cloud:
    """Training cloud: the points of the surface that a run trains on.

    Attributes:
        points: In the network frame: `uniform` of them uniform by area, then `regional` spread over the smooth regions,
            the others near part borders.
        normals: Unit normals of the points' faces, or estimated from the points; 0 where they are unknown.
        labels: Class index 0..K-1, -1 where unlabelled.
        part_ids: Original id of each class, ascending.
        normalisation: File frame -> network frame: the cloud's mean, and its largest |coordinate| about it.
        uniform: Number of points uniform by area.
        regional: Number of points spread over the smooth regions, so that small regions have their share.
    """

    points: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    labels: Int[ndarray, " n"]
    part_ids: Int[ndarray, " k"]
    normalisation: Normalisation
    uniform: int
    regional: int = 0

    @classmethod
    def of(
        cls,
        mesh: LabelledMesh,
        *,
        count: int,
        seed: int,
        label_fraction: float = 1.0,
        region_points: int = 0,
        border_points: int = 0,
    ) -> "Cloud":
        """Draw the cloud of a ground-truth mesh.

        Args:
            mesh: Ground truth, file frame.
            count: Points uniform by area.
            seed: Of the run.
            label_fraction: Share of the points that keep their label.
            region_points: Points spread over the smooth regions, beyond `count`.
            border_points: Points near part borders, beyond `count`; none where the mesh has no border.
        """
        areas = face_areas(mesh)
        points, faces = sample_by_area(mesh.vertices, mesh.faces, areas, count, stream(seed, CLOUD))
        centre = points.mean(axis=0)
        normalisation = Normalisation(centre, float(np.abs(points - centre).max()))
        drawn = [(points, faces)]
        if region_points:
            shares = areas / np.sqrt(region_areas(mesh, areas))
            drawn.append(sample_by_area(mesh.vertices, mesh.faces, shares, region_points, stream(seed, REGIONS)))
        if border_points:
            drawn.append(sample_near_borders(mesh, border_points, stream(seed, BORDERS)))
        points, faces = (np.concatenate(parts) for parts in zip(*drawn, strict=True))
        labels = np.where(
            mesh.labels[faces] == UNLABELLED, UNLABELLED, np.searchsorted(mesh.part_ids, mesh.labels[faces])
        )
        dropped = stream(seed, LABELS).permutation(len(points))[round(len(points) * label_fraction) :]
        labels[dropped] = UNLABELLED
        normals = face_normals(mesh.vertices, mesh.faces)[faces]
        return cls(normalisation.forward(points), normals, labels, mesh.part_ids, normalisation, count, region_points)

    def relative_area(self) -> float:
        """Area of the surface in squares of half its longest side, estimated from the uniform points alone.

        On a plane with point density rho the squared distance to the nearest point has the mean 1 / (pi rho), as in
        Clark and Evans (1954). Too small where walls and gaps are thinner than that distance.
        """
        points = self.points[: self.uniform]
        nearest = KDTree(points).query(points, [2], workers=-1)[0]
        return float(len(points) * np.pi * (nearest**2).mean() / (np.ptp(points, axis=0).max() / 2) ** 2)


def region_areas(mesh: LabelledMesh, areas: Float[ndarray, " f"]) -> Float[ndarray, " f"]:
    """Area of the smooth region that each face belongs to, in the unit of `areas`."""
    regions = smooth_regions(face_graph(mesh), None)
    return np.asarray(np.bincount(regions, areas)[regions])


def draw_pool(cloud: Cloud, *, count: int, near_share: float, seed: int) -> Float[ndarray, "n 3"]:
    """Draw points at which distances are taken, network frame: a share near the surface, the rest in the whole box.

    Near points are Gaussian about cloud points, not those of part borders, with a log-uniform width, so that every wall
    thickness is met. Half of the rest is uniform, half has arcsine-distributed coordinates, so that the corners of the
    box are met as well.

    Args:
        cloud: The training cloud.
        count: Number of points.
        near_share: Share of them near the surface, 0..1.
        seed: Of the run.
    """
    generator = stream(seed, POOL)
    near = round(count * near_share)
    widths = 10 ** generator.uniform(*POOL_SCALES, (near, 1))
    around = cloud.points[generator.integers(cloud.uniform + cloud.regional, size=near)]
    near_points = np.clip(around + widths * generator.standard_normal((near, 3)), -BOX, BOX)
    anywhere = generator.uniform(-1, 1, (count - near, 3))
    anywhere[::2] = np.sin(np.pi / 2 * anywhere[::2])
    return np.concatenate([near_points, BOX * anywhere])
