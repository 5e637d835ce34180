"""From a shape to its training cloud, its pool of known signed distances, and the sampler of every step."""

import logging
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from jointsdf.data.point_cloud import Cloud, draw_pool
from jointsdf.data.sampler import Counts, Sampler
from jointsdf.data.surfels import Surfels
from jointsdf.errors import InputError, require_integer, require_number, require_one_of
from jointsdf.geometry.distance import network_distance
from jointsdf.values import Shape

LEAST_POINTS = 100  # of the cloud: the 51st neighbour must exist, and the points must show a surface

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class SampleSettings:
    """Sizes of the cloud and the pool, and the source of distances.

    Attributes:
        cloud_size: Points of the training cloud.
        pool_size: Points with known signed distance; 0 where no term uses them.
        distances: Source of those distances and of the normals: `mesh`, exact; `cloud`, estimated from the uniform
            points of the cloud alone.
        pool_near: Share of the pool near the surface; the rest is uniform in the box.
        region_points: Points of the cloud spread over the smooth regions, beyond `cloud_size`.
        border_points: Points of the cloud near part borders, beyond `cloud_size`.
        label_fraction: Share of the cloud that has its labels.

    Raises:
        InputError: A value out of its range.
    """

    cloud_size: int
    pool_size: int
    distances: str = "mesh"
    pool_near: float = 0.5
    region_points: int = 0
    border_points: int = 0
    label_fraction: float = 1.0

    def __post_init__(self) -> None:
        """Check the ranges."""
        require_integer("data.cloud_size", self.cloud_size, LEAST_POINTS)
        for name in ("pool_size", "region_points", "border_points"):
            require_integer(f"data.{name}", getattr(self, name), 0)
        require_one_of("data.distances", self.distances, ("mesh", "cloud"))
        require_number("data.pool_near", self.pool_near, 0, 1)
        require_number("data.label_fraction", self.label_fraction, 0, 1)


def draw_cloud(shape: Shape, settings: SampleSettings, seed: int) -> Cloud:
    """Draw the training cloud of a shape; the same arguments give the same cloud."""
    return Cloud.of(
        shape.mesh,
        count=settings.cloud_size,
        seed=seed,
        label_fraction=settings.label_fraction,
        region_points=settings.region_points,
        border_points=settings.border_points,
    )


def prepare_samples(shape: Shape, cloud: Cloud, counts: Counts, settings: SampleSettings, seed: int) -> Sampler:
    """Build the sampler of every training step.

    Args:
        shape: Ground truth.
        cloud: From `draw_cloud`, with the same settings and seed.
        counts: Points per step.
        settings: Sizes, and where distances come from.
        seed: Of the run.

    Raises:
        InputError: A cloud from which no distance can be estimated.
    """
    pool = draw_pool(cloud, count=settings.pool_size, near_share=settings.pool_near, seed=seed)
    if settings.distances == "mesh":
        exact = network_distance(shape, cloud.normalisation)
        known = exact.signed(pool)
        gradients = np.zeros_like(pool)
        if counts.far:
            anywhere = slice(round(len(pool) * settings.pool_near), None)
            gradients[anywhere] = exact.gradients(pool[anywhere], known[anywhere])
        return Sampler(cloud, pool, known, counts, seed, gradients)
    cloud, pool, known = estimate_from_cloud(cloud, pool)
    return Sampler(cloud, pool, known, counts, seed)


def estimate_from_cloud(
    cloud: Cloud, pool: Float[ndarray, "p 3"]
) -> tuple[Cloud, Float[ndarray, "q 3"], Float[ndarray, " q"]]:
    """Estimate normals and signed distances from the uniform points of the cloud alone, where they are unambiguous.

    Args:
        cloud: Its own normals are not used; points beyond the uniform ones get none.
        pool: Points to estimate distances at, network frame.

    Returns:
        The cloud with the estimated normals, the pool points whose distance is known, and those distances.

    Raises:
        InputError: No distance can be estimated.
    """
    surfels = Surfels(cloud.points[: cloud.uniform])
    normals = np.zeros_like(cloud.normals)
    normals[: cloud.uniform] = surfels.normals
    distances, known = surfels.signed(pool)
    if len(pool) and not known.any():
        raise InputError(
            f"data.distances=cloud: {cloud.uniform} points leave no free space in the box; "
            "use a larger data.cloud_size, or data.distances=mesh"
        )
    shares = surfels.normals.any(axis=1).mean(), known.mean() if len(pool) else 0.0
    log.info("the cloud gives normals at %.0f%% of its points, and %.0f%% of the distances", *(100 * x for x in shares))
    return replace(cloud, normals=normals), pool[known], distances[known]
