"""Arrays of a page: gzip in base64 within JSON, which `assets/data.js` unpacks."""

import base64
import gzip
from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float, UInt16
from numpy import ndarray

TYPES = {"uint8": "u1", "uint16": "u2", "uint32": "u4", "int16": "i2"}
ALIGNED = 4  # bytes, of the place of each array: browsers view them in place
STEPS = 65535  # of a box, along each axis


def pack(arrays: Mapping[str, ndarray]) -> dict[str, Any]:
    """Pack arrays, of the types of `TYPES`.

    Returns:
        `gzip`, in base64, and `arrays`: name, type, first byte and length of each.
    """
    content, places = b"", []
    for name, array in arrays.items():
        flat = np.ascontiguousarray(array).reshape(-1)
        places.append([name, TYPES[flat.dtype.name], len(content), len(flat)])
        data = flat.astype(flat.dtype.newbyteorder("<")).tobytes()
        content += data + b"\0" * (-len(data) % ALIGNED)
    return {"gzip": base64.b64encode(gzip.compress(content, 6, mtime=0)).decode(), "arrays": places}


def unpack(packed: Mapping[str, Any]) -> dict[str, ndarray]:
    """The arrays of `pack`, flat."""
    content = gzip.decompress(base64.b64decode(packed["gzip"]))
    return {
        name: np.frombuffer(content, f"<{kind}", length, start).astype(kind)
        for name, kind, start, length in packed["arrays"]
    }


def quantise(points: Float[ndarray, "n 3"]) -> tuple[UInt16[ndarray, "n 3"], dict[str, list[float]]]:
    """Points as steps of their bounding box, each within half a step: 1/131070 of the box's side along the axis.

    Returns:
        The steps; and the box, `low` and `step` along each axis, in the unit of the points.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    step = (high - low) / STEPS
    steps = np.rint((points - low) / np.where(step > 0, step, 1.0)).astype(np.uint16)
    return steps, {"low": low.tolist(), "step": step.tolist()}


def smallest(values: ndarray) -> ndarray:
    """Indices as 16-bit integers where they fit, else 32-bit ones."""
    return values.astype(np.uint16 if values.max(initial=0) <= STEPS else np.uint32)
