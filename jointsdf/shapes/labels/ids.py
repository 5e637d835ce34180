"""Part ids: which numbers can be one, and their renumbering by falling area."""

import numpy as np
from jaxtyping import Int, Shaped
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.geometry.mesh import part_areas
from jointsdf.values import MOST_LABEL, UNLABELLED, LabelledMesh


def check_ids(source: str, values: Shaped[ndarray, " n"]) -> Int[ndarray, " n"]:
    """Convert numbers to part ids: integers, whole floats, and booleans as 0 and 1.

    Args:
        source: Names the numbers in messages.
        values: The numbers.

    Raises:
        InputError: They are no numbers, or one of them is no integer from -1 to `MOST_LABEL`.

    >>> check_ids("it", np.array([3.0, -1.0]))
    array([ 3, -1])
    """
    if values.dtype.kind not in "biuf":
        raise InputError(f"{source} holds {values.dtype}: give integers, one part id for each face")
    if values.dtype.kind == "f":
        values = values.astype(np.float64)  # smaller floats round the largest id up
    with np.errstate(invalid="ignore"):
        bad = ~((values >= UNLABELLED) & (values <= MOST_LABEL) & (values == np.round(values)))
    if bad.any():
        value = values[bad][0].item()
        shown = int(value) if value == value // 1 else value
        raise InputError(
            f"{source} holds {shown}: part ids are integers from {UNLABELLED} (unlabelled) to {MOST_LABEL}"
        )
    return values.astype(np.int64)


def number_by_area(mesh: LabelledMesh) -> Int[ndarray, " f"]:
    """Renumber the parts 0, 1, .. by falling area, so that a number means something across shapes; -1 stays.

    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [4, 0, 0]])
    >>> number_by_area(LabelledMesh(square, np.array([[0, 1, 2], [1, 3, 2]]), np.array([5, 7])))
    array([1, 0])
    """
    labelled = mesh.labels != UNLABELLED
    parts = np.searchsorted(mesh.part_ids, mesh.labels[labelled])
    labels = mesh.labels.copy()
    labels[labelled] = np.argsort(np.argsort(-part_areas(mesh), kind="stable"), kind="stable")[parts]
    return labels
