"""Links of mechanisms: connecting rods, forks, and hinges."""

from functools import partial

from manifold3d import Manifold

from jointsdf.shapes.builtin.construction import ALONG_X, ALONG_Y, Construction, Number, Pair, Point, box, rod, slab_xy
from jointsdf.values import LabelledMesh


def connecting_rod(
    *,
    at: Point,
    centres: Number,
    big: Point,
    small: Point,
    shank: Point,
    pocket: Number = 0,
    cap_bolt: Number = 0,
    oil_hole: Number = 0,
    numbered: bool = False,
) -> LabelledMesh:
    """A connecting rod along x: big and small eye, tapered shank with pockets, bolt lugs at the big eye.

    Args:
        at: Middle of the lower side of the big eye.
        centres: Distance of the two bores.
        big: Outer radius, bore radius and width of the big eye.
        small: The same of the small eye.
        shank: Half width at the big eye, half width at the small eye, thickness.
        pocket: Depth of the pocket in either side of the shank; 0: none.
        cap_bolt: Radius of the two bolts beside the big bore, along x; 0: none.
        oil_hole: Radius of the hole in the small eye, along x; 0: none.
        numbered: Whether either pocket, bolt lug and bolt hole is a part of its own.
    """
    x, y, z = at
    middle, end = z + big[2] / 2, x + centres
    low, high = middle - shank[2] / 2, middle + shank[2] / 2
    part = Construction()
    part.add(
        "shank", slab_xy([(x, y - shank[0]), (end, y - shank[1]), (end, y + shank[1]), (x, y + shank[0])], low, high)
    )
    lugs = [(x - 0.5 * big[0], y + side * (big[0] - 0.2 * cap_bolt), middle) for side in (-1, 1)]
    if cap_bolt:
        solids = (rod(start, big[0], 2.2 * cap_bolt, turn=ALONG_X) for start in lugs)
        part.add_each("bolt lug", solids, numbered=numbered)
    part.add("big eye", rod(at, big[2], big[0]))
    part.add("small eye", rod((end, y, middle - small[2] / 2), small[2], small[0]))
    if pocket:
        a, b = x + big[0] + 5, end - small[0] - 4
        rim = 0.35 * shank[1]
        flat = [
            (a, y - shank[0] + 1.6 * rim),
            (b, y - shank[1] + rim),
            (b, y + shank[1] - rim),
            (a, y + shank[0] - 1.6 * rim),
        ]
        sides = ((low - 1, low + pocket), (high - pocket, high + 1))
        part.cut_each("pocket", (slab_xy(flat, *side) for side in sides), numbered=numbered)
    part.cut("big bore", rod((x, y, z - 1), big[2] + 2, big[1]))
    part.cut("small bore", rod((end, y, middle - small[2] / 2 - 1), small[2] + 2, small[1]))
    if cap_bolt:
        bolts = (rod((sx - 1, sy, sz), big[0] + 2, cap_bolt, turn=ALONG_X) for sx, sy, sz in lugs)
        part.cut_each("bolt hole", bolts, numbered=numbered)
    if oil_hole:
        part.cut("oil hole", rod((end, y, middle), small[0] + 1, oil_hole, turn=ALONG_X))
    return part.mesh()


def fork(
    *,
    at: Point,
    shank: Pair,
    body: Point,
    tines: int,
    tine: Point,
    eye: Pair,
    thread: Pair = (0, 0),
    collar: Pair = (0, 0),
    numbered: bool = False,
) -> LabelledMesh:
    """A clevis along x: round shank, block, parallel tines that end in eyes with one pin bore.

    Args:
        at: Start of the shank's axis.
        shank: Radius and length.
        body: Length, width (y) and height (z) of the block.
        tines: How many, evenly over the block's width.
        tine: Thickness (y), reach from the block to the eyes' centre, height (z).
        eye: Outer radius and bore radius.
        thread: Radius and depth of the blind hole in the shank; 0: none.
        collar: Radius and thickness of the collar before the block; 0: none.
        numbered: Whether each tine and eye is a part of its own.
    """
    x, y, z = at
    start, end = x + shank[1], x + shank[1] + body[0]
    low = y - body[1] / 2
    pitch = (body[1] - tine[0]) / (tines - 1)
    walls = [(low + pitch * k, low + pitch * k + tine[0]) for k in range(tines)]
    part = Construction()
    part.add("shank", rod(at, shank[1] + 1, shank[0], turn=ALONG_X))
    if collar[0]:
        part.add("collar", rod((start - collar[1], y, z), collar[1] + 1, collar[0], turn=ALONG_X))
    part.add("body", box((start, low - 1, z - body[2] / 2), (end, low + body[1] + 1, z + body[2] / 2)))
    blades = (box((end - 1, a, z - tine[2] / 2), (end + tine[1], b, z + tine[2] / 2)) for a, b in walls)
    part.add_each("tine", blades, numbered=numbered)
    eyes = (rod((end + tine[1], a - 0.5, z), b - a + 1, eye[0], turn=ALONG_Y) for a, b in walls)
    part.add_each("eye", eyes, numbered=numbered)
    part.cut("pin bore", rod((end + tine[1], low - 2, z), body[1] + 4, eye[1], turn=ALONG_Y))
    if thread[0]:
        part.cut("thread", rod((x - 1, y, z), thread[1] + 1, thread[0], turn=ALONG_X))
    return part.mesh()


