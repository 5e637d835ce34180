"""Answers of a field at points as one table, whose columns are chosen by name."""

import warnings
from collections.abc import Collection
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Shaped
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.model.field import JointField
from jointsdf.model.level_set import UnreachedWarning
from jointsdf.model.query import OutsideBoxWarning

WHAT = ("sdf", "part", "probabilities", "gradient", "closest", "curvatures")
DEFAULT = ("sdf", "part", "gradient")
OF_QUERY = {"sdf": "sdf", "part": "part", "probabilities": "logits", "gradient": "gradient"}


def parse_what(text: str) -> tuple[str, ...]:
    """Names of answers, separated by commas, in the order of the table.

    Raises:
        InputError: An unknown name, or none.
    """
    names = {name.strip() for name in text.split(",")} - {""}
    if not names or not names <= set(WHAT):
        raise InputError(f"--what {text}: give some of {','.join(WHAT)}")
    return tuple(name for name in WHAT if name in names)


def table_type(field: JointField, what: Collection[str]) -> np.dtype:
    """Columns of the table: the points, and those of each answer.

    Raises:
        InputError: Probabilities of a field without a head.
    """
    parts = len(field.part_ids)
    if "probabilities" in what and parts == 0:
        raise InputError("--what probabilities: the field has no parts (head=none); leave it out")
    columns: dict[str, list[Any]] = {
        "sdf": [("sdf", "<f4")],
        "part": [("part", "<i4")],
        "probabilities": [("probabilities", "<f4", (parts,))],
        "gradient": [("gradient", "<f4", (3,))],
        "closest": [("closest", "<f8", (3,)), ("distance", "<f4")],
        "curvatures": [("curvatures", "<f4", (2,))],
    }
    return np.dtype([("points", "<f8", (3,)), *(column for name in WHAT if name in what for column in columns[name])])


def flat_names(field: JointField, kind: np.dtype) -> list[str]:
    """A name for each number of a row: x, y, z, sdf, part, p_<id>, gradient_x, .., closest_x, .., distance, k1, k2."""
    names = {
        "points": ["x", "y", "z"],
        "probabilities": [f"p_{part}" for part in field.part_ids.tolist()],
        "gradient": ["gradient_x", "gradient_y", "gradient_z"],
        "closest": ["closest_x", "closest_y", "closest_z"],
        "curvatures": ["k1", "k2"],
    }
    return [name for column in kind.names or () for name in names.get(column, [column])]


def answer(field: JointField, points: Float[ndarray, "n 3"], kind: np.dtype) -> Shaped[ndarray, " n"]:
    """Fill the table at points, file units; without warnings, since the table itself says what is unknown.

    Args:
        field: The fitted field.
        points: Where, file frame.
        kind: From `table_type`.
    """
    table = np.zeros(len(points), dtype=kind)
    table["points"] = points
    columns = set(kind.names or ())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", OutsideBoxWarning)
        warnings.simplefilter("ignore", UnreachedWarning)
        if asked := [name for column, name in OF_QUERY.items() if column in columns]:
            found = field.query(points, what=asked)
            for column in columns & {"sdf", "part", "gradient"}:
                table[column] = getattr(found, column)
            if "probabilities" in columns:
                table["probabilities"] = torch.from_numpy(found.logits).softmax(dim=1).numpy()
        if "closest" in columns:
            table["closest"], table["distance"] = field.closest(points)
        if "curvatures" in columns:
            table["curvatures"] = field.curvatures(points).principal
    return table
