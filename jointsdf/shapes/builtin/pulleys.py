"""Belt pulleys: a grooved rim, a recessed web with openings, a keyed hub."""

from collections.abc import Sequence
from functools import partial

from jointsdf.shapes.builtin.construction import ALONG_X, Construction, Number, Pair, Point, around, box, ring, rod
from jointsdf.values import LabelledMesh


def pulley(
    *,
    at: Point = (60, 55, 5),
    radius: Number = 48,
    width: Number = 26,
    grooves: Sequence[Number] = (13,),
    groove: Point = (12, 3.5, 8.5),
    recess: Pair = (30, 9),
    hub: Pair = (15, 4),
    openings: int = 5,
    opening: Number = 5,
    bore: Number = 8,
    key: Pair = (3, 2.5),
    set_screw: Number = 0,
    numbered: bool = False,
    snap: bool = True,
) -> LabelledMesh:
    """A V-belt pulley: rim with grooves, recessed web with openings, hub with keyed bore.

    Args:
        at: Middle of the rim's lower side; the axis is z.
        radius: Of the rim.
        width: Of the rim.
        grooves: Height of the middle of each groove above `at`.
        groove: Depth, half width at the floor, half width just outside the rim.
        recess: Outer radius and depth of the recess on either side; depth 0: none.
        hub: Radius, and how far it stands out on either side.
        openings: How many in the web.
        opening: Their radius.
        bore: Radius.
        key: Half width and depth of the key way.
        set_screw: Radius of the hole through the upper end of the hub, along x; 0: none.
        numbered: Whether each groove and opening is a part of its own.
        snap: Whether coordinates are put on a grid, see `Construction`.
    """
    x, y, z = at
    depth, floor, mouth = groove
    part = Construction(snap=snap)
    part.add("rim", rod(at, width, radius))
    lowest, outside = radius - depth, radius + 1
    edge = floor + (mouth - floor) * depth / (depth + 1)
    flank = [(lowest, floor), *([(radius, edge)] if snap else []), (outside, mouth)]  # on the grid, no corner: slivers
    profiles = ([(r, h - half) for r, half in flank] + [(r, h + half) for r, half in reversed(flank)] for h in grooves)
    part.cut_each("groove", (ring(profile).translate(at) for profile in profiles), numbered=numbered)
    if recess[1]:
        inner, outer, deep = hub[0] - 5, recess[0], recess[1] + 1
        starts = (-1, width - recess[1])
        sides = ([(inner, low), (outer, low), (outer, low + deep), (inner, low + deep)] for low in starts)
        part.cut("recess", *(ring(side).translate(at) for side in sides))
    part.add("hub", rod((x, y, z - hub[1]), width + 2 * hub[1], hub[0]))
    low, through = z - hub[1] - 1, width + 2 * hub[1] + 6
    places = around(openings, (hub[0] + recess[0]) / 2, (x, y)) if openings else []
    part.cut_each("opening", (rod((*place, low), through, opening) for place in places), numbered=numbered)
    key_way = box((x - key[0], y, low), (x + key[0], y + bore + key[1], low + through))
    part.cut("bore", rod((x, y, low), through, bore), key_way)
    if set_screw:
        part.cut("set screw", rod((x, y, z + width + hub[1] / 2), hub[0] + 1, set_screw, turn=ALONG_X))
    return part.mesh()


PULLEYS = (
    partial(pulley, snap=False),
    partial(
        pulley, at=(35, 32, 12), radius=28, width=14, grooves=(7,), groove=(6, 2, 5), recess=(0, 0), hub=(13, 9),
        openings=0, bore=6, key=(2, 2), set_screw=2.5,
    ),
    partial(
        pulley, at=(90, 84, 14), radius=72, width=64, grooves=(12, 32, 52), groove=(13, 3.5, 8.5), recess=(52, 22),
        hub=(24, 6), openings=6, opening=10, bore=14, key=(4, 3.5), numbered=True,
    ),
    partial(
        pulley, at=(110, 100, 20), radius=95, width=30, grooves=(15,), groove=(14, 4, 9), recess=(76, 10), hub=(26, 10),
        openings=8, opening=17, bore=15, key=(4, 3.5), set_screw=4,
    ),
    partial(
        pulley, at=(52, 60, 9), radius=40, width=54, grooves=tuple(range(7, 48, 10)), groove=(5, 1.6, 4.2),
        recess=(0, 0), hub=(18, 7), openings=0, bore=9, key=(3, 2.5), numbered=True,
    ),
)  # fmt: skip
