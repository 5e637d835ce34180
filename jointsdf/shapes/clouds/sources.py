"""The library's function that loads a point cloud: `jointsdf.load_cloud`."""

import os
from pathlib import Path
from typing import Any

from jointsdf import shapes
from jointsdf.errors import InputError
from jointsdf.shapes.clouds.cloud_file import READERS, is_cloud_file
from jointsdf.shapes.clouds.loading import cloud_of_arrays, load_cloud_file
from jointsdf.shapes.labels.providers import OWN
from jointsdf.shapes.units import AUTO
from jointsdf.user_paths import expand_home
from jointsdf.values import Scan, Shape


def load_cloud(
    source: str | Path | None = None,
    *,
    points: Any = None,
    normals: Any = None,
    labels: Any = None,
    truth: Shape | str | Path | None = None,
    truth_labels: str = OWN,
    name: str | None = None,
    unit: str = AUTO,
) -> Scan:
    """Load a point cloud as a shape to fit with `recipe="points"`, in its own units.

    Args:
        source: The path of a ply, xyz, xyzn, xyzc, pts, asc, csv, txt, npy, npz, pcd, las or laz file, also with
            `.gz`.
        points: Positions, shape (n, 3), instead of `source`.
        normals: With `points`: normals, shape (n, 3); rows of 0 where unknown.
        labels: Of a file: a column's name, a label file, `auto` (the usual columns; the default) or `none`; with
            `points` one integer per point, -1 where unlabelled.
        truth: A mesh of the same part in the same frame, to score by; without it a tenth of the points is held out.
        truth_labels: Labels of that mesh, where it is a path.
        name: Name of a cloud of arrays.
        unit: Length unit where the file names none: mm, cm, m, um, in or ft; `auto`: mm is assumed.

    Raises:
        InputError: The cloud, its labels or the truth cannot be used; one line with the value and the fix.

    >>> import numpy as np
    >>> directions = np.random.default_rng(0).normal(size=(500, 3))
    >>> ball = load_cloud(points=directions / np.linalg.norm(directions, axis=1, keepdims=True), name="ball")
    >>> ball.name, len(ball.points), ball.part_ids.tolist()
    ('ball', 500, [])
    """
    if (source is None) == (points is None):
        raise InputError("load_cloud: give a path, or else points=")
    if isinstance(truth, str | Path):
        root = os.environ.get("JOINTSDF_ABC", "data/abc")
        options: dict[str, Any] = {"labels": truth_labels, "abc_root": root, "abc_missing": "error"}
        truth = shapes.load(str(truth), segmented=False, **options)
    if source is None:
        return cloud_of_arrays(points, normals=normals, labels=labels, truth=truth, name=name, unit=unit)
    path, wanted = Path(expand_home(str(source))), "auto" if labels is None else labels
    if not is_cloud_file(path):
        what = f"no file of points ({', '.join(READERS)})" if path.is_file() else "no such file"
        raise InputError(f"{path}: {what}; meshes are loaded by load_shape")
    if not isinstance(wanted, str | Path) or normals is not None:
        raise InputError("load_cloud: arrays of labels and normals go with points=")
    return load_cloud_file(path, labels=str(wanted), truth=truth, segmented=False, unit=unit)
