"""Stepped shafts: diameters along x with key slots, grooves, splines, flats and holes."""

from collections.abc import Sequence
from functools import partial

from manifold3d import Manifold

from jointsdf.shapes.builtin.construction import ALONG_X, Construction, Number, Pair, Point, box, rod, tube
from jointsdf.values import LabelledMesh

OVERLAP = 1  # of each step with the one before
Step = tuple[str, Number, Number] | tuple[str, Number, Number, Number]

DRIVE_SHAFT: tuple[Step, ...] = (
    ("drive end", 32, 11), ("seat", 44, 16), ("collar", 10, 24), ("journal", 26, 13), ("tip", 10, 13, 8),
)  # fmt: skip


def stepped_shaft(
    *,
    at: Point = (5, 40, 30),
    steps: Sequence[Step] = DRIVE_SHAFT,
    key_slots: Sequence[tuple[Number, Number, Number, Number]] = ((41, 22, 4, 9),),
    slot_depth: Number = 11,
    centre_hole: Pair = (16, 5),
    grooves: Sequence[Point] = (),
    flats: Sequence[Point] = (),
    cross_holes: Sequence[Pair] = (),
    splines: int = 0,
    spline: Point = (0, 0, 0),
    snap: bool = True,
) -> LabelledMesh:
    """A shaft of several diameters along x. Offsets are along the axis, from `at`.

    Args:
        at: Start of the axis.
        steps: Part, length and radius (and radius at the end, for a cone) of each step; each overlaps the one before.
        key_slots: Offset, length, half width and height above the axis of each slot's floor.
        slot_depth: How far above its floor a key slot's cutter reaches.
        centre_hole: Depth and radius at the start; depth 0: none.
        grooves: Offset, width and radius of the floor of each ring groove.
        flats: Offset, length and height above the axis of each pair of flats.
        cross_holes: Offset and radius of each hole across the axis, along y.
        splines: How many grooves along the axis, round it.
        spline: Their offset, length and height of the floor above the axis.
        snap: Whether coordinates are put on a grid, see `Construction`.
    """
    x0, y, z = at
    largest = max(radius for _, _, *radii in steps for radius in radii)
    part = Construction(snap=snap)
    end = x0 + OVERLAP
    for name, length, *radii in steps:
        top = radii[1] if len(radii) > 1 else -1
        part.add(name, rod((end - OVERLAP, y, z), length, radii[0], top, turn=ALONG_X))
        end += length - OVERLAP
    for offset, length, half, height in key_slots:
        start, low = x0 + offset, z + height
        block = box((start, y - half, low), (start + length, y + half, low + slot_depth))
        ends = (rod((x, y, low), slot_depth, half) for x in (start, start + length))
        part.cut("key slot", block, *ends)
    if centre_hole[0]:
        part.cut("centre hole", rod((x0 - 1, y, z), centre_hole[0] + 1, centre_hole[1], turn=ALONG_X))
    for offset, width, radius in grooves:
        part.cut("groove", tube((x0 + offset, y, z), width, largest + 1, radius, turn=ALONG_X))
    for offset, length, height in flats:
        half = box((x0 + offset, y - largest - 1, z + height), (x0 + offset + length, y + largest + 1, z + largest + 1))
        other = box(
            (x0 + offset, y - largest - 1, z - largest - 1), (x0 + offset + length, y + largest + 1, z - height)
        )
        part.cut("flat", half, other)
    for offset, radius in cross_holes:
        part.cut("cross hole", rod((x0 + offset, y - largest - 1, z), 2 * largest + 2, radius, turn=(-90, 0, 0)))
    if splines:
        part.cut("spline", *(groove.translate(at) for groove in _spline_grooves(splines, spline, largest)))
    return part.mesh()


def _spline_grooves(count: int, groove: Point, largest: Number) -> list[Manifold]:
    """The grooves of a spline round the x axis, each as wide as the rib beside it."""
    offset, length, height = groove
    half = height * 3.14 / count / 2
    tool = box((offset, -half, height), (offset + length, half, largest + 2))
    return [tool.rotate((360 / count * k, 0, 0)) for k in range(count)]


SHAFTS = (
    partial(stepped_shaft, snap=False),
    partial(
        stepped_shaft, at=(2, 18, 22), centre_hole=(0, 0), key_slots=(), flats=((4, 16, 5.5),),
        steps=(("flat end", 26, 8), ("body", 130, 12)),
    ),
    partial(
        stepped_shaft, at=(20, 60, 35), centre_hole=(22, 6), splines=10, spline=(-1, 40, 15.5),
        key_slots=((128, 30, 5, 15),), slot_depth=14, grooves=((49, 3, 15), (192, 3, 12)),
        steps=(
            ("chamfer", 3, 15, 18), ("spline end", 44, 18), ("bearing seat", 25, 21), ("shoulder", 9, 31),
            ("gear seat", 78, 22), ("cone", 16, 22, 16), ("rear journal", 32, 15), ("nose", 7, 15, 11),
        ),
    ),
    partial(
        stepped_shaft, at=(9, 70, 80), centre_hole=(24, 9), key_slots=((12, 20, 5, 13), (166, 20, 5, 13)),
        slot_depth=12, cross_holes=((104, 7),), grooves=((49, 3, 15), (155, 3, 15)),
        steps=(
            ("left chamfer", 4, 15, 18), ("left end", 44, 18), ("left cone", 12, 18, 24), ("left journal", 20, 24),
            ("left collar", 8, 36), ("left waist", 16, 27), ("middle", 22, 32), ("right waist", 16, 27),
            ("right collar", 8, 36), ("right journal", 20, 24), ("right cone", 12, 24, 18), ("right end", 44, 18),
            ("right chamfer", 4, 18, 15),
        ),
    ),
    partial(
        stepped_shaft, at=(40, 24, 30), centre_hole=(9, 3), key_slots=(), cross_holes=((97, 3),),
        grooves=((36, 2.5, 7),), flats=((54, 24, 9.5),),
        steps=(("pilot", 12, 6), ("seat", 30, 9), ("head", 9, 20), ("grip", 44, 12), ("tail", 14, 8), ("tip", 6, 8, 5)),
    ),
)  # fmt: skip
