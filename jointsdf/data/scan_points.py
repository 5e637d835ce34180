"""Points of a cloud that a run trains on."""

import logging

import numpy as np

from jointsdf.data.held_out import mark_held_out
from jointsdf.data.sample_settings import OF_THE_MESH, SampleSettings
from jointsdf.data.streams import THIN, stream
from jointsdf.data.surface_points import SurfacePoints
from jointsdf.errors import InputError
from jointsdf.values import Scan, Shape, Subject

log = logging.getLogger(__name__)


def require_mesh(shape: Subject) -> Shape:
    """The shape, if it is a mesh.

    Raises:
        InputError: It is a point cloud, which tells no exact distances.
    """
    if isinstance(shape, Scan):
        raise InputError(
            f"data.distances=mesh: {shape.name} is a point cloud, which tells no exact distances; give recipe=points"
        )
    return shape


def training_points(scan: Scan, settings: SampleSettings, seed: int) -> SurfacePoints:
    """Points of a scan that a run trains on: not the held-out ones; corrupted; thinned at random to `cloud_size`.

    Raises:
        InputError: The settings need a mesh.
    """
    if settings.distances == "mesh":
        require_mesh(scan)
    for name in OF_THE_MESH:
        if number := getattr(settings, name):
            raise InputError(f"data.{name}={number}: they are drawn from a mesh, and {scan.name} is a cloud; give 0")
    surface = SurfacePoints(scan.points, scan.normals, scan.labels)
    if scan.truth is None:
        surface = surface.take(~mark_held_out(scan.points))
    surface = settings.corruption.corrupt(surface, seed)
    if (count := len(surface)) > settings.cloud_size:
        surface = surface.take(np.sort(stream(seed, THIN).permutation(count)[: settings.cloud_size]))
        log.info(
            "%s: %d points are thinned to %d at random; data.cloud_size=%d trains on more",
            *(scan.name, count, settings.cloud_size, count),
        )
    return surface
