"""The label file beside a mesh file: `bracket.labels.npy` of `bracket.stl`, else the folder's `labels.npy`."""

from pathlib import Path

from jointsdf.errors import InputError
from jointsdf.shapes.readers.formats import stem_of

ENDINGS = (".npy", ".npz", ".txt", ".csv", ".seg", ".xyzc", ".ply")
MARKS = (".labels", "_labels")  # between the mesh's stem and the ending
OF_FOLDER = "labels.npy"


def find_label_file(mesh_path: Path) -> Path | None:
    """Find the label file that belongs to a mesh file.

    Args:
        mesh_path: The mesh file; need not exist.

    Returns:
        `<stem>.labels` or `<stem>_labels` with one of `ENDINGS`, else `labels.npy`; None where none is there.

    Raises:
        InputError: The mesh has two label files of its own.
    """
    own = [path for path in possible_label_files(mesh_path) if path.is_file()]
    if len(own) > 1:
        raise InputError(f"{mesh_path} has the label files {own[0].name} and {own[1].name}: give one by labels=<file>")
    if own:
        return own[0]
    common = mesh_path.with_name(OF_FOLDER)
    return common if common.is_file() else None


def possible_label_files(mesh_path: Path) -> list[Path]:
    """Where a mesh's own label file may be.

    >>> [path.name for path in possible_label_files(Path("my parts/bracket.v2.stl.gz"))][:3]
    ['bracket.v2.labels.npy', 'bracket.v2.labels.npz', 'bracket.v2.labels.txt']
    """
    stem = stem_of(mesh_path)
    return [mesh_path.with_name(stem + mark + ending) for mark in MARKS for ending in ENDINGS]