def hinge(
    *, at: Point, leaf: Point, barrel: Number, pin: Number, knuckles: int, screw: Pair, numbered: bool = False
) -> LabelledMesh:
    """An open butt hinge: two leaves, interlaced knuckles on one pin along y, countersunk screw holes.

    Args:
        at: Pin axis at its lowest y, at the height of the leaves' lower side.
        leaf: Width of either leaf (x), length (y), thickness (z).
        barrel: Radius of the knuckles.
        pin: Radius.
        knuckles: How many in all.
        screw: Radius of the holes and of their countersinks.
        numbered: Whether each knuckle and hole is a part of its own.
    """
    x, y, z = at
    width, length, thickness = leaf
    gap, pitch, height = barrel + 1, length / knuckles, z + 0.6 * barrel
    spans = [(y + pitch * k + 0.5, y + pitch * (k + 1) - 0.5) for k in range(knuckles)]
    part = Construction()
    for name, side in (("left leaf", -1), ("right leaf", 1)):
        tabs = (_flat_box((x, a + 0.5), (x + side * (gap + 1), b - 0.5), z, thickness) for a, b in spans[side > 0 :: 2])
        part.add(name, _flat_box((x + side * gap, y), (x + side * width, y + length), z, thickness), *tabs)
    rods = (rod((x, a, height), b - a, barrel, turn=ALONG_Y) for a, b in spans)
    part.add_each("knuckle", rods, numbered=numbered)
    head = 0.5 * (pin + barrel)
    heads = (rod((x, start, height), 3, head, turn=ALONG_Y) for start in (y - 2.5, y + length - 0.5))
    part.add("pin", rod((x, y - 1, height), length + 2, pin, turn=ALONG_Y), *heads)
    xs = [x + side * (gap + width) / 2 for side in (-1, 1)]
    places = [(px, y + share * length) for px in xs for share in (0.18, 0.5, 0.82)]
    sink = screw[1] - screw[0]
    tools = [
        rod((*place, z - 1), thickness + 2, screw[0])
        + rod((*place, z + thickness - sink), sink + 1, screw[0], screw[1] + 1)
        for place in places
    ]
    part.cut_each("screw hole", tools, numbered=numbered)
    return part.mesh()


def _flat_box(one: Pair, other: Pair, bottom: Number, thickness: Number) -> Manifold:
    """The flat box over the rectangle of two opposite corners."""
    (xa, xb), (ya, yb) = sorted((one[0], other[0])), sorted((one[1], other[1]))
    return box((xa, ya, bottom), (xb, yb, bottom + thickness))


LINKS = (
    partial(
        connecting_rod, at=(36, 40, 8), centres=118, big=(30, 20, 24), small=(17, 10, 20), shank=(14, 9, 13), pocket=4,
    ),
    partial(
        fork, at=(3, 30, 26), shank=(11, 34), body=(18, 40, 30), tines=2, tine=(11, 32, 26), eye=(15, 8),
        thread=(6, 22), collar=(17, 7),
    ),
    partial(hinge, at=(60, 9, 12), leaf=(52, 96, 3.2), barrel=7, pin=4, knuckles=5, screw=(3, 5.5), numbered=True),
    partial(
        connecting_rod, at=(45, 62, 15), centres=165, big=(38, 27, 30), small=(22, 13, 30), shank=(19, 13, 18),
        pocket=6, cap_bolt=4.5, oil_hole=3, numbered=True,
    ),
    partial(
        fork, at=(10, 70, 50), shank=(16, 30), body=(20, 96, 34), tines=4, tine=(14, 40, 28), eye=(17, 9),
        thread=(9, 26), numbered=True,
    ),
)  # fmt: skip
