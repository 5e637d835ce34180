"""Bearing supports: pillow blocks on a base plate, and bearings in a flange."""

from collections.abc import Sequence
from functools import partial

from jointsdf.shapes.builtin.construction import (
    ALONG_Y,
    Construction,
    Number,
    Pair,
    Point,
    around,
    box,
    plate,
    rod,
    slab_xz,
    slab_yz,
)
from jointsdf.values import LabelledMesh


def bearing_bracket(
    *,
    at: Point = (0, 0, 0),
    base: Point = (96, 56, 12),
    corner: Number = 9,
    axis: Number = 58,
    upright: Number = 16,
    boss: Pair = (23, 40),
    bore: Number = 13,
    chamfer: Number = 0,
    rib: Number = 10,
    rib_offsets: Sequence[Number] = (0,),
    bolt: Number = 4.5,
    inset: Pair = (11, 12),
    seat: Number = 0,
    oil_hole: Number = 0,
    numbered: bool = False,
    snap: bool = True,
) -> LabelledMesh:
    """A pillow block: base plate, upright, bearing boss with bore, ribs, four bolt holes.

    Args:
        at: Lowest corner of the base plate.
        base: Length, depth and thickness of the base plate.
        corner: Radius of the base plate's corners.
        axis: Height of the bore's axis above the bottom.
        upright: Thickness of the wall that carries the boss.
        boss: Radius and length.
        bore: Radius.
        chamfer: Of the bore's two edges.
        rib: Thickness.
        rib_offsets: Of each rib from the middle, along the length.
        bolt: Radius of the holes in the base plate.
        inset: Of the holes from the base plate's edges.
        seat: Radius of the flat countersink round each hole.
        oil_hole: Radius of the hole from the top of the boss to the bore.
        numbered: Whether each rib, hole and seat is a part of its own.
        snap: Whether coordinates are put on a grid, see `Construction`.
    """
    (x0, y0, z0), (length, depth, thickness), (boss_radius, boss_length) = at, base, boss
    x, y, z, floor = x0 + length / 2, y0 + depth / 2, z0 + axis, z0 + thickness - 2
    foot, top = boss_radius + 7, boss_radius - 1
    part = Construction(snap=snap)
    part.add("base", plate(at, (x0 + length, y0 + depth, z0 + thickness), corner))
    flank = [(x - foot, floor), (x + foot, floor), (x + top, z), (x - top, z)]
    part.add("upright", slab_xz(flank, y - upright / 2, y + upright / 2))
    reach = boss_length / 2 - 7
    web = [(y0 + 3, floor), (y0 + depth - 3, floor), (y + reach, z - 12), (y - reach, z - 12)]
    ribs = (slab_yz(web, x + offset - rib / 2, x + offset + rib / 2) for offset in rib_offsets)
    part.add_each("rib", ribs, numbered=numbered)
    front = y - boss_length / 2
    part.add("boss", rod((x, front, z), boss_length, boss_radius, turn=ALONG_Y))
    part.cut("bore", rod((x, y0 - 1, z), depth + 2, bore, turn=ALONG_Y))
    if chamfer:
        near = rod((x, front - 1, z), chamfer + 1, bore + chamfer + 1, bore, turn=ALONG_Y)
        far = rod((x, front + boss_length - chamfer, z), chamfer + 1, bore, bore + chamfer + 1, turn=ALONG_Y)
        part.cut("bore chamfer", near, far)
    if oil_hole:
        part.cut("oil hole", rod((x, y, z), boss_radius + 1, oil_hole))
    ends, sides = (x0 + inset[0], x0 + length - inset[0]), (y0 + inset[1], y0 + depth - inset[1])
    places = [(end, side) for end in ends for side in sides]
    part.cut_each("bolt hole", (rod((*place, z0 - 1), thickness + 2, bolt) for place in places), numbered=numbered)
    if seat:
        seats = (rod((*place, z0 + thickness - 3), 4, seat) for place in places)
        part.cut_each("seat", seats, numbered=numbered)
    return part.mesh()


