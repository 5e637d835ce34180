"""Questions to a field: points of any kind at the door, answers of the same kind."""

from collections.abc import Callable, Collection
from typing import Any, NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from numpy import ndarray
from torch import Tensor

from jointsdf.errors import InputError, first_line

WHAT = ("sdf", "part", "logits", "gradient")


class OutsideBoxWarning(UserWarning):
    """Points outside the training box were asked for, where a field is an extrapolation."""


class FieldQuery(NamedTuple):
    """Answers of a `JointField`, file frame; None for what was not asked.

    Attributes:
        sdf: Signed distance, file units, negative inside; shape (n,).
        part: Original part id, shape (n,); -1 for a field without a head, and outside the training box.
        logits: Pre-softmax scores, shape (n, k), columns in the order of `JointField.part_ids`.
        gradient: Gradient of the signed distance, dimensionless, shape (n, 3).
    """

    sdf: Any = None
    part: Any = None
    logits: Any = None
    gradient: Any = None


def points_of(given: Any) -> tuple[Float[Tensor, "n 3"], Callable[[Tensor], Any]]:
    """Points as a tensor, and how to give answers in the kind of the points.

    Args:
        given: A tensor, an array, or nested lists, of shape (n, 3), or (3,) for one point.

    Returns:
        The points, and a function that makes an answer of n rows a tensor, an array or lists: without the first axis
        where one point was given.

    Raises:
        InputError: Another shape, a type that is no number, or a value that is not finite.
    """
    points = _tensor(given)
    one = points.shape == (3,)
    if points.numel() == 0 and points.ndim < 2:
        points = points.reshape(0, 3)
    rows = points[None] if one else points
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise InputError(f"points of shape {tuple(points.shape)}: give (n, 3), or (3,) for one point")
    finite = torch.isfinite(rows).all(dim=1)
    if not finite.all():
        row = int((~finite).nonzero()[0])
        raise InputError(f"points: row {row} is {rows[row].tolist()}; give finite coordinates")

    def as_given(answer: Tensor) -> Any:
        found = answer[0] if one else answer
        if isinstance(given, Tensor):
            return found.to(given.device)
        array: ndarray = found.detach().cpu().numpy()
        return array if isinstance(given, ndarray) else array.tolist()

    return rows, as_given


def wanted_of(what: str | Collection[str]) -> set[str]:
    """The names asked for.

    Raises:
        InputError: An unknown name, or none.
    """
    names = {what} if isinstance(what, str) else set(what)
    if not names or not names <= set(WHAT):
        odd = ", ".join(sorted(names - set(WHAT))) or "nothing"
        raise InputError(f"what={odd}: give some of {', '.join(WHAT)}")
    return names


def _tensor(given: Any) -> Tensor:
    if isinstance(given, Tensor):
        points = given
    else:
        try:
            array = np.asarray(given, dtype=None if isinstance(given, ndarray) else np.float64)
            points = torch.from_numpy(array)
        except (TypeError, ValueError) as error:
            raise InputError(f"points: {first_line(error)}; give numbers in shape (n, 3)") from error
    if points.is_complex() or points.dtype == torch.bool:
        raise InputError(f"points of type {points.dtype}: give real numbers")
    return points if points.is_floating_point() else points.double()
