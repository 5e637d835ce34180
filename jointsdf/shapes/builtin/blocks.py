"""Hydraulic manifold blocks: bores that cross inside, wider ports, mounting holes."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import NamedTuple

from manifold3d import Manifold

from jointsdf.shapes.builtin.construction import ALONG_X, ALONG_Y, Construction, Number, Point, box, plate, rod
from jointsdf.values import LabelledMesh

TURNS: dict[str, Point] = {"x": ALONG_X, "y": ALONG_Y, "z": (0.0, 0.0, 0.0)}


class Drill(NamedTuple):
    """A straight cylinder.

    Attributes:
        axis: `x`, `y` or `z`.
        start: Middle of its lower end, relative to the block.
        length: Along the axis.
        radius: Of the cylinder.
    """

    axis: str
    start: Point
    length: Number
    radius: Number


VALVE_BORES = {
    "main bore": (Drill("x", (-1, 27, 24), 76, 8),),
    "cross bore": (Drill("y", (24, -1, 24), 56, 6), Drill("z", (54, 27, 16), 33, 6)),
    "port": (
        Drill("x", (-1, 27, 24), 9, 13), Drill("y", (24, -1, 24), 9, 10), Drill("y", (24, 46, 24), 9, 10),
        Drill("z", (54, 27, 40), 9, 10),
    ),
}  # fmt: skip


def manifold_block(
    *,
    at: Point = (12, 8, 4),
    size: Point = (84, 54, 48),
    corner: Number = 0,
    bores: Mapping[str, Sequence[Drill]] = VALVE_BORES,
    bosses: Mapping[str, Sequence[Drill]] | None = None,
    mounting: Point = (8, 7, 3.5),
    snap: bool = True,
) -> LabelledMesh:
    """A hydraulic block: bosses on it, bores that may cross, mounting holes from top to bottom.

    Args:
        at: Lowest corner.
        size: Of the block.
        corner: Radius of the vertical edges; 0: sharp.
        bores: Cylinders drilled for each part.
        bosses: Cylinders added to the block for each part, before drilling.
        mounting: Inset of the four holes along x and y, and their radius; radius 0: none.
        snap: Whether coordinates are put on a grid, see `Construction`.
    """
    x0, y0, z0 = at
    far = (x0 + size[0], y0 + size[1], z0 + size[2])
    part = Construction(snap=snap)
    part.add("block", plate(at, far, corner) if corner else box(at, far))
    for name, drills in (bosses or {}).items():
        part.add(name, *(_cylinder(drill, at) for drill in drills))
    for name, drills in bores.items():
        part.cut(name, *(_cylinder(drill, at) for drill in drills))
    inset_x, inset_y, radius = mounting
    if radius:
        places = [(x, y) for x in (x0 + inset_x, far[0] - inset_x) for y in (y0 + inset_y, far[1] - inset_y)]
        part.cut("mounting hole", *(rod((*place, z0 - 1), size[2] + 2, radius) for place in places))
    return part.mesh()


def _cylinder(drill: Drill, at: Point) -> Manifold:
    """The cylinder of a drill, in the file frame."""
    x, y, z = (a + b for a, b in zip(at, drill.start, strict=True))
    return rod((x, y, z), drill.length, drill.radius, turn=TURNS[drill.axis])


def valve_row(count: int, pitch: Number, first: Number, depth: Number, top: Number) -> dict[str, tuple[Drill, ...]]:
    """The bores of a row of valves: a pressure and a tank gallery along x, and for each valve a stepped seat on top.

    Args:
        count: Of valves.
        pitch: Between them, along x.
        first: x of the first.
        depth: Of the block, along y.
        top: Height of the block.
    """
    length = 2 * first + pitch * (count - 1)
    places = [first + pitch * k for k in range(count)]
    bores = {
        "pressure gallery": (Drill("x", (-1, 0.42 * depth, 0.3 * top), length + 2, 7),),
        "tank gallery": (Drill("x", (-1, 0.8 * depth, 0.3 * top), length - 8, 5),),
        "gallery port": (
            Drill("x", (-1, 0.42 * depth, 0.3 * top), 9, 11),
            Drill("x", (-1, 0.8 * depth, 0.3 * top), 9, 8),
        ),
    }
    for number, x in enumerate(places, start=1):
        bores[f"valve bore {number}"] = (Drill("z", (x, 0.42 * depth, 0.3 * top), top, 6),)
        bores[f"valve seat {number}"] = (Drill("z", (x, 0.42 * depth, 0.72 * top), top, 10),)
        bores[f"work port {number}"] = (Drill("y", (x, -1, 0.52 * top), 0.42 * depth, 5),)
    return bores


BLOCKS = (
    partial(manifold_block, snap=False),
    partial(
        manifold_block, at=(4, 30, 16), size=(60, 60, 70), corner=8, mounting=(0, 0, 0),
        bores={"valve bore": (Drill("z", (30, 30, 12), 60, 13),), "work port": (Drill("y", (30, -1, 26), 62, 7),)},
    ),
    partial(
        manifold_block, at=(9, 12, 22), size=(176, 62, 54), mounting=(7, 7, 3.5), bores=valve_row(4, 40, 28, 62, 54),
    ),
    partial(
        manifold_block, at=(33, 6, 5), size=(90, 74, 38), corner=6, mounting=(10, 10, 4.5),
        bosses={"inlet boss": (Drill("x", (88, 37, 19), 20, 15),), "outlet boss": (Drill("z", (28, 37, 36), 22, 17),)},
        bores={
            "inlet bore": (Drill("x", (20, 37, 19), 90, 8),), "outlet bore": (Drill("z", (28, 37, 19), 40, 9),),
            "inlet thread": (Drill("x", (96, 37, 19), 14, 11),), "outlet thread": (Drill("z", (28, 37, 46), 14, 12),),
            "drain": (Drill("y", (60, -1, 19), 39, 5),),
        },
    ),
    partial(
        manifold_block, at=(18, 50, 2), size=(120, 44, 44), mounting=(0, 0, 0),
        bores={
            "main bore": (Drill("x", (-1, 22, 22), 122, 10),), "end port": (Drill("x", (-1, 22, 22), 13, 14),),
            "far port": (Drill("x", (108, 22, 22), 13, 14),), "gauge port": (Drill("y", (60, -1, 22), 24, 6),),
            **{f"outlet {k + 1}": (Drill("z", (24 + 24 * k, 22, 22), 24, 7),) for k in range(4)},
            **{f"side screw {k + 1}": (Drill("y", (36 + 48 * k, -1, 8), 46, 3.5),) for k in range(2)},
        },
    ),
)  # fmt: skip
