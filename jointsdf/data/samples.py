"""From a shape to its training cloud, its pool of known signed distances, and the sampler of every step."""

import logging
from dataclasses import replace

import numpy as np

from jointsdf.data.cloud_estimate import estimate_from_cloud
from jointsdf.data.point_cloud import Cloud, draw_pool
from jointsdf.data.sample_settings import SampleSettings
from jointsdf.data.sampler import Counts, Sampler
from jointsdf.data.scan_points import require_mesh, training_points
from jointsdf.data.streams import REFIT, stream
from jointsdf.errors import InputError
from jointsdf.geometry.distance import network_distance
from jointsdf.model.far_grid import Distance, FarGrid
from jointsdf.values import UNLABELLED, LabelledPoints, Scan, Subject

OFF_SURFACE = 0.002  # width of the Gaussian by which labelled points are moved, network length units
log = logging.getLogger(__name__)


def draw_cloud(shape: Subject, settings: SampleSettings, seed: int) -> Cloud:
    """Draw the training cloud of a shape, corrupted as wanted; the same arguments give the same cloud.

    Raises:
        InputError: A corruption leaves too few points, or the settings need a mesh and the shape is a cloud.
    """
    if corruption := str(settings.corruption):
        log.info("the training cloud is corrupted: %s", corruption)
    if isinstance(shape, Scan) or corruption:
        if isinstance(shape, Scan):
            surface = training_points(shape, settings, seed)
        else:
            surface = settings.corruption.scan_mesh(shape.mesh, settings.cloud_size, seed)
        arrays = (surface.points, surface.normals, surface.labels, shape.part_ids)
        return Cloud.of_points(*arrays, seed=seed, label_fraction=settings.label_fraction)
    return Cloud.of(
        shape.mesh,
        count=settings.cloud_size,
        seed=seed,
        label_fraction=settings.label_fraction,
        region_points=settings.region_points,
        crease_points=settings.crease_points,
        part_points=settings.part_points,
        border_points=settings.border_points,
    )


def labelled_points(shape: Subject, cloud: Cloud, settings: SampleSettings, seed: int) -> LabelledPoints:
    """Draw points from which parts are told apart where the fitted surface will be, a little off the true one.

    A fitted surface runs inside convex edges and outside concave ones, and a last layer that has seen the true surface
    alone may say anything there. So points are moved along their normals, and have the label of the closest face.

    Args:
        shape: Ground truth.
        cloud: From `draw_cloud`, with the same settings and seed.
        settings: Where the mesh is not to be known (`distances=cloud`), points stay on the surface, with their labels.
        seed: Of the run.
    """
    judging = cloud.judging()
    chosen = np.concatenate([np.setdiff1d(np.arange(len(cloud.points)), judging), judging])
    points, labels = cloud.points[chosen], cloud.labels[chosen]
    if settings.distances == "mesh":
        points = points + cloud.normals[chosen] * stream(seed, REFIT).normal(0, OFF_SURFACE, (len(points), 1))
        truth = require_mesh(shape)
        nearest = truth.mesh.labels[network_distance(truth, cloud.normalisation).closest_face(points)]
        known = (labels != UNLABELLED) & (nearest != UNLABELLED)
        labels = np.where(known, np.searchsorted(cloud.part_ids, nearest), UNLABELLED)
    return LabelledPoints(points, labels, len(judging))


def prepare_samples(
    shape: Subject, cloud: Cloud, counts: Counts, settings: SampleSettings, seed: int, far: FarGrid | None = None
) -> Sampler:
    """Build the sampler of every training step.

    Args:
        shape: Ground truth.
        cloud: From `draw_cloud`, with the same settings and seed.
        counts: Points per step.
        settings: Sizes, and where distances come from.
        seed: Of the run.
        far: Filled with what the run knows of the distance. The pool keeps no point where the field is the grid's.

    Raises:
        InputError: A cloud from which no distance can be estimated, or a grid without distances to fill it.
    """
    pool = draw_pool(cloud, count=settings.pool_size, near_share=settings.pool_near, seed=seed)
    distance: Distance
    if settings.distances == "mesh":
        exact = network_distance(require_mesh(shape), cloud.normalisation)
        known, distance = exact.signed(pool), exact.signed
        gradients = np.zeros_like(pool)
        if counts.far:
            anywhere = slice(round(len(pool) * settings.pool_near), None)
            gradients[anywhere] = exact.gradients(pool[anywhere], known[anywhere])
    elif settings.distances == "cloud":
        cloud, pool, known, distance = estimate_from_cloud(cloud, pool, denoised=settings.denoise)
        gradients = np.zeros_like(pool)
    else:
        if far is not None:
            raise InputError("trunk.far=grid: data.distances=none tells no distances to fill it; give trunk.far=none")
        cloud = replace(cloud, normals=np.zeros_like(cloud.normals))
        return Sampler(cloud, pool, np.zeros(0), counts, seed, pool)
    if far is not None:
        far.fill(distance)
        kept = np.abs(known) < far.outer
        pool, known, gradients = pool[kept], known[kept], gradients[kept]
    return Sampler(cloud, pool, known, counts, seed, gradients)
