"""The draws of a run: the training cloud once, and the points of each step as a function of (seed, step) alone."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int
from numpy import ndarray
from numpy.random import Generator, Philox
from scipy.spatial import KDTree
from torch import Tensor

from jointsdf.values import BOX, UNLABELLED, InputError, LabelledMesh, Normalisation, Samples

SHELL_NEIGHBOUR = 51  # the released FlatCAD code: noise as wide as the distance to the 51st neighbour
POOL_SCALES = (-3.0, -1.0)  # log10 of the narrowest and widest near-surface noise of the pool, network length units
CLOUD, POOL, LABELS, STEPS = range(4)  # one random stream each


def stream(seed: int, purpose: int, step: int = 0) -> Generator:
    """The counter-based generator of one purpose and step: no state to save, the same on every machine.

    Raises:
        InputError: A negative seed.
    """
    if seed < 0:
        raise InputError(f"seed={seed}: must be at least 0")
    return Generator(Philox(key=[seed, (purpose << 48) + step]))


def area_uniform(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], count: int, generator: Generator
) -> tuple[Float[ndarray, "n 3"], Int[ndarray, " n"]]:
    """Points uniform by area on a triangle mesh, in its own frame, and the face of each."""
    a, b, c = vertices[faces].transpose(1, 0, 2)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    cumulative = np.cumsum(areas)
    chosen = np.searchsorted(cumulative, generator.random(count) * cumulative[-1], side="right")
    chosen = np.minimum(chosen, len(faces) - 1)
    s, t = generator.random((2, count, 1))
    s, t = np.where(s + t > 1, 1 - s, s), np.where(s + t > 1, 1 - t, t)
    return a[chosen] + s * (b - a)[chosen] + t * (c - a)[chosen], chosen


def face_normals(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> Float[ndarray, "f 3"]:
    """Unit normal of each face, by its winding; zero for a degenerate face."""
    a, b, c = vertices[faces].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)


@dataclass(frozen=True)
class Cloud:
    """The training cloud: what the network is told of the surface.

    Attributes:
        points: In the network frame.
        normals: Unit normals of the points' faces.
        labels: Class index 0..K-1, -1 where unlabelled.
        part_ids: Original id of each class, ascending.
        normalisation: File frame -> network frame: the cloud's mean, and its largest |coordinate| about it.
    """

    points: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    labels: Int[ndarray, " n"]
    part_ids: Int[ndarray, " k"]
    normalisation: Normalisation

    @classmethod
    def of(cls, mesh: LabelledMesh, *, count: int, seed: int, label_fraction: float = 1.0) -> "Cloud":
        """Draw the cloud of a ground-truth mesh in the file frame.

        Args:
            mesh: Ground truth.
            count: Points.
            seed: Of the run.
            label_fraction: Share of the points that keep their label.

        Raises:
            InputError: Fewer than two points, or a share outside 0..1.
        """
        if count < 2:
            raise InputError(f"data.cloud_size={count}: must be at least 2")
        if not 0 <= label_fraction <= 1:
            raise InputError(f"data.label_fraction={label_fraction}: must be between 0 and 1")
        points, faces = area_uniform(mesh.vertices, mesh.faces, count, stream(seed, CLOUD))
        centre = points.mean(axis=0)
        normalisation = Normalisation(centre, float(np.abs(points - centre).max()))
        labels = np.where(
            mesh.labels[faces] == UNLABELLED, UNLABELLED, np.searchsorted(mesh.part_ids, mesh.labels[faces])
        )
        dropped = stream(seed, LABELS).permutation(count)[round(count * label_fraction) :]
        labels[dropped] = UNLABELLED
        normals = face_normals(mesh.vertices, mesh.faces)[faces]
        return cls(normalisation.forward(points), normals, labels, mesh.part_ids, normalisation)


def pool_points(cloud: Cloud, *, count: int, seed: int) -> Float[ndarray, "n 3"]:
    """Where exact signed distances are taken, network frame: half uniform in the box, half near the surface.

    The near half is Gaussian about cloud points with a width drawn log-uniform, so that every wall thickness is met.
    """
    generator = stream(seed, POOL)
    near = count // 2
    widths = 10 ** generator.uniform(*POOL_SCALES, (near, 1))
    around = cloud.points[generator.integers(len(cloud.points), size=near)]
    near_points = np.clip(around + widths * generator.standard_normal((near, 3)), -BOX, BOX)
    return np.concatenate([near_points, generator.uniform(-BOX, BOX, (count - near, 3))])


@dataclass(frozen=True)
class Counts:
    """Points of one step.

    Attributes:
        manifold: On the surface, from the cloud.
        non_manifold: Uniform in the box.
        shell: Near the surface.
        pool: With known signed distance.
        balanced: Share of the manifold points drawn equally from every part; the rest is uniform over the cloud.
        shell_offset: Shell points are also moved along their normal by U(-offset, offset), one draw per point,
            network length units.
    """

    manifold: int
    non_manifold: int
    shell: int
    pool: int
    balanced: float = 0.0
    shell_offset: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            InputError: A count below 1, a share outside 0..1, or a negative offset.
        """
        for name in ("manifold", "non_manifold", "shell", "pool"):
            if getattr(self, name) < 1:
                raise InputError(f"data.counts.{name}={getattr(self, name)}: must be at least 1")
        if not 0 <= self.balanced <= 1:
            raise InputError(f"data.counts.balanced={self.balanced}: must be between 0 and 1")
        if self.shell_offset < 0:
            raise InputError(f"data.counts.shell_offset={self.shell_offset}: must be at least 0")


