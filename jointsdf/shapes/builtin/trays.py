"""Thin-walled sheet parts: open trays with tubes and dividers, and finned heat sinks."""

from collections.abc import Sequence
from functools import partial

from jointsdf.shapes.builtin.construction import ALONG_X, Construction, Number, Pair, Point, box, plate, rod
from jointsdf.values import LabelledMesh


def thin_tray(
    *,
    at: Point = (5, 5, 5),
    size: Point = (100, 64, 40),
    wall: Number = 2,
    corner: Number = 0,
    tubes: Sequence[Point] = ((32, 19, 11),),
    tube_length: Number = 20,
    dividers: Sequence[Number] = (),
    divider_height: Number = 0,
    rim: Number = 0,
    drains: Sequence[Point] = (),
    numbered: bool = False,
    snap: bool = True,
) -> LabelledMesh:
    """An open box with thin walls, and thin tubes through the side of highest x. Places are relative to `at`.

    Args:
        at: Lowest corner of the box.
        size: Of the box, without tubes and rim.
        wall: Thickness of walls, floor, dividers, rim and tubes.
        corner: Outer radius of the vertical edges; 0: sharp.
        tubes: (y, z, outer radius) of each.
        tube_length: How far they stand out.
        dividers: x of the lower side of each wall across the box.
        divider_height: Above the bottom.
        rim: How far the brim at the top stands out on all sides; 0: none.
        drains: (x, y, radius) of each hole in the floor.
        numbered: Whether each tube, divider, and hole is a part of its own.
        snap: Whether coordinates are put on a grid, see `Construction`.
    """
    (x0, y0, z0), (length, depth, height) = at, size
    far, top = (x0 + length, y0 + depth, z0 + height), z0 + height
    part = Construction(snap=snap)
    part.add("shell", plate(at, far, corner) if corner else box(at, far))
    if rim:
        low, high = (x0 - rim, y0 - rim, top - wall), (far[0] + rim, far[1] + rim, top)
        part.add("rim", plate(low, high, corner + rim) if corner else box(low, high))
    outer = (rod((far[0] - 1, y0 + y, z0 + z), tube_length + 1, radius, turn=ALONG_X) for y, z, radius in tubes)
    part.add_each("tube", outer, numbered=numbered)
    low, high = (x0 + wall, y0 + wall, z0 + wall), (far[0] - wall, far[1] - wall, top + 1)
    part.cut("cavity", plate(low, high, corner - wall) if corner else box(low, high))
    sheets = ((x0 + x, x0 + x + wall) for x in dividers)
    ends = (y0 + wall / 2, far[1] - wall / 2)
    walls = (box((a, ends[0], z0 + wall / 2), (b, ends[1], z0 + divider_height)) for a, b in sheets)
    part.add_each("divider", walls, numbered=numbered)
    start, reach = far[0] - wall - 1, tube_length + wall + 8
    bores = (rod((start, y0 + y, z0 + z), reach, radius - wall, turn=ALONG_X) for y, z, radius in tubes)
    part.cut_each("tube bore", bores, numbered=numbered)
    holes = (rod((x0 + x, y0 + y, z0 - 1), wall + 2, radius) for x, y, radius in drains)
    part.cut_each("drain", holes, numbered=numbered)
    return part.mesh()


def heat_sink(
    *,
    at: Point,
    base: Point,
    fins: int,
    fin: Pair,
    margin: Number,
    screws: Number,
    core: Pair = (0, 0),
    numbered: bool = False,
) -> LabelledMesh:
    """A heat sink: base plate with thin fins, four screw holes, and a core that joins the fins.

    Args:
        at: Lowest corner of the base plate.
        base: Length along the fins, width across them, thickness.
        fins: How many.
        fin: Thickness and height above the base plate.
        margin: Base plate left free before and behind the fins, for the screws.
        screws: Radius of the screw holes.
        core: Radius and height of the round core in the middle; radius 0: none.
        numbered: Whether each fin is a part of its own.
    """
    (x0, y0, z0), (length, width, thickness) = at, base
    top = z0 + thickness
    part = Construction()
    part.add("base", box(at, (x0 + length, y0 + width, top)))
    inset, pitch = 1.5 * fin[0], (width - 4 * fin[0]) / (fins - 1)
    starts = (y0 + inset + pitch * k for k in range(fins))
    blades = (box((x0 + margin, y, top - 1), (x0 + length - margin, y + fin[0], top + fin[1])) for y in starts)
    part.add_each("fin", blades, numbered=numbered)
    if core[0]:
        part.add("core", rod((x0 + length / 2, y0 + width / 2, top - 1), core[1] + 1, core[0]))
    places = [(x0 + x, y0 + y) for x in (margin / 2, length - margin / 2) for y in (2 * margin, width - 2 * margin)]
    part.cut("screw hole", *(rod((*place, z0 - 1), thickness + 2, screws) for place in places))
    return part.mesh()


TRAYS = (
    partial(thin_tray, snap=False),
    partial(thin_tray, at=(14, 3, 21), size=(86, 86, 60), wall=2.6, corner=20, tubes=()),
    partial(
        heat_sink, at=(6, 30, 2), base=(100, 88, 6), fins=13, fin=(2.4, 34), margin=9, screws=2.5, core=(15, 36),
        numbered=True,
    ),
    partial(
        thin_tray, at=(25, 20, 10), size=(150, 100, 36), wall=4, corner=14, tubes=((30, 18, 12), (70, 18, 12)),
        tube_length=18, dividers=(48, 98), divider_height=26, rim=9, drains=((24, 50, 7), (74, 50, 7)), numbered=True,
    ),
    partial(
        thin_tray, at=(40, 8, 6), size=(120, 52, 52), wall=3, tubes=((26, 28, 17),), tube_length=34,
        dividers=(40, 78), divider_height=40,
    ),
)  # fmt: skip
