"""Planes in any direction through the training box, the field's values on a raster in them, and their isolines."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from skimage.measure import find_contours

from jointsdf.errors import InputError
from jointsdf.model.field import JointField
from jointsdf.values import BOX, Normalisation
from jointsdf.viewing.plane import AXES, Plane, parse_plane

RASTER = 400  # points along each side of the square
EXAMPLES = "e.g. z=12.5, or nx,ny,nz,d for nx x + ny y + nz z = d, in file units"


@dataclass(frozen=True)
class Section:
    """A plane, and a square in it that holds all of the training box there; file frame.

    Attributes:
        name: Equation of the plane, without the unit.
        corner: Lower left corner of the square.
        right: Unit vector to the right in the picture.
        up: Unit vector upwards in the picture.
        side: Of the square.
        axes: Names of the coordinates along `right` and `up`.
        start: Those coordinates of the corner.
    """

    name: str
    corner: Float[ndarray, "3"]
    right: Float[ndarray, "3"]
    up: Float[ndarray, "3"]
    side: float
    axes: tuple[str, str]
    start: Float[ndarray, "2"]

    @classmethod
    def of_plane(cls, plane: Plane) -> "Section":
        """The section normal to an axis."""
        corner, unit = np.zeros(3), np.eye(3)
        corner[[plane.normal, plane.right, plane.up]] = plane.place, *plane.low
        axes = AXES[plane.right], AXES[plane.up]
        return cls(plane.name, corner, unit[plane.right], unit[plane.up], plane.side, axes, plane.low)

    def ticks(self, count: int) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
        """Coordinates of a raster's columns and rows: the middles of `count` equal intervals of the square's sides."""
        middles = (np.arange(count) + 0.5) / count * self.side
        return self.start[0] + middles, self.start[1] + middles

    def places(self, columns: Float[ndarray, " n"], rows: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
        """Points of the file frame at coordinates of the plane."""
        across, above = columns - self.start[0], rows - self.start[1]
        return np.asarray(self.corner + across[:, None] * self.right + above[:, None] * self.up)

    def raster(self, count: int) -> Float[ndarray, "n 3"]:
        """Points of a raster of `count` rows and columns, row by row upwards, each from left to right."""
        columns, rows = (each.ravel() for each in np.meshgrid(*self.ticks(count)))
        return self.places(columns, rows)


@dataclass(frozen=True)
class Isoline:
    """A polyline of one value.

    Attributes:
        level: The value, file units.
        points: Corners, file frame; the last one is the first again where the line is closed.
    """

    level: float
    points: Float[ndarray, "n 3"]

    @property
    def is_closed(self) -> bool:
        """True if it ends where it starts."""
        return bool(np.array_equal(self.points[0], self.points[-1]))


def parse_section(text: str, normalisation: Normalisation, up: str) -> Section:
    """Make the section of an equation.

    Args:
        text: `z=12.5`, or `nx,ny,nz,d` for the plane n . x = d, n of any length; file units.
        normalisation: File frame -> network frame.
        up: Axis of the file frame that points up.

    Raises:
        InputError: Not such an equation, or a plane outside the training box.
    """
    if "," not in text:
        return Section.of_plane(parse_plane(text, normalisation, up, option="--plane", examples=EXAMPLES))
    try:
        *given, d = map(float, text.split(","))
        normal, length = np.array(given), float(np.linalg.norm(given))
    except ValueError as error:
        raise InputError(f"--plane {text}: give an equation, {EXAMPLES}") from error
    if normal.shape != (3,) or not np.isfinite([*normal, d]).all() or length == 0:
        raise InputError(f"--plane {text}: give an equation, {EXAMPLES}")
    return _oblique(text, normal / length, d / length, normalisation, up)


def _oblique(text: str, normal: Float[ndarray, "3"], d: float, frame: Normalisation, up: str) -> Section:
    """The section of a plane by its unit normal and its place along it."""
    corners = frame.inverse(np.array(list(product((-BOX, BOX), repeat=3))))
    heights = corners @ normal - d
    if heights.min() > 0 or heights.max() < 0:
        low, high = heights.min() + d, heights.max() + d
        raise InputError(
            f"--plane {text}: outside the training box; of the unit normal give d from {low:.6g} to {high:.6g}"
        )
    vertical = np.eye(3)[AXES.index(up)]
    if abs(vertical @ normal) > 0.999:
        vertical = np.eye(3)[int(np.argmin(np.abs(normal)))]
    right = np.cross(vertical, normal)
    right /= np.linalg.norm(right)
    above = np.cross(normal, right)
    ends = np.concatenate([_crossings(corners, heights), corners[heights == 0]])
    u, v = ends @ right, ends @ above
    side = float(max(np.ptp(u), np.ptp(v)))
    start = np.array([(u.min() + u.max() - side) / 2, (v.min() + v.max() - side) / 2])
    corner = normal * d + right * start[0] + above * start[1]
    name = " + ".join(f"{n:.4g} {axis}" for n, axis in zip(normal, AXES, strict=True)).replace("+ -", "- ")
    return Section(f"{name} = {d:.6g}", corner, right, above, side, ("u", "v"), start)


def _crossings(corners: Float[ndarray, "8 3"], heights: Float[ndarray, "8"]) -> Float[ndarray, "n 3"]:
    """Points where edges of the box cross the plane."""
    found = []
    for first in range(8):
        for bit in (1, 2, 4):
            second = first ^ bit
            if first < second and heights[first] * heights[second] < 0:
                share = heights[first] / (heights[first] - heights[second])
                found.append(corners[first] + share * (corners[second] - corners[first]))
    return np.array(found).reshape(-1, 3)


def section_values(field: JointField, section: Section, raster: int = RASTER) -> Float[ndarray, "n n"]:
    """Signed distances on a raster of a section, file units; NaN outside the training box.

    Args:
        field: The fitted field.
        section: Within the training box, at least in part.
        raster: Points along each side of the square.
    """
    points = section.raster(raster)
    values = np.full(len(points), np.nan)
    within = (np.abs(field.normalisation.forward(points)) <= BOX).all(axis=1)
    values[within] = field.query(points[within], what="sdf").sdf
    return values.reshape(raster, raster)


def isolines(section: Section, values: Float[ndarray, "n n"], levels: Float[ndarray, " k"]) -> Iterator[Isoline]:
    """Isolines of values on a raster as polylines, level by level, by marching squares.

    Args:
        section: The plane and its square.
        values: On its raster; NaN where there is none.
        levels: Values of the lines, file units.
    """
    step = section.side / len(values)
    for level in levels.tolist():
        for line in find_contours(values, level):
            columns, rows = section.start[:, None] + (line.T[::-1] + 0.5) * step
            yield Isoline(level, section.places(columns, rows))
