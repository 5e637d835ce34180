"""Thin-walled housings: shell and lid, screw posts, bearing rings, vents, fins and feet."""

from collections.abc import Sequence
from functools import partial
from itertools import product

from manifold3d import Manifold

from jointsdf.shapes.builtin.construction import ALONG_X, Construction, Number, Pair, Point, box, plate, rod, slot
from jointsdf.values import LabelledMesh


def housing(
    *,
    at: Point,
    size: Point,
    wall: Number,
    corner: Number,
    posts: Pair = (0, 0),
    lid: Number = 0,
    lid_opening: Number = 0,
    boss: Pair = (0, 0),
    shaft: Pair = (0, 0),
    vents: int = 0,
    fins: Sequence[Number] = (),
    fin: Number = 0,
    feet: Pair = (0, 0),
    numbered: bool = False,
) -> LabelledMesh:
    """A box with rounded edges, closed by a lid or open, with the fittings of a machine's housing.

    Args:
        at: Lowest corner of the shell.
        size: Of the shell.
        wall: Thickness of the shell's walls and floor, of the fins and of the lid.
        corner: Outer radius of the shell's vertical edges.
        posts: Radius of the four screw posts in the corners and of their holes; 0: none.
        lid: How far the lid stands out over the shell on all sides; 0: no lid.
        lid_opening: Radius of the hole in the middle of the lid.
        boss: Radius and height of the boss round that hole; 0: none.
        shaft: Outer radius of the bearing rings in the two sides across x, and of their holes; 0: none.
        vents: How many slots in the side of lowest y.
        fins: x of the lower side of each cooling fin, outside the side of lowest y.
        fin: How far the fins stand out.
        feet: Radius of the four mounting lugs at the bottom and of their holes; 0: none.
        numbered: Whether each post, hole, ring, vent, fin and foot is a part of its own.
    """
    (x0, y0, z0), (length, depth, height) = at, size
    x, y, top, far = x0 + length / 2, y0 + depth / 2, z0 + height, (x0 + length, y0 + depth, z0 + height)
    part = Construction()
    part.add("shell", plate(at, far, corner))
    lugs = list(product((x0 + 2 * corner, far[0] - 2 * corner), (y0 - feet[0] / 2, far[1] + feet[0] / 2)))
    if feet[0]:
        ears = (_lug(place, y, z0 - 1, 1.5 * wall, feet[0]) for place in lugs)
        part.add_each("foot", ears, numbered=numbered)
        part.cut_each("foot hole", (rod((*p, z0 - 2), 2 * wall + 2, feet[1]) for p in lugs), numbered=numbered)
    sheets = (box((x0 + a, y0 - fin, z0 + 2 * wall), (x0 + a + wall, y0 + wall / 2, top - 2 * wall)) for a in fins)
    part.add_each("fin", sheets, numbered=numbered)
    sides = ((x0 - wall, length / 2), (x, length / 2 + wall))
    if shaft[0]:
        rings = (rod((a, y, z0 + height / 2), reach, shaft[0], turn=ALONG_X) for a, reach in sides)
        part.add_each("bearing ring", rings, numbered=numbered)
    part.cut("cavity", plate((x0 + wall, y0 + wall, z0 + wall), (far[0] - wall, far[1] - wall, top + 1), corner - wall))
    inset = max(corner - 0.7 * max(corner - wall / 2 - posts[0], 0), posts[0] + wall / 2)  # inside the shell's corner
    corners = list(product((x0 + inset, far[0] - inset), (y0 + inset, far[1] - inset)))
    if posts[0]:
        stems = (rod((*place, z0 + wall / 2), height - 1.5 * wall, posts[0]) for place in corners)
        part.add_each("post", stems, numbered=numbered)
    if lid:
        cover = ((x0 - lid, y0 - lid, top - wall / 2), (far[0] + lid, far[1] + lid, top + wall / 2))
        part.add("lid", plate(*cover, corner + lid))
    if boss[0]:
        part.add("boss", rod((x, y, top), boss[1], boss[0]))
    if lid_opening:
        part.cut("lid opening", rod((x, y, top - wall), boss[1] + 2 * wall, lid_opening))
    if posts[0]:
        screws = (rod((*place, z0 + 3 * wall), height, posts[1]) for place in corners)
        part.cut_each("screw hole", screws, numbered=numbered)
    if shaft[0]:
        bores = (rod((a - 1, y, z0 + height / 2), reach + 2, shaft[1], turn=ALONG_X) for a, reach in sides)
        part.cut_each("bearing bore", bores, numbered=numbered)
    pitch = (length - 4 * corner) / max(vents - 1, 1)
    starts = ((x0 + 2 * corner + pitch * k, y0 - 1, z0 + 0.3 * height) for k in range(vents))
    gills = (slot(start, (0, 0, 0.4 * height), wall + 2, wall, turn=(-90, 0, 0)) for start in starts)
    part.cut_each("vent", gills, numbered=numbered)
    return part.mesh()


def _lug(place: Pair, inwards: Number, bottom: Number, thickness: Number, radius: Number) -> Manifold:
    """A mounting lug: a round end at `place` and a tongue towards y = `inwards`, a third of the way."""
    x, y = place
    tip = rod((x, y, bottom), thickness, radius)
    return Manifold.batch_hull([tip, rod((x, y + (inwards - y) / 3, bottom), thickness, radius)])


HOUSINGS = (
    partial(housing, at=(20, 16, 5), size=(110, 78, 52), wall=3.2, corner=12, posts=(6, 2.4), feet=(8, 3.2)),
    partial(
        housing, at=(6, 24, 14), size=(84, 84, 70), wall=3, corner=14, lid=5, lid_opening=14, boss=(21, 12),
        shaft=(19, 13),
    ),
    partial(
        housing, at=(32, 40, 3), size=(140, 90, 48), wall=4, corner=10, posts=(8, 3), fins=tuple(range(22, 118, 12)),
        fin=18,
    ),
    partial(
        housing, at=(12, 18, 9), size=(96, 70, 60), wall=3, corner=9, posts=(6.5, 2.5), vents=6,
        numbered=True,
    ),
    partial(
        housing, at=(50, 26, 30), size=(130, 64, 80), wall=3.6, corner=16, lid=6, lid_opening=17, posts=(0, 0), vents=6,
        shaft=(22, 16), feet=(9, 3.5),
    ),
)  # fmt: skip
