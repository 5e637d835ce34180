"""Integrals over the inside of a field and over its surface, without a mesh.

The training box is halved into cells, eight from one, where the surface may pass. A cell of the finest grid is cut by
the plane that value and gradient at its middle tell (`geometry/cut_cube.py`), which is of second order; at edges, where
the gradient turns, it is halved twice more. The integrals of two grids, one twice as fine, are extrapolated
(Richardson). At 256 cells along the box, the volumes of a ball and of a box are within 1e-7 and 1e-4 of themselves:
edges spoil the extrapolation, and the box's area is within 2e-3.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.errors import require_integer
from jointsdf.evaluation.mass_properties import Measures, PartMeasure, inertia_of, measure_parts
from jointsdf.geometry.cut_cube import cut_cubes
from jointsdf.geometry.mesh import unit
from jointsdf.model.field import JointField
from jointsdf.phases import tell
from jointsdf.values import BOX

STRAIGHT = np.cos(np.radians(10.0))  # turn of the gradient within a cell from which it is halved again, twice at most
COARSEST = 32  # cells along each side of the box at first
STEEPEST = 2.0  # gradient of the field at most: where |f| is above this times half a cell's diagonal, the cell is whole
RESOLUTION = 256  # cells along each side of the box
OCTANTS = np.stack(np.meshgrid(*[[-0.5, 0.5]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
CHUNK = 1 << 16  # points in one call of the field

Differential = Callable[[Float[ndarray, "n 3"]], tuple[Float[ndarray, " n"], Float[ndarray, "n 3"]]]
Label = Callable[[Float[ndarray, "n 3"]], Int[ndarray, " n"]]


class Sums(NamedTuple):
    """Integrals over the inside, and pieces of the surface, in the field's frame.

    Attributes:
        volume: Integral of 1.
        first: Of x.
        second: Of x x^T.
        parts: Area and centroid of each part.
    """

    volume: float
    first: Float[ndarray, "3"]
    second: Float[ndarray, "3 3"]
    parts: dict[int, PartMeasure]


def measure_field(field: JointField, resolution: int = RESOLUTION) -> Measures:
    """Measures of the solid where a field is negative, in file units, extrapolated from two grids.

    Args:
        field: The fitted field.
        resolution: Cells along each side of the training box on the finer grid, 64, 128, 256 or 512.

    Raises:
        InputError: Another resolution.
    """
    return extrapolate(field.network_differential, field.network_part, resolution).scaled(field)


class Extrapolated(NamedTuple):
    """Integrals of two grids, the second one twice as fine."""

    coarse: Sums
    fine: Sums

    def __call__(self, name: str) -> Float[ndarray, "..."]:
        """An integral, with the error of second order of both grids taken out."""
        fine, coarse = np.asarray(getattr(self.fine, name)), np.asarray(getattr(self.coarse, name))
        return np.asarray(fine + (fine - coarse) / 3)

    def scaled(self, field: JointField) -> Measures:
        """Measures in the file frame, of integrals in the network frame."""
        scale, volume, first = float(field.scale), float(self("volume")), self("first")
        middle = np.full(3, np.nan) if volume <= 0 else first / volume
        inertia = np.full((3, 3), np.nan) if volume <= 0 else inertia_of(volume, first, self("second"))
        parts = {part: self._part(part, field) for part in self.fine.parts}
        area = sum((part.area for part in parts.values()), start=0.0)
        centre = field.normalisation.inverse(middle[None])[0]
        return Measures(volume * scale**3, area, centre, inertia * scale**5, parts)

    def _part(self, part: int, field: JointField) -> PartMeasure:
        fine = self.fine.parts[part]
        before = self.coarse.parts.get(part, fine).area
        area = (fine.area + (fine.area - before) / 3) * float(field.scale) ** 2
        return PartMeasure(area, field.normalisation.inverse(fine.centroid[None])[0])


def extrapolate(differential: Differential, label: Label, resolution: int) -> Extrapolated:
    """Integrals on the grid of half the resolution and on that of the resolution; see `measure_field`."""
    steps = int(np.log2(max(resolution, 1) / COARSEST))
    require_integer("resolution", resolution, 2 * COARSEST, COARSEST << 4)
    require_integer("resolution", resolution, COARSEST << steps, COARSEST << steps)  # a power of two
    found: list[Sums] = []
    for step in (steps - 1, steps):
        tell(len(found), 2)
        found.append(integrate(differential, label, step))
    return Extrapolated(*found)


def integrate(differential: Differential, label: Label, halvings: int) -> Sums:
    """Integrals on one grid.

    Args:
        differential: Points of the network frame -> value, negative inside, and gradient.
        label: Points of the network frame -> part id.
        halvings: Of the cells of the coarsest grid.
    """
    side = 2 * BOX / COARSEST
    axis = (np.arange(COARSEST) + 0.5) * side - BOX
    cells = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    volume, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for _ in range(halvings):
        values, _ = _in_chunks(differential, cells)
        beyond = STEEPEST * np.sqrt(3) / 2 * side
        whole = cells[values < -beyond]
        volume += len(whole) * side**3
        first += whole.sum(axis=0) * side**3
        second += (whole.T @ whole) * side**3 + len(whole) * side**5 / 12 * np.eye(3)
        near = cells[np.abs(values) <= beyond]
        cells, side = (near[:, None] + OCTANTS * side / 2).reshape(-1, 3), side / 2
    surface: list[tuple[Float[ndarray, "n 3"], ndarray, ndarray]] = []  # middles, areas and places of surface
    for deeper in (True, True, False):
        found, cells = _cut(differential, cells, side, deeper=deeper)
        volumes = found.volumes
        volume += volumes.sum()
        first += volumes @ found.middles
        second += (found.middles * volumes[:, None]).T @ found.middles + volumes.sum() * side**2 / 12 * np.eye(3)
        surface.append((found.places, found.areas, _labels(label, found.places)))
        side /= 2
    places, areas, labels = (np.concatenate(column) for column in zip(*surface, strict=True))
    return Sums(volume, first, second, measure_parts(labels, areas, places))


class _Cut(NamedTuple):
    """Cells cut by the surface.

    Attributes:
        volumes: Inside of each.
        middles: Of these volumes.
        areas: Of the surface in those that it passes through.
        places: On the surface in these.
    """

    volumes: Float[ndarray, " n"]
    middles: Float[ndarray, "n 3"]
    areas: Float[ndarray, " m"]
    places: Float[ndarray, "m 3"]


def _cut(
    differential: Differential, cells: Float[ndarray, "n 3"], side: float, *, deeper: bool
) -> tuple[_Cut, Float[ndarray, "k 3"]]:
    """Cut cells by planes; with `deeper`, those in which the gradient turns are not cut but halved, and returned."""
    values, slopes = _in_chunks(differential, cells)
    cut = cut_cubes(values, slopes * side)
    at = cut.area > 0
    squared = np.maximum(np.einsum("ij,ij->i", slopes[at], slopes[at]), np.finfo(float).tiny)
    places = cells[at] - (values[at] / squared)[:, None] * slopes[at]
    bent = np.zeros(len(cells), dtype=bool)
    if deeper:
        there = _in_chunks(differential, places)[1]
        bent[at] = np.einsum("ij,ij->i", unit(there), unit(slopes[at])) < STRAIGHT
    volumes, moments = cut.volume[~bent] * side**3, cut.moment[~bent] * side**4
    shift = np.divide(moments, volumes[:, None], out=np.zeros_like(moments), where=volumes[:, None] > 0)
    found = _Cut(volumes, cells[~bent] + shift, cut.area[at & ~bent] * side**2, places[~bent[at]])
    return found, (cells[bent][:, None] + OCTANTS * side / 2).reshape(-1, 3)


def _labels(label: Label, places: Float[ndarray, "n 3"]) -> Int[ndarray, " n"]:
    return np.concatenate([label(piece) for piece in np.array_split(places, -(-len(places) // CHUNK) or 1)])


def _in_chunks(
    differential: Differential, points: Float[ndarray, "n 3"]
) -> tuple[Float[ndarray, " n"], Float[ndarray, "n 3"]]:
    """Values and gradients in float64."""
    if not len(points):
        return np.zeros(0), np.zeros((0, 3))
    found = [differential(points[start : start + CHUNK]) for start in range(0, len(points), CHUNK)]
    values, slopes = zip(*found, strict=True)
    return np.concatenate(values).astype(np.float64), np.concatenate(slopes).astype(np.float64)
