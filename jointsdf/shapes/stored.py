"""Loading of the ground truth that a config or a run folder names."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from jointsdf import shapes
from jointsdf.errors import InputError, shown
from jointsdf.runs.folder import read_config
from jointsdf.shapes.clouds.cloud_file import is_cloud_file
from jointsdf.shapes.clouds.loading import load_cloud_file
from jointsdf.shapes.labels.providers import OWN
from jointsdf.shapes.units import AUTO
from jointsdf.user_paths import expand_home
from jointsdf.values import Shape, Subject


def load_configured(settings: Mapping[str, Any]) -> Subject:
    """Load the shape of a resolved config, a mesh or a point cloud, with its labels.

    Args:
        settings: With the keys `shape`, `labels`, `num_parts`, `partfield_dir`, `paths`, `head` and `tessellation`, and
            `unit`, `truth` and `truth_labels`, which older configs lack.

    Raises:
        InputError: The shape, its labels or its truth cannot be used.
    """
    path, truth = Path(expand_home(str(settings["shape"]))), settings.get("truth")
    segmented = settings["head"]["name"] != "none"
    if is_cloud_file(path):
        if settings.get("num_parts") is not None:
            raise InputError(f"num_parts={settings['num_parts']}: {path} is a point cloud, which is not cut into parts")
        return load_cloud_file(
            path,
            labels=str(settings["labels"]),
            truth=None if truth is None else _load_mesh(settings, str(truth), _truth_labels(settings), segmented=False),
            segmented=segmented,
            unit=str(settings.get("unit", AUTO)),
        )
    if truth is not None:
        raise InputError(f"truth={truth}: it scores a point cloud, and shape={settings['shape']} is none; leave it out")
    return _load_mesh(settings, str(settings["shape"]), str(settings["labels"]), segmented=segmented)


def _load_mesh(settings: Mapping[str, Any], shape: str, labels: str, *, segmented: bool) -> Shape:
    return shapes.load(
        shape,
        labels=labels,
        num_parts=settings.get("num_parts"),
        partfield_dir=settings.get("partfield_dir"),
        abc_root=settings["paths"]["abc_root"],
        abc_missing=settings["paths"]["abc_missing"],
        segmented=segmented,
        step_tolerance=settings["tessellation"]["tolerance"],
        step_angle=settings["tessellation"]["angle"],
        unit=str(settings.get("unit", AUTO)),
    )


def _truth_labels(settings: Mapping[str, Any]) -> str:
    """Labels of the truth: as given, or none where the points have none to compare."""
    return "none" if str(settings["labels"]) == "none" else str(settings.get("truth_labels", OWN))


def shape_identity(shape: Subject) -> dict[str, str]:
    """Name and content of what is fitted, and of the truth of a point cloud."""
    if isinstance(shape, Shape):
        return {"name": shape.name, "mesh_sha256": shape.mesh_sha256, "labels_sha256": shape.labels_sha256}
    found = {"name": shape.name, "points_sha256": shape.points_sha256, "labels_sha256": shape.labels_sha256}
    truth = {} if shape.truth is None else shape_identity(shape.truth)
    return found | {f"truth_{key}": truth[key] for key in ("mesh_sha256", "labels_sha256") if truth}


def stored_mesh_truth(folder: Path, trust: Collection[str] = ()) -> tuple[dict[str, Any], Shape]:
    """As `stored_truth`, for what compares a fit with a mesh.

    Raises:
        InputError: As of `stored_truth`; or the run is of a point cloud without a truth.
    """
    settings, shape = stored_truth(folder, trust)
    if shape.truth is None:
        raise InputError(
            f"{folder}: {shape.name} is a point cloud without a mesh to compare with; fit it with truth=<mesh>"
        )
    return settings, shape.truth


def stored_truth(folder: Path, trust: Collection[str] = ()) -> tuple[dict[str, Any], Subject]:
    """Load the config of a run folder, and what the run was fitted to.

    Args:
        folder: The run folder.
        trust: As for `read_config`.

    Raises:
        InputError: There is no config, it names a class that is not trusted, or the ground truth has changed. One line.
    """
    settings = read_config(folder, trust)
    try:
        shape = load_configured(settings)
    except InputError:
        raise
    except (LookupError, TypeError, AttributeError, ValueError, ArithmeticError) as error:
        raise InputError(f"{folder}: its config is damaged; force=true starts the run over") from error
    if (now := shape_identity(shape)) != (before := settings["identity"]["shape"]):
        changed = ", ".join(
            f"{key} ({shown(before.get(key))} -> {now[key]})" for key in now if before.get(key) != now[key]
        )
        where = settings["shape"]
        raise InputError(f"{folder}: its ground truth is not there any more: {changed}; put it back at {where}")
    return settings, shape
