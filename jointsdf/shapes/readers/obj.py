"""Reader of OBJ files."""

from pathlib import Path

import numpy as np

from jointsdf.errors import InputError
from jointsdf.shapes.readers.face_columns import polygon_mesh
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
    corners: list[int] = []
    sizes: list[int] = []
    try:
        for line in data.decode("utf-8", errors="replace").splitlines():
            key, *words = line.split() or [""]
            if key == "v":
                x, y, z = (float(word) for word in words[:3])
                vertices.append([x, y, z])
            elif key == "f":
                written = [int(word.split("/")[0]) for word in words]
                if len(written) < 3:
                    raise ValueError(f"a face of {len(written)} vertices")
                corners += [i - 1 if i > 0 else len(vertices) + i if i < 0 else -1 for i in written]
                sizes.append(len(written))
    except ValueError as error:
        raise InputError(f"{path} cannot be read as obj (truncated or damaged?): export it again") from error
    positions = np.array(vertices).reshape(-1, 3)
    return polygon_mesh(str(path), positions, np.array(corners, dtype=np.int64), np.array(sizes, dtype=np.int64), {})
