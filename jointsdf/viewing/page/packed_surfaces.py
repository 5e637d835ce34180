"""Surfaces with their errors and fields as a page's scripts read them."""

from typing import Any

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from jointsdf.values import Scan
from jointsdf.viewing.page.display import Display
from jointsdf.viewing.page.errors import Errors
from jointsdf.viewing.page.field_grid import FieldGrid
from jointsdf.viewing.page.packing import pack, quantise, smallest
from jointsdf.viewing.palette import part_colours

ERROR_LEVELS = 32767  # of a 16-bit integer, on either side of 0
HUNDREDTHS = 100.0  # of a degree, as normals are stored


def empty_fit(name: str) -> dict[str, Any]:
    """A fit without a surface."""
    none = np.zeros(0, dtype=np.uint16)
    box = {"low": [0.0] * 3, "step": [0.0] * 3}
    arrays = pack({"vertices": none, "faces": none, "parts": none, "lines": none, "line_parts": none})
    return {"role": "fit", "name": name, "kind": "mesh", "box": box, "arrays": arrays, "faces": 0, "full_faces": 0}


def pack_fit(
    name: str, mine: Display, errors: Errors, missed: Errors, parts: Int[ndarray, " k"], grid: FieldGrid
) -> dict[str, Any]:
    """A fit with its errors, those of the ground truth towards it, and its field."""
    found = [values for values in (errors.error, missed.error) if values is not None]
    largest = float(max((np.abs(values).max(initial=0.0) for values in found), default=0.0))
    step = largest / ERROR_LEVELS or 1.0
    arrays = {**_pack_errors("", errors, step), **_pack_errors("missed_", missed, step)}
    packed = pack_mesh(mine, parts, arrays)
    return {
        "role": "fit",
        "name": name,
        **packed,
        "largest": largest,
        "error_step": step,
        "field": pack_grid(grid),
    }


def _pack_errors(prefix: str, errors: Errors, step: float) -> dict[str, ndarray]:
    arrays: dict[str, ndarray] = {}
    if errors.error is not None:
        arrays["missed" if prefix else "error"] = np.rint(errors.error / step).astype(np.int16)
    if errors.normal is not None:
        arrays[f"{prefix}normal"] = np.rint(errors.normal * HUNDREDTHS).astype(np.uint16)
    if errors.wrong is not None:
        arrays[f"{prefix}wrong"] = errors.wrong.astype(np.uint8)
    return arrays


def pack_mesh(shown: Display, parts: Int[ndarray, " k"], more: dict[str, ndarray]) -> dict[str, Any]:
    """A surface as it is shown, with further arrays of its vertices and faces."""
    steps, box = quantise(shown.mesh.vertices)
    part = np.searchsorted(parts, shown.mesh.labels)
    arrays = {"vertices": steps, "faces": smallest(shown.mesh.faces), "parts": smallest(part), **more}
    arrays |= {"lines": smallest(shown.lines), "line_parts": smallest(np.searchsorted(parts, shown.line_parts))}
    size = {
        "faces": len(shown.mesh.faces),
        "full_faces": shown.full_faces,
        "moved": shown.moved,
        "longest": shown.longest,
    }
    return {"kind": "mesh", "box": box, "arrays": pack(arrays), **size}


def pack_points(scan: Scan, chosen: Int[ndarray, " n"], parts: Int[ndarray, " k"]) -> dict[str, Any]:
    """Some points of a cloud, in their own colours where they have no parts."""
    steps, box = quantise(scan.points[chosen].astype(np.float64))
    arrays = {"vertices": steps, "parts": smallest(np.searchsorted(parts, scan.labels[chosen]))}
    if scan.colours is not None and not len(scan.part_ids):
        arrays["own"] = scan.colours[chosen]
    size = {"faces": len(chosen), "full_faces": len(scan.points), "moved": 0.0}
    return {"role": "truth", "name": "points", "kind": "points", "box": box, "arrays": pack(arrays), **size}


def pack_grid(grid: FieldGrid) -> dict[str, Any]:
    """The grid of a field."""
    return {
        "low": grid.low.tolist(),
        "high": grid.high.tolist(),
        "count": len(grid.values),
        "largest": grid.largest,
        "near_p99": grid.near_p99,
        "arrays": pack({"values": grid.values}),
    }


def colours_of(parts: Int[ndarray, " k"]) -> list[str]:
    """Colour of each part as a CSS colour."""
    return [f"#{bytes(colour.tolist()).hex()}" for colour in part_colours(parts)]