class Sampler:
    """Draws the `Samples` of any step.

    Args:
        cloud: The training cloud.
        pool: Points with exact signed distances, network frame; may be empty.
        pool_distances: Those distances, network length units.
        counts: Points per step.
        seed: Of the run.
    """

    def __init__(
        self,
        cloud: Cloud,
        pool: Float[ndarray, "p 3"],
        pool_distances: Float[ndarray, " p"],
        counts: Counts,
        seed: int,
    ) -> None:
        self.cloud, self.pool, self.pool_distances = cloud, pool, pool_distances
        self.counts, self.seed = counts, seed
        neighbours = min(SHELL_NEIGHBOUR, len(cloud.points) - 1)
        self.shell_widths = KDTree(cloud.points).query(cloud.points, [neighbours + 1], workers=-1)[0]
        classes = [np.flatnonzero(cloud.labels == k) for k in range(len(cloud.part_ids))]
        self.points_of_class = [points for points in classes if len(points)]

    def draw(self, step: int) -> Samples:
        """The points of one step, counted from 0."""
        generator, cloud, counts = stream(self.seed, STEPS, step), self.cloud, self.counts
        manifold = self._manifold(generator)
        around = generator.integers(len(cloud.points), size=counts.shell)
        shell = cloud.points[around] + self.shell_widths[around] * generator.standard_normal((counts.shell, 3))
        if counts.shell_offset:
            offsets = generator.uniform(-counts.shell_offset, counts.shell_offset, (counts.shell, 1))
            shell = shell + offsets * cloud.normals[around]
        known = generator.integers(len(self.pool), size=counts.pool) if len(self.pool) else np.arange(0)
        return Samples(
            manifold=_float(cloud.points[manifold]),
            labels=torch.from_numpy(cloud.labels[manifold]),
            non_manifold=_float(generator.uniform(-BOX, BOX, (counts.non_manifold, 3))),
            shell=_float(shell),
            angles=_float(generator.uniform(0, 2 * np.pi, counts.shell)),
            pool=_float(self.pool[known]),
            pool_distances=_float(self.pool_distances[known]),
        )

    def _manifold(self, generator: Generator) -> Int[ndarray, " m"]:
        """Indices into the cloud: a uniform share, and a share balanced over the parts."""
        counts, classes = self.counts, self.points_of_class
        indices = generator.integers(len(self.cloud.points), size=counts.manifold)
        balanced = round(counts.manifold * counts.balanced) if classes else 0
        if not balanced:
            return indices
        chosen = generator.integers(len(classes), size=balanced)
        shares = generator.random(balanced)
        for slot, (k, share) in enumerate(zip(chosen, shares, strict=True)):
            indices[slot] = classes[k][int(share * len(classes[k]))]
        return indices


def _float(array: ndarray) -> Tensor:
    return torch.from_numpy(array.astype(np.float32))
