"""Accessors of a glTF file as arrays: strided, normalised and sparse, each checked against its buffer.

Format: Khronos, "glTF 2.0 Specification", section 3.6; KHR_mesh_quantization.
"""

from collections.abc import Collection

import numpy as np
from jaxtyping import Int, Shaped
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.shapes.readers.gltf_container import Container
from jointsdf.shapes.readers.gltf_json import Json, integer, nested, pick

COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
COMPRESSIONS = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")


def read_accessor(file: Container, index: object, types: Collection[str]) -> Shaped[ndarray, "n w"]:
    """Read an accessor: integers as they are, or in 0..1 (-1..1) as float64 where they are normalised.

    Args:
        file: The file.
        index: Of the accessor.
        types: Accepted types, e.g. `VEC3`.

    Raises:
        ValueError: It does not fit its buffer, or is of another type.
    """
    accessor = pick(file.document, "accessors", index)
    count, width = integer(accessor, "count"), WIDTHS.get(str(accessor.get("type")), 0)
    dtype = _component(accessor)
    if accessor.get("type") not in types:
        raise ValueError(f"accessor {index} is {str(accessor.get('type'))[:20]}, not {' or '.join(types)}")
    if "bufferView" in accessor:
        values = _view(file, accessor, count, width, dtype)
    elif "sparse" in accessor and count <= sum(map(len, file.buffers)):
        values = np.zeros((count, width), dtype=dtype)
    else:
        raise ValueError(f"accessor {index} has no data for its {count} elements")
    if "sparse" in accessor:
        values = _substitute(file, nested(accessor, "sparse"), values)
    if accessor.get("normalized") is True and dtype.kind in "iu":
        return np.maximum(values / np.float64(np.iinfo(dtype).max), -1.0)
    return values


def read_indices(file: Container, index: object, count: int) -> Int[ndarray, " n"]:
    """Read an accessor of vertex indices, all below `count`.

    Raises:
        ValueError: As of `read_accessor`, or an index is out of range.
    """
    values = read_accessor(file, index, ("SCALAR",))[:, 0]
    return _check_range(values, count, f"accessor {index}")


def _view(file: Container, accessor: Json, count: int, width: int, dtype: np.dtype) -> Shaped[ndarray, "n w"]:
    """Array over the bytes of a buffer view."""
    view = pick(file.document, "bufferViews", accessor.get("bufferView"))
    pick(file.document, "buffers", view.get("buffer"))
    buffer = file.buffers[integer(view, "buffer")]
    if not buffer:
        raise ValueError(f"bufferViews[{accessor.get('bufferView')}] has no data")
    begin, length = integer(view, "byteOffset", 0), integer(view, "byteLength", least=1)
    offset, size = integer(accessor, "byteOffset", 0), width * dtype.itemsize
    stride = integer(view, "byteStride", size, least=size)
    needed = offset + stride * (count - 1) + size if count else 0
    if begin + length > len(buffer) or needed > length:
        raise ValueError(f"{count} elements need {needed} bytes, their buffer view has {length} of {len(buffer)}")
    if not count:
        return np.zeros((0, width), dtype=dtype)
    return np.ndarray((count, width), dtype, buffer, begin + offset, (stride, dtype.itemsize))


def _substitute(file: Container, sparse: Json, values: Shaped[ndarray, "n w"]) -> Shaped[ndarray, "n w"]:
    """Replace the elements that a sparse accessor lists."""
    count = integer(sparse, "count", least=1)
    at = _view(file, nested(sparse, "indices"), count, 1, _component(nested(sparse, "indices")))[:, 0]
    replaced = values.copy()
    new = _view(file, nested(sparse, "values"), count, values.shape[1], values.dtype)
    replaced[_check_range(at, len(values), "a sparse accessor")] = new
    return replaced


def _check_range(values: Shaped[ndarray, " n"], count: int, source: str) -> Int[ndarray, " n"]:
    """Check indices, of any type of integer."""
    if values.dtype.kind not in "iu":
        raise ValueError(f"the indices of {source} are no integers")
    if len(values) and (values.min() < 0 or values.max() >= count):
        raise ValueError(f"an index of {source} is out of range 0..{count - 1}")
    return values.astype(np.int64)


def _component(accessor: Json) -> np.dtype:
    """Type of an accessor's numbers."""
    kind = integer(accessor, "componentType")
    if kind not in COMPONENTS:
        raise ValueError(f"componentType {kind} is unknown")
    return np.dtype(COMPONENTS[kind])


def refuse_compression(source: str, file: Container, accessor: object) -> None:
    """Refuse an accessor whose data are in an extension's compressed form alone.

    Args:
        source: Names the file in messages.
        file: The file.
        accessor: Index of the accessor.

    Raises:
        InputError: The message names the extension.
        ValueError: There is no such accessor.
    """
    found = pick(file.document, "accessors", accessor)
    used = file.document.get("extensionsUsed")
    name = next((each for each in COMPRESSIONS if isinstance(used, list) and each in used), None)
    if name is None or "sparse" in found:
        return
    view = pick(file.document, "bufferViews", found["bufferView"]) if "bufferView" in found else {}
    if not view or not file.buffers[integer(view, "buffer")]:
        raise refusal(source, name)


def refusal(source: str, extension: str) -> InputError:
    """An extension of the format that is not read."""
    what = "compression" if extension in COMPRESSIONS else "it"
    return InputError(
        f"{source} needs the glTF extension {extension[:60]}, which is not read: export it without {what}"
    )
