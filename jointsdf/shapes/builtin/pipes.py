"""Pipe fittings: tees, crosses and elbows with flanged arms, and flanges with a welding neck."""

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

from manifold3d import CrossSection, Manifold

from jointsdf.shapes.builtin.construction import SEGMENTS, Construction, Number, Point, around, rod, tube
from jointsdf.values import LabelledMesh

TOWARDS: dict[str, Point] = {
    "+x": (0, 90, 0), "-x": (0, -90, 0), "+y": (-90, 0, 0), "-y": (90, 0, 0), "+z": (0, 0, 0), "-z": (180, 0, 0),
}  # fmt: skip


class Flange(NamedTuple):
    """A bolted flange at the end of a pipe.

    Attributes:
        radius: Of the disc.
        thickness: Of the disc.
        bolts: How many holes.
        bolt: Their radius.
    """

    radius: Number
    thickness: Number
    bolts: int
    bolt: Number

    def disc(self, end: Number) -> Manifold:
        """The disc on the z axis, its outer face at height `end`."""
        return rod((0, 0, end - self.thickness), self.thickness, self.radius)

    def holes(self, end: Number, pipe: Number) -> Manifold:
        """The bolt holes of that disc, half-way between the pipe's outer radius and the rim."""
        places = around(self.bolts, (pipe + self.radius) / 2, phase=180 / self.bolts)
        rods = [rod((*place, end - self.thickness - 1), self.thickness + 2, self.bolt) for place in places]
        return sum(rods[1:], start=rods[0])


def pipe_fitting(
    *,
    at: Point,
    arms: Sequence[tuple[str, Number]],
    radius: Number,
    wall: Number,
    flange: Flange,
    ball: Number = 0,
    numbered: bool = False,
) -> LabelledMesh:
    """Pipes that meet in one point, each with a flange at its end: tee, cross, or corner.

    Args:
        at: Where the pipes meet.
        arms: Direction (`+x`, `-z`, ..) and length of each pipe.
        radius: Outer, of the pipes.
        wall: Their thickness.
        flange: At the end of each.
        ball: Outer radius of the hollow ball in the middle; 0: none.
        numbered: Whether each pipe, flange, bore and circle of bolt holes is a part of its own.
    """
    part = Construction()
    pipes = (rod((0, 0, 0), length - 1, radius).rotate(TOWARDS[way]).translate(at) for way, length in arms)
    part.add_each("pipe", pipes, numbered=numbered)
    if ball:
        part.add("ball", Manifold.sphere(ball, SEGMENTS).translate(at))
    discs = (flange.disc(length).rotate(TOWARDS[way]).translate(at) for way, length in arms)
    part.add_each("flange", discs, numbered=numbered)
    bores = (rod((0, 0, 0), length + 1, radius - wall).rotate(TOWARDS[way]).translate(at) for way, length in arms)
    inner = [Manifold.sphere(ball - wall if ball else radius - wall, SEGMENTS).translate(at)]
    if ball:
        part.cut("chamber", *inner)
    part.cut_each("bore", bores if ball else [first + inner[0] for first in bores], numbered=numbered)
    holes = (flange.holes(length, radius).rotate(TOWARDS[way]).translate(at) for way, length in arms)
    part.cut_each("bolt holes", holes, numbered=numbered)
    return part.mesh()


