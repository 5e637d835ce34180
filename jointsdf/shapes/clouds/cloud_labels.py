"""Part labels of a point cloud: a column of its file, a label file, none."""

import logging
from pathlib import Path

import numpy as np
from jaxtyping import Int, Shaped
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.shapes.clouds.cloud_file import is_cloud_file, read_cloud
from jointsdf.shapes.clouds.file_cloud import FileCloud
from jointsdf.shapes.labels.beside import find_label_file
from jointsdf.shapes.labels.columns import MOST_PARTS, split_column
from jointsdf.shapes.labels.files import READERS
from jointsdf.shapes.labels.ids import check_ids
from jointsdf.shapes.readers.face_columns import COLOUR, number_colours
from jointsdf.shapes.readers.formats import suffix_of
from jointsdf.values import UNLABELLED

OWN = ("label", "labels", "part", "part_id", "class", "classification", "segment")  # columns that `auto` takes
OF_MESHES = ("geometric", "partfield", "brep")  # providers that need faces

Labels = tuple[Int[ndarray, " n"], str]

logger = logging.getLogger(__name__)


def provide_labels(labels: str, cloud: FileCloud, path: Path) -> Labels:
    """Label the points of a file.

    Args:
        labels: `auto` (a column of the file, else the label file beside it, else none), `none`, a column, `colour`, a
            label file, or `<file>:<column>` of a cloud with as many points.
        cloud: The points, in the file's order.
        path: The file.

    Returns:
        The part of each point, -1 where unlabelled, and the provider.

    Raises:
        InputError: There are no such labels, or they are not of this cloud.
    """
    if labels == "none":
        return np.full(len(cloud.points), UNLABELLED), "none"
    if labels in OF_MESHES:
        raise InputError(f"labels={labels} cuts meshes, and {path} is a point cloud: {_advise(cloud)}")
    if labels == "auto":
        return _find_own(cloud, path)
    if given := split_column(labels):
        return _from_file(cloud, path, *given)
    return _from_column(str(path), cloud, labels), f"file:{path.name}:{labels}"


def _find_own(cloud: FileCloud, path: Path) -> Labels:
    """The labels that the file holds, else those in a label file beside it, else none."""
    if own := next((name for name in OWN if name in cloud.columns), None):
        return _from_column(str(path), cloud, own), f"file:{path.name}:{own}"
    if beside := find_label_file(path):
        return _from_file(cloud, path, beside, None)
    found = [name for name, values in cloud.columns.items() if _may_be_parts(values)]
    if found or cloud.colours is not None:
        logger.warning("%s: its points have no labels that are taken for parts; %s", path, _advise(cloud))
    return np.full(len(cloud.points), UNLABELLED), "none"


def _from_file(cloud: FileCloud, path: Path, given: Path, column: str | None) -> Labels:
    """Labels in a file: the cloud's own, another cloud's column, or one number for each point."""
    name = f"file:{given.name}" + (f":{column}" if column else "")
    if is_cloud_file(given) and (column or (given.suffix != ".npy" and f".{suffix_of(given)}" not in READERS)):
        other = cloud if given.samefile(path) else read_cloud(given)[0]
        column = column or next((one for one in OWN if one in other.columns), OWN[0])
        return _check_count(str(given), _from_column(str(given), other, column), cloud), f"file:{given.name}:{column}"
    suffix = f".{suffix_of(given)}"
    if suffix not in READERS or column:
        raise InputError(f"labels={given}: give one integer for each point in {', '.join(READERS)}")
    values = READERS[suffix](given)
    return _check_count(f"labels file {given}", check_ids(f"labels file {given}", values.reshape(-1)), cloud), name


def _check_count(source: str, labels: Int[ndarray, " n"], cloud: FileCloud) -> Int[ndarray, " n"]:
    if len(labels) != len(cloud.points):
        raise InputError(f"{source} has {len(labels)} labels for {len(cloud.points)} points: give one for each")
    return labels


def _from_column(source: str, cloud: FileCloud, name: str) -> Int[ndarray, " n"]:
    """Labels from a column; colours are numbered by falling number of points."""
    if name == COLOUR and cloud.colours is not None:
        numbers = number_colours(cloud.colours)
        if (count := int(numbers.max()) + 1) > MOST_PARTS:
            raise InputError(f"{source}: its points have {count} colours, which are no parts; {_advise(cloud)}")
        order: Int[ndarray, " n"] = np.argsort(np.argsort(-np.bincount(numbers), kind="stable"))[numbers]
        return order
    if name.lower() not in cloud.columns:
        raise InputError(f"{source} has no column or label file {name!r}: {_advise(cloud)}")
    return check_ids(f"{source}: its column {name}", cloud.columns[name.lower()])


def _may_be_parts(values: Shaped[ndarray, " n"]) -> bool:
    return values.dtype.kind in "biuf" and 2 <= len(np.unique(values)) <= MOST_PARTS


def _advise(cloud: FileCloud) -> str:
    names = [*cloud.columns, *([COLOUR] if cloud.colours is not None else [])]
    own = f"labels=<column>, one of {', '.join(names)}; or " if names else ""
    return f"give {own}labels=<file.npy> with one integer for each point, or labels=none head=none"
