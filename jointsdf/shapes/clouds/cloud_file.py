"""Reader of point clouds of every format, as points in the file's order, which reports any damage."""

import logging
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.shapes.clouds.array_cloud import read_npy, read_npz
from jointsdf.shapes.clouds.file_cloud import FileCloud, check_cloud, first_of_each
from jointsdf.shapes.clouds.las import read_las
from jointsdf.shapes.clouds.pcd import read_pcd
from jointsdf.shapes.clouds.ply_cloud import is_ply_cloud, read_ply
from jointsdf.shapes.clouds.text_cloud import read_text
from jointsdf.shapes.readers.content import is_blank, read_file
from jointsdf.shapes.readers.formats import READ, UNREAD, suffix_of
from jointsdf.shapes.readers.recognition import recognise

PLY = "ply"  # of meshes and of clouds
READERS: Mapping[str, Callable[[Path, bytes], FileCloud]] = {
    PLY: read_ply,
    **dict.fromkeys(("xyz", "xyzn", "xyzc", "pts", "asc", "csv", "txt"), read_text),
    "npy": read_npy,
    "npz": read_npz,
    "pcd": read_pcd,
    **dict.fromkeys(("las", "laz"), read_las),
}
OWN_MARKS = {
    "npy": "npy",
    "npz": "npy",
    "pcd": "xyz",
    "las": "xyz",
    "laz": "xyz",
}  # suffix -> `recognise` of its content
MOST = 10_000_000  # points that are kept in memory
HEAD = 1 << 20  # bytes of a PLY header at most

logger = logging.getLogger(__name__)


def is_cloud_file(path: Path) -> bool:
    """True for an existing file of points: by its name, a PLY file by its declared elements."""
    suffix = suffix_of(path)
    if suffix not in READERS or not path.is_file():
        return False
    if suffix != PLY:
        return True
    try:
        return is_ply_cloud(read_file(path)[0][:HEAD])
    except InputError:
        return False  # reported by the reader of meshes


def read_cloud(path: Path) -> tuple[FileCloud, str]:
    """Read a point cloud, in the file's order, and the hash of its bytes.

    Args:
        path: A file of one of `READERS`' formats, compressed by gzip or not.

    Raises:
        InputError: The file is missing, empty, truncated, unreadable or of another format than its name says.
    """
    data, sha256 = read_file(path)
    suffix, held = suffix_of(path), recognise(data)
    if is_blank(data):
        raise InputError(f"{path} is empty ({path.stat().st_size} bytes without points): export it again")
    if suffix != held and held in READ.values():
        raise InputError(f"{path} holds {held.upper()}, not {suffix.upper()} as its name says: rename it")
    if held in UNREAD and held != OWN_MARKS.get(suffix):
        raise InputError(f"{path} is {UNREAD[held].name}, not {suffix.upper()} as its name says: export it as PLY")
    return READERS[suffix](path, data), sha256


def choose_points(source: str, cloud: FileCloud) -> Int[ndarray, " m"]:
    """Choose the points that are kept: each place once, and no more than `MOST`, at random; what is left out is logged.

    Args:
        source: Names the cloud in messages.
        cloud: As read.

    Returns:
        Their indices, ascending.

    Raises:
        InputError: It is no cloud of a surface (`check_cloud`).
    """
    check_cloud(source, cloud.points)
    kept = np.flatnonzero(first_of_each(cloud.points))
    if repeated := len(cloud.points) - len(kept):
        logger.warning("%s: %d points repeat others exactly and are left out", source, repeated)
    if len(kept) > MOST:
        logger.warning("%s: %d points are thinned to %d at random", source, len(kept), MOST)
        kept = np.sort(np.random.default_rng(0).choice(kept, MOST, replace=False))
    check_cloud(source, cloud.points[kept])
    return kept
