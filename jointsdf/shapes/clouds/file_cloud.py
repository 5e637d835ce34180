"""Points of one file with what the file says of them: normals, colours, columns, unit."""

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float, Shaped, UInt8
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.shapes.readers.file_mesh import LARGEST
from jointsdf.values import Unit

LEAST = 200  # points from which a surface can be told, and some of which can be held out
FLAT = 1e-4  # extent across a plane or line, of the longest one, below which points lie in it
AXES = ("x", "y", "z")
NORMALS = (("nx", "ny", "nz"), ("normal_x", "normal_y", "normal_z"), ("normalx", "normaly", "normalz"))
COLOURS = (("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green", "diffuse_blue"))
UNIT_LENGTH = 0.02  # by which the lengths of unit normals are off one, rounded as they are

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class FileCloud:
    """Points of one file, in its frame and order.

    Attributes:
        points: Positions.
        normals: Unit normals, 0 where there is none; None where the file has none at all.
        colours: sRGB; None where the file has none.
        columns: Further numbers of the points, by name in small letters.
        unit: Length unit that the file declares; None where it declares none.
        up: Axis that points up.
    """

    points: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"] | None = None
    colours: UInt8[ndarray, "n 3"] | None = None
    columns: Mapping[str, Shaped[ndarray, " n"]] = field(default_factory=dict)
    unit: Unit | None = None
    up: str = "z"

    def take(self, chosen: Shaped[ndarray, " m"]) -> "FileCloud":
        """The chosen points, by indices or marks."""
        normals = None if self.normals is None else self.normals[chosen]
        colours = None if self.colours is None else self.colours[chosen]
        columns = {name: values[chosen] for name, values in self.columns.items()}
        return replace(self, points=self.points[chosen], normals=normals, colours=colours, columns=columns)


def cloud_of_columns(source: str, columns: Mapping[str, Shaped[ndarray, " n"]]) -> FileCloud:
    """Make a cloud of named columns: x, y, z; normals and colours by their usual names; the others as they are.

    Args:
        source: Names the file in messages.
        columns: Names in any case.

    Raises:
        InputError: x, y or z is missing, or two columns have one name.
    """
    left = {name.strip().lower(): values for name, values in columns.items()}
    if len(left) < len(columns):
        raise InputError(f"{source} has two columns of one name ({', '.join(columns)}): rename one")
    if not set(AXES) <= left.keys():
        raise InputError(f"{source} has no columns x, y and z, but {', '.join(left) or 'none'}: rename or add them")
    points = np.stack([left.pop(axis).astype(np.float64) for axis in AXES], axis=1)
    normals, colours = _pop(left, NORMALS), _pop(left, COLOURS)
    return FileCloud(
        points,
        None if normals is None else to_unit_length(normals.astype(np.float64)),
        None if colours is None else to_bytes(colours),
        left,
    )


def _pop(
    left: dict[str, Shaped[ndarray, " n"]], triples: tuple[tuple[str, str, str], ...]
) -> Shaped[ndarray, "n 3"] | None:
    """Take the first triple of columns that is there."""
    for names in triples:
        if set(names) <= left.keys():
            return np.stack([left.pop(name) for name in names], axis=1)
    return None


def to_unit_length(normals: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    """Scale normals to unit length; those without direction, or not finite, become 0."""
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    known = np.isfinite(lengths) & (lengths > 0)
    return np.divide(normals, lengths, out=np.zeros_like(normals), where=known)


def to_bytes(colours: Shaped[ndarray, "n 3"]) -> UInt8[ndarray, "n 3"]:
    """Colours of 8 bits from those of 8 bits, of 16 bits (LAS), or from 0 to 1."""
    if colours.dtype == np.uint8:
        return colours
    values = np.nan_to_num(colours.astype(np.float64))
    largest = values.max(initial=0)
    scale = 255.0 if largest <= 1 and colours.dtype.kind == "f" else 255 / 65535 if largest > 255 else 1.0
    return np.clip(np.rint(values * scale), 0, 255).astype(np.uint8)


def check_cloud(source: str, points: Float[ndarray, "n 3"]) -> None:
    """Refuse a cloud of few points, of coordinates that are not finite or absurd, or without extent in all directions.

    Args:
        source: Names the cloud in messages.
        points: Positions.

    Raises:
        InputError: It is one of these.
    """
    if len(points) < LEAST:
        raise InputError(f"{source} has {len(points)} points: at least {LEAST} are needed; scan it more densely")
    if bad := int((~np.isfinite(points).all(axis=1)).sum()):
        raise InputError(f"{source} has NaN or infinite coordinates in {bad} points: leave them out")
    if (largest := np.abs(points).max()) > LARGEST:
        raise InputError(f"{source} has a coordinate of {largest:.3g}, beyond {LARGEST:g}: repair or export it again")
    centred = points - points.mean(axis=0)
    size = np.abs(centred).max()
    if size <= np.spacing(largest):
        raise InputError(f"{source}: all of its {len(points)} points are one place; export it again")
    extents = np.sqrt(np.maximum(np.linalg.eigvalsh(np.cov((centred / size).T)), 0))
    if extents[0] < FLAT * extents[2]:
        what = "plane" if extents[1] >= FLAT * extents[2] else "straight line"
        raise InputError(
            f"{source}: its {len(points)} points lie in a {what}: the points of a solid's surface are needed"
        )


def first_of_each(points: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
    """Mark points but those that repeat an earlier one exactly."""
    return ~np.asarray(pd.DataFrame(points).duplicated())
