"""Triangle meshes as binary PLY files (G. Turk, 1994), with a column per face.

numpy writes them: plyfile writes faces one by one, 11 s for the 300,000 of a fine grid, and trimesh writes vertices in
single precision only. trimesh reads them.
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

TYPES = {"f4": "float", "f8": "double", "u1": "uchar", "i4": "int"}


def binary_ply(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], columns: Mapping[str, ndarray], *comments: str
) -> bytes:
    """The content of a little-endian PLY file.

    Args:
        vertices: Positions, stored in their own precision.
        faces: Vertex indices below 2^31.
        columns: Further properties of each face, uint8 or int32, by name.
        *comments: Lines of the header.

    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    >>> binary_ply(corners, np.array([[0, 1, 2]]), {}, "a triangle").splitlines()[2:5]
    [b'comment a triangle', b'element vertex 3', b'property double x']
    """
    kinds = {name: column.dtype.str.lstrip("<|") for name, column in columns.items()}
    rows = [("count", "u1"), ("vertices", "<i4", 3), *((name, f"<{kind}") for name, kind in kinds.items())]
    table = np.zeros(len(faces), dtype=rows)
    table["count"], table["vertices"] = 3, faces
    for name, column in columns.items():
        table[name] = column
    precision = vertices.dtype.str.lstrip("<")
    header = [
        "ply",
        "format binary_little_endian 1.0",
        *(f"comment {comment}" for comment in comments),
        f"element vertex {len(vertices)}",
        *(f"property {TYPES[precision]} {axis}" for axis in "xyz"),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        *(f"property {TYPES[kind]} {name}" for name, kind in kinds.items()),
        "end_header\n",
    ]
    return "\n".join(header).encode() + np.ascontiguousarray(vertices).tobytes() + table.tobytes()
