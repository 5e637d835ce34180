"""Built-in benchmark of 50 CAD parts made by code, `part_01` to `part_50`: ten families of five sizes.

A part is a function that grows a `Construction` and returns its mesh, with its dimensions (millimetres) as keywords. To
add a family: a file like `gears.py`, with a tuple of `partial`s, and its line in `FAMILIES`.
The first six parts have the coordinates that they were first measured with (`snap=False`).
"""

from collections.abc import Callable

from jointsdf.shapes.builtin.angles import ANGLES
from jointsdf.shapes.builtin.bearings import BEARINGS
from jointsdf.shapes.builtin.blocks import BLOCKS
from jointsdf.shapes.builtin.gears import GEARS
from jointsdf.shapes.builtin.housings import HOUSINGS
from jointsdf.shapes.builtin.links import LINKS
from jointsdf.shapes.builtin.pipes import PIPES
from jointsdf.shapes.builtin.pulleys import PULLEYS
from jointsdf.shapes.builtin.shafts import SHAFTS
from jointsdf.shapes.builtin.trays import TRAYS
from jointsdf.values import LabelledMesh

FAMILIES = (BEARINGS, SHAFTS, PULLEYS, ANGLES, TRAYS, BLOCKS, GEARS, PIPES, HOUSINGS, LINKS)


BUILTINS: dict[str, Callable[[], LabelledMesh]] = {
    f"part_{row * len(FAMILIES) + column:02d}": build
    for row in range(len(BEARINGS))
    for column, build in enumerate((family[row] for family in FAMILIES), start=1)
}


def part_names() -> list[str]:
    """The names of the built-in parts."""
    return list(BUILTINS)
