"""Spur gears: blanks whose involute tooth gaps are cut one by one."""

from functools import partial
from math import acos, cos, pi, radians, sin, sqrt, tan

from manifold3d import Manifold

from jointsdf.shapes.builtin.construction import Construction, Number, Pair, Point, around, box, ring, rod, slab_xy
from jointsdf.values import LabelledMesh

PRESSURE_ANGLE = radians(20)
FLANK_POINTS = 8


def gear(
    *,
    at: Point,
    module: Number,
    teeth: int,
    width: Number,
    bore: Number,
    recess: Pair = (0, 0),
    hub: Pair = (0, 0),
    openings: int = 0,
    opening: Number = 0,
    key: Pair = (0, 0),
    pinion: tuple[int, Number] = (0, 0),
    numbered: bool = False,
) -> LabelledMesh:
    """A spur gear: toothed blank, recessed web with openings, hub, keyed bore, and a smaller gear on top.

    Args:
        at: Middle of the blank's lower side; the axis is z.
        module: Pitch diameter by number of teeth.
        teeth: How many.
        width: Of the toothed blank.
        bore: Radius.
        recess: Outer radius and depth of the recess on either side; depth 0: none.
        hub: Radius, and how far it stands out on either side; radius 0: none.
        openings: How many in the web.
        opening: Their radius.
        key: Half width and depth of the key way; half width 0: none.
        pinion: Teeth and width of the smaller gear of the same module on top; 0: none.
        numbered: Whether each tooth gap is a part of its own.
    """
    x, y, z = at
    part = Construction()
    part.add("blank", _blank(module, teeth, width).translate(at))
    part.cut_each("tooth gap", (gap.translate(at) for gap in tooth_gaps(module, teeth, width)), numbered=numbered)
    if recess[1]:
        inner, outer, deep = hub[0] - 3, recess[0], recess[1] + 1
        sides = (
            [(inner, low), (outer, low), (outer, low + deep), (inner, low + deep)] for low in (-1, width - deep + 1)
        )
        part.cut("recess", *(ring(side).translate(at) for side in sides))
    low, high = z - hub[1] - 1, z + width + hub[1] + 1
    if hub[0]:
        part.add("hub", rod((x, y, z - hub[1]), width + 2 * hub[1], hub[0]))
    if pinion[0]:
        top = (x, y, z + width - 1)
        part.add("pinion", _blank(module, pinion[0], pinion[1] + 1).translate(top))
        gaps = (gap.translate((x, y, z + width + 2)) for gap in tooth_gaps(module, pinion[0], pinion[1]))
        part.cut("pinion gap", *gaps)
        high += pinion[1]
    if openings:
        places = around(openings, (hub[0] + recess[0]) / 2, (x, y))
        part.cut("opening", *(rod((*place, low), width + 2 * hub[1] + 2, opening) for place in places))
    part.cut("bore", rod((x, y, low), high - low, bore))
    if key[0]:
        part.cut("key way", box((x - key[0], y, low), (x + key[0], y + bore + key[1], high)))
    return part.mesh()


def tooth_gaps(module: Number, teeth: int, width: Number) -> list[Manifold]:
    """The gaps between the teeth of a gear about the z axis, from z = 0 up and beyond `width`."""
    root, tip = module * (teeth / 2 - 1.25), module * (teeth / 2 + 1)
    radii = [root + (tip - root) * k / (FLANK_POINTS - 1) for k in range(FLANK_POINTS)]
    flank = [(radius, pi / teeth - _tooth_half_angle(radius, module, teeth)) for radius in radii]
    flank.append((1.2 * tip, flank[-1][1]))
    outline = [(r * cos(angle), r * sin(angle)) for r, angle in flank]
    gap = slab_xy([*((px, -py) for px, py in outline), *reversed(outline)], -1, width + 1)
    return [gap.rotate((0, 0, 360 / teeth * k)) for k in range(teeth)]


def _blank(module: Number, teeth: int, width: Number) -> Manifold:
    """The turned blank, its edges chamfered down to half a module."""
    tip, edge = module * (teeth / 2 + 1), 0.4 * module
    return ring([(0, 0), (tip - edge, 0), (tip, edge), (tip, width - edge), (tip - edge, width), (0, width)])


def _tooth_half_angle(radius: Number, module: Number, teeth: int) -> float:
    """Half the angle (radians) that a tooth with involute flanks takes at a radius."""
    base = module * teeth / 2 * cos(PRESSURE_ANGLE)
    roll = sqrt(max(radius * radius / (base * base) - 1, 0.0))  # tangent of the pressure angle at this radius
    at_pitch = pi / (2 * teeth) + tan(PRESSURE_ANGLE) - PRESSURE_ANGLE
    return at_pitch - (roll - acos(1 / sqrt(1 + roll * roll)))


GEARS = (
    partial(gear, at=(44, 50, 11), module=3, teeth=24, width=18, bore=9, recess=(30, 5), hub=(16, 6), key=(3, 2.5)),
    partial(gear, at=(36, 33, 3), module=4, teeth=14, width=16, bore=8, numbered=True),
    partial(
        gear, at=(90, 80, 16), module=4, teeth=36, width=24, bore=13, recess=(60, 8), hub=(24, 8), openings=6,
        opening=12, key=(4, 3),
    ),
    partial(gear, at=(58, 62, 5), module=2.5, teeth=40, width=13, bore=8, pinion=(18, 22), key=(2.5, 2)),
    partial(gear, at=(30, 28, 24), module=4, teeth=12, width=40, bore=7, hub=(13, 14), numbered=True),
)  # fmt: skip
