"""Columns of a mesh file's faces as labels: which there are, and which of them are parts."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from jointsdf.errors import InputError
from jointsdf.shapes.labels.ids import check_ids
from jointsdf.shapes.readers.face_columns import COLOUR
from jointsdf.shapes.readers.file_mesh import OWN_LABELS, FaceColumn, FileMesh
from jointsdf.shapes.readers.mesh_file import read_mesh
from jointsdf.user_paths import expand_home
from jointsdf.values import LabelledMesh

PARTS = {  # columns that may be parts, with the word for several
    "group": "groups", "object": "objects", "node": "nodes", "solid": "solids", "body": "bodies",
    "material": "materials", COLOUR: "colours",
}  # fmt: skip
FACE = "face"  # of a STEP file
MOST_PARTS = 64  # values of a column that may be parts


def split_column(labels: str) -> tuple[Path, str | None] | None:
    """Split `<file>` or `<file>:<column>` where the file exists; a file whose own name has a colon comes first.

    Returns:
        The file, and the column if one is named; None where there is no such file.
    """
    if (path := Path(expand_home(labels))).is_file():
        return path, None
    ends = [place for place, letter in enumerate(labels) if letter == ":" and 0 < place < len(labels) - 1]
    for end in reversed(ends):
        if (path := Path(expand_home(labels[:end]))).is_file():
            return path, labels[end + 1 :]
    return None


def find_column(source: str, mesh: FileMesh, name: str) -> FaceColumn:
    """Find a column by its name.

    Raises:
        InputError: There is none of this name; those that there are are listed.
    """
    if name not in mesh.columns:
        raise InputError(f"{source} has no column {name!r} of its faces: {_list_columns(mesh, mesh.columns)}")
    return mesh.columns[name]


def choose_column(source: str, mesh: FileMesh) -> str:
    """Choose the column that holds the parts: `label`, else `colour`, else the only one with at least two values.

    Raises:
        InputError: There is none, or a choice; the columns are listed.
    """
    if OWN_LABELS in mesh.columns:
        return OWN_LABELS
    several = [name for name in mesh.columns if _count(mesh, name) > 1]
    if COLOUR in several:
        return COLOUR
    if len(several) == 1:
        return several[0]
    raise InputError(
        f"{source} has no part labels: neither a column {OWN_LABELS} of its faces, nor colours, nor one other column "
        f"of several values; {_list_columns(mesh, several or mesh.columns)}"
    )


def suggest_columns(source: str, mesh: FileMesh) -> str | None:
    """Name the columns that may be parts, and how to take the first of them; None where there are none.

    These are named things, colours, and any other integers of few values but a STEP file's B-rep faces.
    """
    others = [name for name, each in mesh.columns.items() if each.are_ids and each.values.dtype.kind in "biu"]
    names = [name for name in (*PARTS, *others) if name in mesh.columns and name not in (OWN_LABELS, FACE)]
    found = {name: count for name in names if 2 <= (count := _count(mesh, name)) <= MOST_PARTS}
    if not found:
        return None
    counts = [f"{count} {PARTS.get(name, f'values of {name}')}" for name, count in found.items()]
    listed = " and ".join([", ".join(counts[:-1]), counts[-1]] if len(counts) > 1 else counts)
    first = next(iter(found))
    return f"{source}: has {listed}: labels={source}:{first} takes them as parts; labels=auto segments by geometry"


def read_own_labels(path: Path) -> LabelledMesh:
    """Read a mesh file with its own labels, without repairs.

    Raises:
        InputError: The mesh cannot be read, or has no labels.
    """
    mesh = read_mesh(path)
    labels = check_ids(f"{path}: its label", find_column(str(path), mesh, OWN_LABELS).values)
    return LabelledMesh(mesh.vertices, mesh.faces, labels)


def _count(mesh: FileMesh, name: str) -> int:
    return len(np.unique(mesh.columns[name].values))


def _list_columns(mesh: FileMesh, names: Iterable[str]) -> str:
    listed = ", ".join(f"{name} ({_count(mesh, name)} values)" for name in names)
    return f"give labels=<file>:<column>, one of {listed}" if listed else "it has no columns; give labels=<file.npy>"
