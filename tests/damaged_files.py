"""Files with a flipped bit, read one by one."""

from collections.abc import Callable

import numpy as np

from jointsdf.errors import InputError
from jointsdf.shapes.readers.file_mesh import FileMesh


def read_flipped(read: Callable[[bytes], FileMesh], data: bytes, most: int) -> tuple[list[FileMesh], list[str]]:
    """Read the file with each of some bits flipped: the meshes, and the messages of those that are refused."""
    meshes, lines = [], []
    for bit in np.random.default_rng(0).permutation(8 * len(data))[:most].tolist():
        damaged = bytearray(data)
        damaged[bit // 8] ^= 1 << bit % 8
        try:
            meshes.append(read(bytes(damaged)))
        except InputError as error:
            lines.append(str(error))
    assert not any("\n" in line for line in lines)
    return meshes, lines
