"""Points of each training step, a function of (seed, step) alone."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int
from numpy import ndarray
from numpy.random import Generator
from scipy.spatial import KDTree
from torch import Tensor

from jointsdf.data.point_cloud import Cloud
from jointsdf.data.streams import STEPS, stream
from jointsdf.errors import InputError, require_integer, require_number
from jointsdf.values import BOX, Samples

STRETCH = 10  # steps on end in which every part gets its points
SHELL_NEIGHBOUR = 51  # width of the noise: distance to this neighbour, as in the released FlatCAD code


@dataclass(frozen=True)
class Counts:
    """Numbers of points in one step.

    Attributes:
        manifold: On the surface, from the cloud.
        non_manifold: Uniform in the box.
        shell: Near the surface.
        pool: With known signed distance.
        far: Away from the surface, with known gradient of the distance.
        balanced: Share of the manifold points drawn equally from every part.
        per_part: Least number of labelled points of every part in any ten steps on end. The balanced share is dealt to
            the parts in turn and grows with their number, as far as the other shares leave room; 0: drawn at random.
        regions: Share of them drawn from the points spread over the smooth regions, where the cloud has such points.
        creases: Share of them drawn beside creases, where the cloud has such points.
        borders: Share of them drawn near part borders, where the cloud has such points; the rest is uniform.
        shell_offset: Shell points are also moved along their normal, where it is known, by U(-offset, offset), one draw
            per point, network length units.
    """

    manifold: int
    non_manifold: int
    shell: int
    pool: int
    far: int = 0
    balanced: float = 0.0
    per_part: int = 0
    regions: float = 0.0
    creases: float = 0.0
    borders: float = 0.0
    shell_offset: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            InputError: A count below 1, a share outside 0..1, or a negative offset.
        """
        for name in ("manifold", "non_manifold", "shell", "pool"):
            require_integer(f"data.counts.{name}", getattr(self, name), 1)
        for name in ("far", "per_part"):
            require_integer(f"data.counts.{name}", getattr(self, name), 0)
        shares = {name: getattr(self, name) for name in ("balanced", "regions", "creases", "borders")}
        for name, share in shares.items():
            require_number(f"data.counts.{name}", share, 0, 1)
        if sum(shares.values()) > 1:
            given = " ".join(f"{name}={share}" for name, share in shares.items())
            raise InputError(f"data.counts.{given}: together they must not exceed 1")
        require_number("data.counts.shell_offset", self.shell_offset, 0, 1)

    def of_parts(self, parts: int) -> int:
        """Manifold points of a step that are balanced over so many parts.

        >>> counts = Counts(1000, 1, 1, 1, balanced=0.25, regions=0.25, creases=0.1, borders=0.15, per_part=24)
        >>> counts.of_parts(33), counts.of_parts(200), counts.of_parts(900)
        (250, 480, 500)
        """
        if parts == 0:
            return 0
        room = self.manifold - sum(round(self.manifold * share) for share in (self.regions, self.creases, self.borders))
        return max(round(self.manifold * self.balanced), min(-(-self.per_part * parts // STRETCH), room))


class Sampler:
    """Draws the `Samples` of any step from the cloud and the pool.

    Args:
        cloud: The training cloud.
        pool: Points with known signed distances, network frame; may be empty.
        pool_distances: Those distances, network length units.
        pool_gradients: Their gradients, of unit length; 0 where they are not known.
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
        pool_gradients: Float[ndarray, "p 3"] | None = None,
    ) -> None:
        self.cloud, self.pool, self.pool_distances = cloud, pool, pool_distances
        self.pool_gradients = np.zeros_like(pool) if pool_gradients is None else pool_gradients
        self.far = np.flatnonzero(self.pool_gradients.any(axis=1))
        self.counts, self.seed = counts, seed
        neighbours = min(SHELL_NEIGHBOUR, cloud.uniform - 1)
        uniform = cloud.points[: cloud.uniform]
        self.shell_widths = KDTree(uniform).query(uniform, [neighbours + 1], workers=-1)[0]
        among = cloud.part_points if cloud.of_parts else slice(cloud.uniform)
        labels = cloud.labels[among]
        self.by_class = among.indices(len(cloud.points))[0] + np.argsort(labels, kind="stable")
        self.class_sizes = np.bincount(labels[labels >= 0], minlength=len(cloud.part_ids))
        self.class_starts = np.cumsum(self.class_sizes) - self.class_sizes + (labels < 0).sum()
        self.present = np.flatnonzero(self.class_sizes)

    def draw(self, step: int) -> Samples:
        """Draw the points of one step.

        Args:
            step: Counted from 0.
        """
        generator, cloud, counts = stream(self.seed, STEPS, step), self.cloud, self.counts
        manifold = self._draw_manifold(generator, step)
        around = generator.integers(cloud.uniform, size=counts.shell)
        shell = cloud.points[around] + self.shell_widths[around] * generator.standard_normal((counts.shell, 3))
        if counts.shell_offset:
            offsets = generator.uniform(-counts.shell_offset, counts.shell_offset, (counts.shell, 1))
            shell = shell + offsets * cloud.normals[around]
        known = generator.integers(len(self.pool), size=counts.pool) if len(self.pool) else np.arange(0)
        anywhere = generator.uniform(-BOX, BOX, (counts.non_manifold, 3))
        angles = generator.uniform(0, 2 * np.pi, counts.shell)
        far = self.far[generator.integers(len(self.far), size=counts.far)] if len(self.far) else self.far
        return Samples(
            manifold=_to_float32(cloud.points[manifold]),
            labels=torch.from_numpy(cloud.labels[manifold]),
            normals=_to_float32(cloud.normals[manifold]),
            non_manifold=_to_float32(anywhere),
            shell=_to_float32(shell),
            angles=_to_float32(angles),
            pool=_to_float32(self.pool[known]),
            pool_distances=_to_float32(self.pool_distances[known]),
            far=_to_float32(self.pool[far]),
            far_gradients=_to_float32(self.pool_gradients[far]),
        )

    def _draw_manifold(self, generator: Generator, step: int) -> Int[ndarray, " m"]:
        """Indices into the cloud: shares balanced over parts, over regions, beside creases, near borders; uniform."""
        counts, cloud = self.counts, self.cloud
        indices = generator.integers(cloud.uniform, size=counts.manifold)
        parts = len(self.present)
        balanced = counts.of_parts(parts)
        if balanced:
            if counts.per_part:  # in turn, where the step before ended
                turn = (step * balanced + np.arange(balanced)) % parts
            else:
                turn = generator.integers(parts, size=balanced)
            chosen = self.present[turn]
            within = (generator.random(balanced) * self.class_sizes[chosen]).astype(np.int64)
            indices[:balanced] = self.by_class[self.class_starts[chosen] + within]
        begin = balanced
        for share, first, number in (
            (counts.regions, cloud.uniform, cloud.regional),
            (counts.creases, cloud.uniform + cloud.regional, cloud.creased),
        ):
            if number:
                size = min(round(counts.manifold * share), counts.manifold - begin)
                indices[begin : begin + size] = generator.integers(first, first + number, size=size)
                begin += size
        near = cloud.border_points
        bordering = round(counts.manifold * counts.borders) if near.stop > near.start else 0
        if bordering:
            indices[-bordering:] = generator.integers(near.start, near.stop, size=bordering)
        return indices


def _to_float32(array: ndarray) -> Tensor:
    return torch.from_numpy(array.astype(np.float32))
