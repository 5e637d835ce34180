"""Loading of the ground truth that a config or a run folder names."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jointsdf import shapes
from jointsdf.errors import InputError
from jointsdf.runs.folder import read_config
from jointsdf.shapes.units import AUTO
from jointsdf.values import Shape


def load_configured(settings: Mapping[str, Any]) -> Shape:
    """Load the shape of a resolved config, with its labels.

    Args:
        settings: With the keys `shape`, `labels`, `num_parts`, `partfield_dir`, `paths`, `head` and `tessellation`, and
            `unit`, which older configs lack.

    Raises:
        InputError: The shape or its labels cannot be used.
    """
    return shapes.load(
        str(settings["shape"]),
        labels=str(settings["labels"]),
        num_parts=settings.get("num_parts"),
        partfield_dir=settings.get("partfield_dir"),
        abc_root=settings["paths"]["abc_root"],
        abc_missing=settings["paths"]["abc_missing"],
        segmented=settings["head"]["name"] != "none",
        step_tolerance=settings["tessellation"]["tolerance"],
        step_angle=settings["tessellation"]["angle"],
        unit=str(settings.get("unit", AUTO)),
    )


def shape_identity(shape: Shape) -> dict[str, str]:
    """Name and content of a ground truth."""
    return {"name": shape.name, "mesh_sha256": shape.mesh_sha256, "labels_sha256": shape.labels_sha256}


def stored_truth(folder: Path) -> tuple[dict[str, Any], Shape]:
    """Load the config of a run folder, and the run's ground truth.

    Raises:
        InputError: There is no config, or the ground truth has changed. One line.
    """
    settings = read_config(folder)
    try:
        shape = load_configured(settings)
    except (KeyError, TypeError) as error:
        raise InputError(f"{folder}: its config is damaged; force=true starts the run over") from error
    if (now := shape_identity(shape)) != (before := settings["identity"]["shape"]):
        changed = ", ".join(f"{key} ({before.get(key)} -> {now[key]})" for key in now if before.get(key) != now[key])
        where = settings["shape"]
        raise InputError(f"{folder}: its ground truth is not there any more: {changed}; put it back at {where}")
    return settings, shape
