"""Angle brackets: two or three plates at right angles, with ribs and holes."""

from collections.abc import Sequence
from functools import partial

from jointsdf.shapes.builtin.construction import ALONG_Y, Construction, Number, Pair, Point, box, rod, slab_yz, slot
from jointsdf.values import LabelledMesh


def angle_bracket(
    *,
    at: Point = (10, 10, 4),
    size: Point = (70, 56, 60),
    thickness: Number = 9,
    ribs: Sequence[Pair] = ((4, 11), (59, 66)),
    rib_reach: Pair = (48, 50),
    foot_holes: Sequence[Point] = ((23, 36, 5.5), (47, 36, 5.5)),
    wall_holes: Sequence[Point] = ((35, 38, 11),),
    foot_slots: Sequence[Point] = (),
    slot_length: Number = 0,
    counterbore: Number = 0,
    seat: Number = 0,
    side: Number = 0,
    lip: Number = 0,
    numbered: bool = False,
    snap: bool = True,
) -> LabelledMesh:
    """An L-bracket: foot and wall, triangular ribs, holes in both legs. Places are relative to `at`.

    Args:
        at: Lowest corner.
        size: Length along the bend, depth of the foot, height of the wall.
        thickness: Of foot and wall.
        ribs: First and last x of each rib.
        rib_reach: How far the ribs reach along the foot and up the wall.
        foot_holes: (x, y, radius) of each.
        wall_holes: (x, z, radius) of each.
        foot_slots: (x, y, radius) of each slot's start; it runs along y.
        slot_length: Between the ends' centres.
        counterbore: Radius of the step round each foot hole, half as deep as the foot; 0: none.
        seat: Where wall, side and lip start: at `thickness` they stand on the foot, at 0 they run through the corner.
        side: Height of a third plate that closes the end at the lowest x; 0: none.
        lip: Height of the foot's upturned front edge; 0: none.
        numbered: Whether each rib, hole and slot is a part of its own.
        snap: Whether coordinates are put on a grid, see `Construction`.
    """
    (x0, y0, z0), (length, depth, height) = at, size
    part = Construction(snap=snap)
    part.add("foot", box(at, (x0 + length, y0 + depth, z0 + thickness)))
    part.add("wall", box((x0, y0, z0 + seat), (x0 + length, y0 + thickness, z0 + height)))
    if side:
        part.add("side", box((x0, y0 + seat, z0 + seat), (x0 + thickness, y0 + depth, z0 + side)))
    if lip:
        part.add("lip", box((x0, y0 + depth - thickness, z0 + seat), (x0 + length, y0 + depth, z0 + lip)))
    sink = thickness / 2 + 0.5
    gusset = [(y0 + sink, z0 + sink), (y0 + rib_reach[0], z0 + sink), (y0 + sink, z0 + rib_reach[1])]
    part.add_each("rib", (slab_yz(gusset, x0 + low, x0 + high) for low, high in ribs), numbered=numbered)
    through = thickness + 2
    holes = (rod((x0 + x, y0 + y, z0 - 1), through, radius) for x, y, radius in foot_holes)
    part.cut_each("foot hole", holes, numbered=numbered)
    if counterbore:
        steps = (rod((x0 + x, y0 + y, z0 + thickness / 2), thickness, counterbore) for x, y, _ in foot_holes)
        part.cut_each("counterbore", steps, numbered=numbered)
    holes = (rod((x0 + x, y0 - 1, z0 + z), through, radius, turn=ALONG_Y) for x, z, radius in wall_holes)
    part.cut_each("wall hole", holes, numbered=numbered)
    shift = (0, slot_length, 0)
    slots = (slot((x0 + x, y0 + y, z0 - 1), shift, through, radius) for x, y, radius in foot_slots)
    part.cut_each("slot", slots, numbered=numbered)
    return part.mesh()


ANGLES = (
    partial(angle_bracket, snap=False),
    partial(
        angle_bracket, at=(3, 22, 9), size=(40, 90, 110), thickness=8, seat=8, ribs=((16, 24),), rib_reach=(70, 85),
        foot_holes=(), wall_holes=((20, 98, 5),), foot_slots=((8, 60, 3.5), (32, 60, 3.5)), slot_length=18,
    ),
    partial(
        angle_bracket, at=(15, 6, 2), size=(120, 60, 72), thickness=3.2, seat=3.2, ribs=(), foot_holes=(), side=40,
        wall_holes=((30, 50, 7), (60, 50, 7), (90, 50, 7)), foot_slots=((40, 24, 4), (90, 24, 4)), slot_length=20,
        numbered=True,
    ),
    partial(
        angle_bracket, at=(30, 14, 20), size=(160, 84, 90), thickness=14, seat=14,
        ribs=((10, 20), (75, 85), (140, 150)), rib_reach=(76, 80), counterbore=9.5,
        foot_holes=((32, 48, 5), (62, 48, 5), (98, 48, 5), (128, 48, 5)),
        wall_holes=((47, 55, 15), (113, 55, 15)), numbered=True,
    ),
    partial(
        angle_bracket, at=(8, 40, 3), size=(150, 46, 58), thickness=3.6, seat=3.6, ribs=(), lip=16, counterbore=0,
        foot_holes=((30, 24, 5), (120, 24, 5)), wall_holes=((75, 34, 15), (25, 34, 6), (125, 34, 6)),
    ),
)  # fmt: skip
