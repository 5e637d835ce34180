"""Point clouds of surveys, LAS and LAZ, by the library laspy (extra `las`)."""

import io
from pathlib import Path

import numpy as np

from jointsdf.errors import InputError, first_line
from jointsdf.shapes.clouds.file_cloud import FileCloud, cloud_of_columns

NO_COLUMNS = {"X", "Y", "Z"}  # the integers that coordinates are stored as


def read_las(path: Path, data: bytes) -> FileCloud:
    """Read a LAS or LAZ file; its dimensions are the columns, e.g. `classification`.

    Args:
        path: Names the file in messages.
        data: The file's content.

    Raises:
        InputError: The library is not installed, or the file cannot be read.
    """
    try:
        import laspy
    except ImportError as error:
        raise InputError(f"{path}: LAS needs a library: pip install 'jointsdf[las]', or export it as PLY") from error
    try:
        found = laspy.read(io.BytesIO(data))
        columns = {
            name: np.asarray(found[name]) for name in found.point_format.dimension_names if name not in NO_COLUMNS
        }
        columns |= {axis: np.asarray(getattr(found, axis), dtype=np.float64) for axis in "xyz"}
    except Exception as error:  # of the library, of its decoders or of struct
        raise InputError(f"{path} cannot be read as las (truncated or damaged?): {first_line(error)}") from error
    return cloud_of_columns(str(path), {name: values for name, values in columns.items() if values.ndim == 1})
