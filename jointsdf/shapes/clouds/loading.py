"""Loading of a point cloud as the shape of a run: from a file or arrays, with labels, and a truth if there is one."""

import hashlib
import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int, Shaped
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.geometry.distance import ClosestPoint
from jointsdf.shapes.clouds.cloud_file import choose_points, read_cloud
from jointsdf.shapes.clouds.cloud_labels import provide_labels
from jointsdf.shapes.clouds.file_cloud import FileCloud, to_unit_length
from jointsdf.shapes.labels.ids import check_ids
from jointsdf.shapes.loading import require_parts
from jointsdf.shapes.naming import name_of_file
from jointsdf.shapes.units import AUTO, choose_unit
from jointsdf.values import ASSUMED_UNIT, UNLABELLED, Scan, Shape

ASKED = 2000  # points whose distance from the truth is taken
FARTHEST = 0.1  # of the shorter of both longest sides: median distance of the points from the truth in another frame

logger = logging.getLogger(__name__)


def load_cloud_file(
    path: Path, *, labels: str = "auto", truth: Shape | None = None, segmented: bool = True, unit: str = AUTO
) -> Scan:
    """Load a point cloud from its file.

    Args:
        path: The file.
        labels: As of `provide_labels`.
        truth: Mesh of the same part in the same frame, to score by.
        segmented: Whether at least two labelled parts are needed.
        unit: Length unit where the file names none, as for meshes.

    Raises:
        InputError: The file or its labels cannot be used, or the truth is not of this cloud.
    """
    cloud, sha256 = read_cloud(path)
    found, provider = provide_labels(labels, cloud, path)
    kept = choose_points(str(path), cloud)
    scan = scan_of(name_of_file(path, sha256), cloud.take(kept), found[kept], sha256, provider)
    scan = replace(scan, unit=choose_unit(str(path), scan.unit, unit))
    if segmented:
        require_parts(scan)
    return scan if truth is None else with_truth(scan, truth)


def cloud_of_arrays(
    points: Any,
    *,
    normals: Any = None,
    labels: Sequence[int] | Int[ndarray, " n"] | None = None,
    truth: Shape | None = None,
    name: str | None = None,
    unit: str = AUTO,
) -> Scan:
    """Make a point cloud of arrays.

    Args:
        points: Positions, shape (n, 3).
        normals: Normals, shape (n, 3); rows of 0 where unknown.
        labels: One integer per point, -1 where unlabelled.
        truth: Mesh of the same part in the same frame, to score by.
        name: Names the cloud; `cloud-<6 hex digits of its content>` without.
        unit: Of the points.

    Raises:
        InputError: Arrays of another shape, values out of range, or labels that do not fit.
    """
    places = _numbers("points", points, None)
    digest = hashlib.sha256(np.ascontiguousarray(places).tobytes())
    given = None
    if normals is not None:
        given = to_unit_length(_numbers("normals", normals, len(places)))
        digest.update(given.tobytes())
    ids = np.full(len(places), UNLABELLED)
    if labels is not None:
        ids = check_ids("the array of labels", np.asarray(labels).reshape(-1))
        if len(ids) != len(places):
            raise InputError(f"the array of labels has {len(ids)} labels for {len(places)} points: give one for each")
    cloud = FileCloud(places, given)
    called = name or f"cloud-{digest.hexdigest()[:6]}"
    kept = choose_points(called, cloud)
    scan = scan_of(called, cloud.take(kept), ids[kept], digest.hexdigest(), "none" if labels is None else "array")
    scan = replace(scan, unit=choose_unit(called, ASSUMED_UNIT, unit))
    return scan if truth is None else with_truth(scan, truth)


def scan_of(name: str, cloud: FileCloud, labels: Int[ndarray, " n"], sha256: str, provider: str) -> Scan:
    """Make a scan of the points that are kept."""
    normals = np.zeros_like(cloud.points) if cloud.normals is None else cloud.normals
    unit = cloud.unit or ASSUMED_UNIT
    return Scan(name, cloud.points, normals, labels, sha256, provider, colours=cloud.colours, unit=unit, up=cloud.up)


def with_truth(scan: Scan, truth: Shape) -> Scan:
    """The scan with a mesh to score by.

    Raises:
        InputError: The mesh is in another frame.
    """
    asked = scan.points[:: -(-len(scan.points) // ASKED)]
    surface = ClosestPoint(truth.mesh)
    away = float(np.median(surface.query(asked)[0])) / min(surface.size, scan.side)
    if away > FARTHEST:
        raise InputError(
            f"truth={truth.name}: the points of {scan.name} are {away:.2g} of the longest side away from it; give the "
            "mesh in the frame and unit of the points"
        )
    if len(scan.part_ids) and len(truth.part_ids) and not np.intersect1d(scan.part_ids, truth.part_ids).size:
        logger.warning("truth=%s: none of its part ids is one of %s; truth_labels= takes others", truth.name, scan.name)
    return replace(scan, truth=truth)


def _numbers(name: str, given: Any, rows: int | None) -> Float[ndarray, "n 3"]:
    try:
        array: Shaped[ndarray, ...] = np.asarray(given)
    except ValueError as error:
        raise InputError(f"{name}: rows of different lengths; give an array") from error
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "fiu" or rows not in (None, len(array)):
        wanted = f"({'n' if rows is None else rows}, 3)"
        raise InputError(f"{name} of shape {array.shape} and type {array.dtype}: give numbers in shape {wanted}")
    return np.ascontiguousarray(array, dtype=np.float64)
