"""Tables of a PLY file: each property of an element as an array."""

from dataclasses import dataclass, field
from pathlib import Path

from jaxtyping import Int, Shaped
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.shapes.readers.ply_header import Element

PLURALS = {"vertex": "vertices", "face": "faces", "edge": "edges"}


@dataclass(frozen=True)
class Lists:
    """A list property.

    Attributes:
        values: Numbers of all rows, one row after another.
        sizes: How many each row has.
    """

    values: Shaped[ndarray, " n"]
    sizes: Int[ndarray, " r"]


@dataclass(frozen=True)
class Table:
    """The rows of an element.

    Attributes:
        scalars: Numbers of the scalar properties, by name.
        lists: Of the list properties.
    """

    scalars: dict[str, Shaped[ndarray, " r"]] = field(default_factory=dict)
    lists: dict[str, Lists] = field(default_factory=dict)


def truncated(path: Path, element: Element, held: int) -> InputError:
    """The error of a file that ends within a table, whose `held` first rows are whole."""
    what = PLURALS.get(element.name, f"rows of {element.name}")
    return InputError(f"{path} is truncated: it declares {element.rows} {what} and holds {held}; export it again")