def pipe_elbow(
    *, at: Point, bend: Number, radius: Number, wall: Number, arm: Number, flange: Flange, boss: Point = (0, 0, 0)
) -> LabelledMesh:
    """A right-angled bend in the xz plane with a flanged pipe at either end, and a gauge boss on top.

    Args:
        at: Middle of the bend's circle.
        bend: Radius of the pipe's centre line.
        radius: Outer, of the pipe.
        wall: Its thickness.
        arm: Length of the straight pipes, flanges included.
        flange: At either end.
        boss: Radius, bore radius and height above the centre line of the boss in the bend's middle; 0: none.
    """
    x, y, z = at
    frames = (((x + bend, y, z), (180, 0, 0)), ((x, y, z + bend), (0, -90, 0)))  # the two ends, pointing away
    part = Construction()
    part.add("bend", _quarter(bend, radius).translate(at))
    part.add("pipe", *(rod(end, arm - 1, radius, turn=turn) for end, turn in frames))
    part.add("flange", *(flange.disc(arm).rotate(turn).translate(end) for end, turn in frames))
    middle = (x + 0.707 * bend, y, z + 0.707 * bend)
    if boss[0]:
        part.add("boss", rod(middle, boss[2], boss[0]))
    swept = _quarter(bend, radius - wall).translate(at)
    part.cut("bore", swept, *(rod(end, arm + 1, radius - wall, turn=turn) for end, turn in frames))
    if boss[0]:
        part.cut("gauge bore", rod(middle, boss[2] + 1, boss[1]))
    part.cut("bolt holes", *(flange.holes(arm, radius).rotate(turn).translate(end) for end, turn in frames))
    return part.mesh()


def neck_flange(
    *,
    at: Point,
    flange: Flange,
    face: tuple[Number, Number],
    neck: tuple[Number, Number, Number],
    bore: Number,
    groove: Number = 0,
) -> LabelledMesh:
    """A flange with a raised face below and a welding neck above: a cone that ends in a pipe.

    Args:
        at: Middle of the flange's lower side.
        flange: The disc with its bolt holes.
        face: Radius and height of the raised face below.
        neck: Radius of the cone at the flange, of the pipe, and height of cone plus pipe (60% cone).
        bore: Radius.
        groove: Width of the ring groove in the raised face; 0: none.
    """
    x, y, z = at
    top, cone = flange.thickness, 0.6 * neck[2]
    part = Construction()
    part.add("disc", flange.disc(top).translate(at))
    part.add("raised face", rod((x, y, z - face[1]), face[1] + 1, face[0]))
    part.add("neck", rod((x, y, z + top), cone, neck[0], neck[1]))
    part.add("pipe", rod((x, y, z + top + cone), neck[2] - cone, neck[1]))
    part.cut("bore", rod((x, y, z - face[1] - 1), face[1] + top + neck[2] + 2, bore))
    if groove:
        middle = (bore + face[0]) / 2
        part.cut("groove", tube((x, y, z - face[1] - 1), 1 + 1.2 * face[1], middle + groove / 2, middle - groove / 2))
    part.cut("bolt hole", flange.holes(top, neck[0]).translate(at))
    return part.mesh()


def _quarter(bend: Number, radius: Number) -> Manifold:
    """A quarter of a torus about the y axis, from +x to +z."""
    circle = CrossSection.circle(radius, SEGMENTS).translate((bend, 0))
    return Manifold.revolve(circle, SEGMENTS // 4, 90.0).rotate((90.0, 0.0, 0.0))


PIPES = (
    partial(
        pipe_fitting, at=(70, 40, 40), arms=(("-x", 60), ("+x", 60), ("+z", 52)), radius=22, wall=3.6,
        flange=Flange(35, 7, 4, 4),
    ),
    partial(pipe_elbow, at=(50, 45, 60), bend=44, radius=20, wall=3.4, arm=24, flange=Flange(33, 7, 6, 3.5)),
    partial(
        neck_flange, at=(60, 72, 6), flange=Flange(56, 14, 8, 5.5), face=(36, 3), neck=(34, 24, 34), bore=19, groove=4,
    ),
    partial(
        pipe_fitting, at=(66, 80, 64), arms=(("-x", 60), ("+x", 60), ("+z", 56), ("-y", 62)), radius=19, wall=4,
        flange=Flange(31, 8, 5, 4), ball=30, numbered=True,
    ),
    partial(
        pipe_elbow, at=(72, 64, 80), bend=60, radius=27, wall=4.2, arm=30, flange=Flange(44, 9, 8, 4.5),
        boss=(16, 9, 56),
    ),
)  # fmt: skip
