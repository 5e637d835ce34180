"""Reader of OBJ files."""

from itertools import pairwise
from pathlib import Path

import numpy as np

from jointsdf.errors import InputError
from jointsdf.shapes.readers.file_mesh import FileMesh


def read_obj(path: Path, data: bytes) -> FileMesh:
    """Read an OBJ file. Differs from trimesh, which reorders faces by material and format.

    Args:
        path: Names the file in messages.
        data: The file's content.

    Raises:
        InputError: A line cannot be read.
    """
    vertices: list[list[float]] = []
    faces: list[list[int]] = []
    polygons: list[int] = []
    count = 0
    try:
        for line in data.decode("utf-8", errors="replace").splitlines():
            key, *words = line.split() or [""]
            if key == "v":
                x, y, z = (float(word) for word in words[:3])
                vertices.append([x, y, z])
            elif key == "f":
                written = [int(word.split("/")[0]) for word in words]
                corners = [i - 1 if i > 0 else len(vertices) + i if i < 0 else -1 for i in written]
                if len(corners) < 3:
                    raise ValueError(f"a face of {len(corners)} vertices")
                faces.extend([corners[0], b, c] for b, c in pairwise(corners[1:]))
                polygons += [count] * (len(corners) - 2)
                count += 1
    except ValueError as error:
        raise InputError(f"{path} cannot be read as obj (truncated or damaged?): export it again") from error
    cut = np.array(polygons) if count < len(faces) else None
    return FileMesh(np.array(vertices).reshape(-1, 3), np.array(faces, dtype=np.int64).reshape(-1, 3), polygons=cut)
