"""Constructive solid geometry whose faces know the primitive that they come from. Millimetres."""

from collections.abc import Callable, Iterable, Sequence
from math import cos, radians, sin

import numpy as np
from jaxtyping import Float
from manifold3d import CrossSection, FillRule, JoinType, Manifold
from numpy import ndarray

from jointsdf.values import LabelledMesh

SEGMENTS = 96  # of a full circle
ALONG_X, ALONG_Y = (0.0, 90.0, 0.0), (-90.0, 0.0, 0.0)  # rotations (degrees) that turn the z axis
GRID = 2.0**20  # cells per millimetre: far above the last bits in which machines differ, far below any feature
FINE_GRID = 2.0**24  # for the corners that booleans make
SLIVER = 8 / GRID  # millimetres: tolerance of the simplification

Number = int | float  # of millimetres or degrees
Pair = tuple[Number, Number]
Point = tuple[Number, Number, Number]
Outline = Sequence[Pair]


class Construction:
    """A solid made by booleans that records the part of each primitive."""

    def __init__(self, *, snap: bool = True) -> None:
        """Start with an empty solid.

        Args:
            snap: Whether coordinates are rounded to a grid, so that sines which differ in their last bit between
                machines do not make another mesh.
        """
        self._snap = snap
        self._solid = Manifold()
        self._part_of: dict[int, int] = {}
        self._parts: list[str] = []

    def add(self, part: str, *solids: Manifold) -> None:
        """Unite with `solids`; the faces that they bring belong to `part`."""
        self._solid += self._register(part, solids)

    def cut(self, part: str, *solids: Manifold) -> None:
        """Subtract `solids`; the faces that they leave belong to `part`."""
        self._solid -= self._register(part, solids)

    def add_each(self, part: str, solids: Iterable[Manifold], *, numbered: bool) -> None:
        """Unite with `solids`: one part, or as many as there are solids, `part 1`, `part 2`, .., if numbered."""
        self._each(self.add, part, list(solids), numbered)

    def cut_each(self, part: str, solids: Iterable[Manifold], *, numbered: bool) -> None:
        """Subtract `solids`: one part, or as many as there are solids, `part 1`, `part 2`, .., if numbered."""
        self._each(self.cut, part, list(solids), numbered)

    def mesh(self) -> LabelledMesh:
        """The finished part; labels count the parts in the order of their first use."""
        solid = self._solid.simplify(SLIVER) if self._snap else self._solid  # corners on a grid leave slivers
        arrays = solid.to_mesh64()
        parts = [self._part_of[original] for original in arrays.run_original_id]
        labels = np.repeat(np.array(parts, dtype=np.int64), np.diff(arrays.run_index) // 3)
        missing = set(range(len(self._parts))) - set(np.unique(labels).tolist())
        assert not missing, f"parts without a face: {[self._parts[k] for k in sorted(missing)]}"
        vertices = np.array(arrays.vert_properties[:, :3], dtype=np.float64)
        if self._snap:
            vertices = snap_to_grid(vertices, FINE_GRID)
        return LabelledMesh(vertices, np.array(arrays.tri_verts, dtype=np.int64), labels)

    def _register(self, part: str, solids: Sequence[Manifold]) -> Manifold:
        """Unite `solids` to one primitive of `part`."""
        if part not in self._parts:
            self._parts.append(part)
        if self._snap:
            solids = [solid.warp_batch(lambda vertices: snap_to_grid(vertices, GRID)) for solid in solids]
        primitive = sum(solids[1:], start=solids[0]).as_original()
        self._part_of[primitive.original_id()] = self._parts.index(part)
        return primitive

    @staticmethod
    def _each(operation: Callable[..., None], part: str, solids: list[Manifold], numbered: bool) -> None:
        """Apply `operation` to all solids as one part, or to each as a part of its own."""
        if numbered:
            for number, solid in enumerate(solids, start=1):
                operation(f"{part} {number}", solid)
        elif solids:
            operation(part, *solids)


def snap_to_grid(vertices: Float[ndarray, "v 3"], grid: float) -> Float[ndarray, "v 3"]:
    """Round positions to a grid of `grid` cells per millimetre."""
    return np.asarray(np.round(vertices * grid) / grid + 0.0)  # + 0.0: no -0.0


def box(low: Point, high: Point) -> Manifold:
    """The axis-aligned box between two corners."""
    return Manifold.cube(tuple(b - a for a, b in zip(low, high, strict=True))).translate(low)


def rod(start: Point, length: Number, radius: Number, top_radius: Number = -1, turn: Point = (0, 0, 0)) -> Manifold:
    """A cylinder (or cone) from `start` along the z axis, turned by `turn` degrees about `start`."""
    return Manifold.cylinder(length, radius, top_radius, SEGMENTS).rotate(turn).translate(start)


def tube(start: Point, length: Number, outer: Number, inner: Number, turn: Point = (0, 0, 0)) -> Manifold:
    """A cylinder with a hole of radius `inner`, from `start` along the z axis, turned about `start`."""
    return ring([(inner, 0), (outer, 0), (outer, length), (inner, length)]).rotate(turn).translate(start)


def slot(start: Point, shift: Point, depth: Number, radius: Number, turn: Point = (0, 0, 0)) -> Manifold:
    """The sweep of a mill of `radius` from `start` to `start + shift`; its axis is turned like a rod's."""
    end = (start[0] + shift[0], start[1] + shift[1], start[2] + shift[2])
    return Manifold.batch_hull([rod(place, depth, radius, turn=turn) for place in (start, end)])


def plate(low: Point, high: Point, corner: Number) -> Manifold:
    """The box between two corners, its vertical edges rounded with radius `corner`."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    inner = CrossSection.square((x1 - x0 - 2 * corner, y1 - y0 - 2 * corner)).translate((x0 + corner, y0 + corner))
    outline = inner.offset(corner, JoinType.Round, circular_segments=SEGMENTS)
    return Manifold.extrude(outline, z1 - z0).translate((0, 0, z0))


def slab_xy(outline: Outline, z0: Number, z1: Number) -> Manifold:
    """The outline in the (x, y) plane, extruded from z0 to z1."""
    return Manifold.extrude(CrossSection([list(outline)], FillRule.NonZero), z1 - z0).translate((0.0, 0.0, z0))


def slab_xz(outline: Outline, y0: Number, y1: Number) -> Manifold:
    """The outline in the (x, z) plane, extruded from y0 to y1."""
    flat = CrossSection([list(outline)], FillRule.NonZero)
    return Manifold.extrude(flat, y1 - y0).rotate((90.0, 0.0, 0.0)).translate((0.0, y1, 0.0))


def slab_yz(outline: Outline, x0: Number, x1: Number) -> Manifold:
    """The outline in the (y, z) plane, extruded from x0 to x1."""
    return slab_xz(outline, -x1, -x0).rotate((0.0, 0.0, 90.0))


def ring(profile: Outline) -> Manifold:
    """The (radius, z) profile turned about the z axis."""
    return Manifold.revolve(CrossSection([list(profile)], FillRule.NonZero), SEGMENTS)


def around(count: int, radius: Number, centre: Pair = (0, 0), phase: Number = 0) -> list[Pair]:
    """The (x, y) of `count` places evenly on a circle, the first at `phase` degrees from +x."""
    angles = [radians(360 / count * k + phase) for k in range(count)]
    return [(centre[0] + radius * cos(angle), centre[1] + radius * sin(angle)) for angle in angles]