def flange_bearing(
    *,
    at: Point,
    flange: Point,
    corner: Number,
    boss: Point,
    bore: Number,
    seat: Pair,
    bolt: Number,
    inset: Number,
    ribs: int = 0,
    rib: Number = 6,
    groove: Number = 0,
    numbered: bool = False,
) -> LabelledMesh:
    """A bearing in a four-bolt flange: flange plate, conical boss, stepped bore, ribs.

    Args:
        at: Lowest corner of the flange.
        flange: Length, depth and thickness.
        corner: Radius of the flange's corners.
        boss: Radius at the flange, radius at the top, height above the flange.
        bore: Radius of the hole right through.
        seat: Radius and depth of the bearing's seat at the top.
        bolt: Radius of the four holes.
        inset: Of the holes from the flange's edges.
        ribs: How many between flange and boss, the first along the diagonal.
        rib: Their thickness.
        groove: Depth of the ring groove in the boss, 0: none.
        numbered: Whether each rib and hole is a part of its own.
    """
    (x0, y0, z0), (length, depth, thickness), (low, high, height) = at, flange, boss
    x, y, top = x0 + length / 2, y0 + depth / 2, z0 + thickness + height
    part = Construction()
    part.add("flange", plate(at, (x0 + length, y0 + depth, z0 + thickness), corner))
    reach = min(length, depth) / 2 - 1
    blade = slab_xz([(0, -2), (reach, -2), (high - 1, 0.8 * height), (0, 0.8 * height)], -rib / 2, rib / 2)
    turned = (blade.rotate((0, 0, 360 / ribs * k + 45)).translate((x, y, z0 + thickness)) for k in range(ribs))
    part.add_each("rib", turned, numbered=numbered)
    part.add("boss", rod((x, y, z0 + thickness - 2), height + 2, low, high))
    part.cut("bore", rod((x, y, z0 - 1), thickness + height + 2, bore))
    part.cut("bearing seat", rod((x, y, top - seat[1]), seat[1] + 1, seat[0]))
    if groove:
        part.cut("groove", rod((x, y, top - 0.6 * seat[1]), 3, seat[0] + groove))
    places = [(x0 + inset, y0 + inset), (x0 + length - inset, y0 + inset)]
    places += [(px, y0 + depth - inset) for px, _ in places]
    part.cut_each("bolt hole", (rod((*place, z0 - 1), thickness + 2, bolt) for place in places), numbered=numbered)
    return part.mesh()


def bearing_carrier(
    *, at: Point, radius: Number, bar: Point, bore: Number, ears: int, ear: Pair, bolt: Number, numbered: bool = False
) -> LabelledMesh:
    """A round carrier on a bar: a bearing ring with bolted ears, held by a straight foot.

    Args:
        at: Middle of the ring's lower face.
        radius: Of the ring.
        bar: Length, width and thickness of the foot, along -y.
        bore: Radius.
        ears: How many round the ring.
        ear: Radius and thickness of each.
        bolt: Radius of the hole in each ear.
        numbered: Whether each ear and hole is a part of its own.
    """
    x, y, z = at
    length, width, thickness = bar
    places = around(ears, radius + 0.4 * ear[0], (x, y), phase=90)
    part = Construction()
    part.add("ring", rod(at, 2.2 * thickness, radius))
    part.add("foot", box((x - width / 2, y - length, z + 2), (x + width / 2, y - bore - 1, z + 2 + thickness)))
    part.add_each("ear", (rod((*place, z + 1), ear[1], ear[0]) for place in places), numbered=numbered)
    part.cut("bore", rod((x, y, z - 1), 2.2 * thickness + 2, bore))
    part.cut_each("ear hole", (rod((*place, z - 1), ear[1] + 4, bolt) for place in places), numbered=numbered)
    screws = ((x, y - length + share * (length - radius)) for share in (0.25, 0.7))
    part.cut_each("foot hole", (rod((*place, z), thickness + 4, bolt + 1) for place in screws), numbered=numbered)
    return part.mesh()


BEARINGS = (
    partial(bearing_bracket, snap=False),
    partial(
        flange_bearing, at=(12, 26, 8), flange=(92, 92, 13), corner=16, boss=(33, 27, 26),
        bore=15, seat=(21, 16), bolt=5.5, inset=14,
    ),
    partial(
        bearing_bracket, at=(20, 5, 14), base=(150, 70, 14), corner=6, axis=76, upright=20, boss=(30, 60), bore=19,
        chamfer=3, rib=9, rib_offsets=(-14, 14), bolt=6, inset=(17, 15), seat=11, oil_hole=4, numbered=True,
    ),
    partial(
        flange_bearing, at=(4, 9, 31), flange=(140, 110, 16), corner=10, boss=(44, 38, 34), bore=24, seat=(31, 22),
        bolt=6.5, inset=15, ribs=4, rib=8, groove=3, numbered=True,
    ),
    partial(
        bearing_carrier, at=(70, 120, 6), radius=42, bar=(112, 30, 14), bore=28, ears=3, ear=(13, 12), bolt=5,
    ),
)  # fmt: skip
