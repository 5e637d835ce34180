"""CAD parts made by code: booleans of primitives, where every face knows the primitive that it came from.

To add one: a function that returns `Construction.mesh()`, and one line in `BUILTINS`. Units are millimetres.
"""

from collections.abc import Callable, Sequence
from math import cos, radians, sin

import numpy as np
from manifold3d import CrossSection, FillRule, JoinType, Manifold

from jointsdf.values import LabelledMesh

SEGMENTS = 96  # of a full circle
ALONG_X, ALONG_Y = (0.0, 90.0, 0.0), (-90.0, 0.0, 0.0)  # rotations (degrees) that turn the z axis

Number = int | float  # of millimetres or degrees
Point = tuple[Number, Number, Number]
Outline = Sequence[tuple[Number, Number]]


class Construction:
    """A solid grown by booleans that remembers which part each primitive makes."""

    def __init__(self) -> None:
        """Start with nothing."""
        self._solid = Manifold()
        self._part_of: dict[int, int] = {}
        self._parts: list[str] = []

    def add(self, part: str, *solids: Manifold) -> None:
        """Unite with `solids`; the faces that they bring belong to `part`."""
        self._solid += self._registered(part, solids)

    def cut(self, part: str, *solids: Manifold) -> None:
        """Subtract `solids`; the faces that they leave belong to `part`."""
        self._solid -= self._registered(part, solids)

    def mesh(self) -> LabelledMesh:
        """The finished part; labels count the parts in the order of their first use."""
        arrays = self._solid.to_mesh64()
        parts = [self._part_of[original] for original in arrays.run_original_id]
        labels = np.repeat(np.array(parts, dtype=np.int64), np.diff(arrays.run_index) // 3)
        vertices = np.array(arrays.vert_properties[:, :3], dtype=np.float64)
        return LabelledMesh(vertices, np.array(arrays.tri_verts, dtype=np.int64), labels)

    def _registered(self, part: str, solids: Sequence[Manifold]) -> Manifold:
        """The union of `solids` as one primitive of `part`."""
        if part not in self._parts:
            self._parts.append(part)
        primitive = sum(solids[1:], start=solids[0]).as_original()
        self._part_of[primitive.original_id()] = self._parts.index(part)
        return primitive


def box(low: Point, high: Point) -> Manifold:
    """The axis-aligned box between two corners."""
    return Manifold.cube(tuple(b - a for a, b in zip(low, high, strict=True))).translate(low)


def rod(start: Point, length: Number, radius: Number, top_radius: Number = -1, turn: Point = (0, 0, 0)) -> Manifold:
    """A cylinder (or cone) from `start` along the z axis, turned by `turn` degrees about `start`."""
    return Manifold.cylinder(length, radius, top_radius, SEGMENTS).rotate(turn).translate(start)


def plate(low: Point, high: Point, corner: Number) -> Manifold:
    """The box between two corners, its vertical edges rounded with radius `corner`."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    inner = CrossSection.square((x1 - x0 - 2 * corner, y1 - y0 - 2 * corner)).translate((x0 + corner, y0 + corner))
    outline = inner.offset(corner, JoinType.Round, circular_segments=SEGMENTS)
    return Manifold.extrude(outline, z1 - z0).translate((0, 0, z0))


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


def bearing_bracket() -> LabelledMesh:
    """A pillow block: base plate, upright, bearing boss with bore, two ribs, four bolt holes."""
    part = Construction()
    part.add("base", plate((0, 0, 0), (96, 56, 12), 9))
    part.add("upright", slab_xz([(18, 10), (78, 10), (70, 58), (26, 58)], 20, 36))
    part.add("rib", slab_yz([(3, 10), (53, 10), (41, 46), (15, 46)], 43, 53))
    part.add("boss", rod((48, 8, 58), 40, 23, turn=ALONG_Y))
    part.cut("bore", rod((48, -1, 58), 58, 13, turn=ALONG_Y))
    part.cut("bolt hole", *(rod((x, y, -1), 14, 4.5) for x in (11, 85) for y in (12, 44)))
    return part.mesh()


def stepped_shaft() -> LabelledMesh:
    """A shaft of four diameters along x with a collar, a key slot and a centre hole."""
    part = Construction()
    part.add("drive end", rod((5, 40, 30), 32, 11, turn=ALONG_X))
    part.add("seat", rod((36, 40, 30), 44, 16, turn=ALONG_X))
    part.add("collar", rod((79, 40, 30), 10, 24, turn=ALONG_X))
    part.add("journal", rod((88, 40, 30), 26, 13, turn=ALONG_X))
    part.add("tip", rod((113, 40, 30), 10, 13, 8, turn=ALONG_X))
    slot = (box((46, 36, 39), (68, 44, 50)), rod((46, 40, 39), 11, 4), rod((68, 40, 39), 11, 4))
    part.cut("key slot", *slot)
    part.cut("centre hole", rod((4, 40, 30), 17, 5, turn=ALONG_X))
    return part.mesh()


def pulley() -> LabelledMesh:
    """A V-belt pulley: rim with groove, recessed web with five openings, hub with keyed bore."""
    part = Construction()
    centre = (60.0, 55.0, 5.0)
    part.add("rim", Manifold.cylinder(26, 48, circular_segments=SEGMENTS).translate(centre))
    part.cut("groove", ring([(36, 9.5), (49, 4.5), (49, 21.5), (36, 16.5)]).translate(centre))
    sides = (ring([(10, z), (30, z), (30, z + 10), (10, z + 10)]).translate(centre) for z in (-1, 17))
    part.cut("recess", *sides)
    part.add("hub", rod((60, 55, 1), 34, 15))
    openings = ((60 + 22.5 * cos(radians(72 * k)), 55 + 22.5 * sin(radians(72 * k)), 0.0) for k in range(5))
    part.cut("opening", *(rod(start, 40, 5) for start in openings))
    part.cut("bore", rod((60, 55, 0), 40, 8), box((57, 55, 0), (63, 65.5, 40)))
    return part.mesh()


def angle_bracket() -> LabelledMesh:
    """An L-bracket: foot and wall, two triangular ribs, holes in both legs."""
    part = Construction()
    part.add("foot", box((10, 10, 4), (80, 66, 13)))
    part.add("wall", box((10, 10, 4), (80, 19, 64)))
    gusset = [(15.0, 9.0), (58.0, 9.0), (15.0, 54.0)]
    part.add("rib", slab_yz(gusset, 14, 21), slab_yz(gusset, 69, 76))
    part.cut("foot hole", *(rod((x, 46, 3), 11, 5.5) for x in (33, 57)))
    part.cut("wall hole", rod((45, 9, 42), 11, 11, turn=ALONG_Y))
    return part.mesh()


def thin_tray() -> LabelledMesh:
    """An open box with walls of 2% of its length, and a thin tube through one side."""
    part = Construction()
    part.add("shell", box((5, 5, 5), (105, 69, 45)))
    part.add("tube", rod((104, 37, 24), 21, 11, turn=ALONG_X))
    part.cut("cavity", box((7, 7, 7), (103, 67, 46)))
    part.cut("tube bore", rod((102, 37, 24), 30, 9, turn=ALONG_X))
    return part.mesh()


def manifold_block() -> LabelledMesh:
    """A hydraulic block: one long bore, crossed by two others, with wider ports and four mounting holes."""
    part = Construction()
    part.add("block", box((12, 8, 4), (96, 62, 52)))
    part.cut("main bore", rod((11, 35, 28), 76, 8, turn=ALONG_X))
    part.cut("cross bore", rod((36, 7, 28), 56, 6, turn=ALONG_Y), rod((66, 35, 20), 33, 6))
    ports = (rod((36, 7, 28), 9, 10, turn=ALONG_Y), rod((36, 54, 28), 9, 10, turn=ALONG_Y), rod((66, 35, 44), 9, 10))
    part.cut("port", rod((11, 35, 28), 9, 13, turn=ALONG_X), *ports)
    part.cut("mounting hole", *(rod((x, y, 3), 50, 3.5) for x in (20, 88) for y in (15, 55)))
    return part.mesh()


BUILTINS: dict[str, Callable[[], LabelledMesh]] = {
    "part_01": bearing_bracket,
    "part_02": stepped_shaft,
    "part_03": pulley,
    "part_04": angle_bracket,
    "part_05": thin_tray,
    "part_06": manifold_block,
}


def part_names() -> list[str]:
    """The names of the built-in parts."""
    return list(BUILTINS)
