"""What an exported file says of itself: frame, unit, parts, and the run that it comes from."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jointsdf.errors import InputError
from jointsdf.model.field import JointField
from jointsdf.runs.folder import FIELD
from jointsdf.runs.row import ROW_FILE, ResultRow, read_row
from jointsdf.values import BOX

FORMAT = "jointsdf field 1"
ORIGIN = {"shape": str, "head": str, "recipe": str, "unit": str, "unit_known": bool}  # of the run, where it is known
LONGEST = 1000  # characters of a name


def load_source(path: Path) -> JointField:
    """Load a run's field, and note in `about` what its row says; nothing of the folder is run.

    Args:
        path: A run folder, or a field's file. The row beside it is read if there is one.

    Raises:
        InputError: There is no field, or the field or the row cannot be read.
    """
    file = path / FIELD if path.is_dir() else path
    field = JointField.load(file)
    if (file.parent / ROW_FILE).is_file():
        field.about = origin_of(read_row(file.parent / ROW_FILE))
    return field


def origin_of(row: ResultRow) -> dict[str, Any]:
    """What a row says of a field: shape, head, recipe, and the file frame's unit."""
    facts = {name: row.provenance.get(name) for name in ("unit", "unit_known")}
    return {"shape": row.shape, "head": row.head, "recipe": row.recipe} | facts


def describe(field: JointField) -> dict[str, Any]:
    """Entries of an exported file: how points are mapped, and what the answers are.

    Raises:
        InputError: The frame is not finite.
    """
    scale, centre = float(field.scale), field.centre.tolist()
    if not all(map(math.isfinite, (scale, *centre))) or scale <= 0:
        raise InputError(f"the field's frame is damaged: centre {centre}, scale {scale}; run the fit again")
    ids = field.part_ids.tolist()
    return {
        "format": FORMAT,
        "points": "file frame, in the unit below; (x - centre) / scale is the network frame",
        "sdf": "signed distance in that unit, negative inside; outside the box a lower bound of the distance",
        "centre": centre,
        "scale": scale,
        "box": BOX,
        "part_ids": ids,
        "part_names": [f"part_{part}" for part in ids],  # as the nodes of mesh.glb
        **_origin(field.about),
    }


def _origin(about: Mapping[str, Any]) -> dict[str, Any]:
    """The known entries of what a file says of its run, each of its type and length; None for the others."""
    found = {}
    for name, kind in ORIGIN.items():
        value = about.get(name)
        found[name] = value if isinstance(value, kind) and len(str(value)) <= LONGEST else None
    return found


def as_text(entries: Any) -> str:
    """The entries as JSON (RFC 8259), in ASCII whatever names hold."""
    return json.dumps(entries, allow_nan=False)
