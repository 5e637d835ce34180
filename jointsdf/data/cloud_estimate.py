"""What a training cloud tells by its points alone: denoised places, normals and signed distances."""

import logging
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.spatial import KDTree

from jointsdf.data.denoising import denoise
from jointsdf.data.label_noise import doubtful_labels
from jointsdf.data.point_cloud import Cloud
from jointsdf.data.surfels import Surfels
from jointsdf.errors import InputError
from jointsdf.geometry.cloud_statistics import NEIGHBOUR, mark_outliers
from jointsdf.model.far_grid import Distance
from jointsdf.values import UNLABELLED

log = logging.getLogger(__name__)


def estimate_from_cloud(
    cloud: Cloud, pool: Float[ndarray, "p 3"], *, denoised: bool = False
) -> tuple[Cloud, Float[ndarray, "q 3"], Float[ndarray, " q"], Distance]:
    """Estimate normals and signed distances from the uniform points of the cloud alone, where they are unambiguous.

    Args:
        cloud: Its own normals are not used; points beyond the uniform ones get none.
        pool: Points to estimate distances at, network frame.
        denoised: Whether to leave out stray points and doubtful labels, and to take the noise off the other points.

    Returns:
        The cloud with the estimated normals, the pool points whose distance is known, those distances, and the estimate
        itself, 0 where the distance is unknown.

    Raises:
        InputError: No distance can be estimated.
    """
    cloud, surfels = find_surfels(cloud, denoised=denoised)
    distances, known = surfels.signed(pool)
    if len(pool) and not known.any():
        raise InputError(
            f"data.distances=cloud: {cloud.uniform} points leave no free space in the box; "
            "use a larger data.cloud_size, or data.distances=mesh"
        )
    shares = cloud.normals[: cloud.uniform].any(axis=1).mean(), known.mean() if len(pool) else 0.0
    log.info("the cloud gives normals at %.0f%% of its points, and %.0f%% of the distances", *(100 * x for x in shares))
    return cloud, pool[known], distances[known], lambda points: surfels.signed(points)[0]


def find_surfels(cloud: Cloud, *, denoised: bool) -> tuple[Cloud, Surfels]:
    """Surfels of a cloud's uniform points, and the cloud with their normals, and places where it is denoised."""
    if denoised:
        cloud = cloud.without(_stray(cloud.points[: cloud.uniform]))
        doubtful = doubtful_labels(cloud.points, cloud.labels)
        cloud = replace(cloud, labels=np.where(doubtful, UNLABELLED, cloud.labels))
    points = cloud.points[: cloud.uniform]
    smooth = denoise(points) if denoised else None
    surfels = Surfels(*(smooth or (points,)), solid=denoised)
    normals, places = np.zeros_like(cloud.normals), cloud.points.copy()
    normals[: cloud.uniform], places[: cloud.uniform] = (x[: cloud.uniform] for x in (surfels.normals, surfels.points))
    return replace(cloud, points=places, normals=normals), surfels


def _stray(points: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
    """Mark of the points that are far from all others."""
    neighbour = min(NEIGHBOUR, len(points) - 1)
    return mark_outliers(KDTree(points).query(points, [neighbour + 1], workers=-1)[0][:, 0])
