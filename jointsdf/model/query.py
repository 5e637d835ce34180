"""Queries of a field: points and names in, answers of the points' type out."""

import math
import warnings
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from threading import RLock
from typing import Any, NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from numpy import ndarray
from torch import Tensor

from jointsdf.errors import InputError, first_line
from jointsdf.model.outside import outside_box
from jointsdf.threads import large_pieces
from jointsdf.values import BOX, Normalisation

ANSWERS = ("sdf", "part", "logits", "gradient")
COARSE = 1e-5  # of the shape's size: steps of the points' coordinates from which a warning is given

_LOCK = RLock()


class OutsideBoxWarning(UserWarning):
    """A field was queried outside the training box, where it answers lower bounds of the distance."""


class RoundedPointsWarning(UserWarning):
    """A field was queried at points whose floating-point type is too coarse for the shape's place."""


class FieldQuery(NamedTuple):
    """Answers of a `JointField`, file frame; None for those not asked for.

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


def parse_points(given: Any) -> tuple[Float[Tensor, "n 3"], Callable[[Tensor], Any]]:
    """Convert points to a tensor, and make the function that converts answers to the points' type.

    Args:
        given: A tensor, an array, or nested lists, of shape (n, 3), or (3,) for one point.

    Returns:
        The points, and a function from an answer of n rows to a tensor, an array or lists, without the first axis where
        one point was given.

    Raises:
        InputError: Another shape, another type than real numbers, or a value that is not finite.

    >>> points, as_given = parse_points([0, 0, 1])
    >>> points.shape, as_given(points[:, 2])
    (torch.Size([1, 3]), 1.0)
    """
    points = _to_tensor(given)
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


def join(pieces: list[Tensor]) -> Tensor:
    """Concatenate tensors and empty their list, so that of many answers only one is there twice."""
    whole = torch.cat(pieces)
    pieces.clear()
    return whole


def parse_names(what: str | Collection[str]) -> set[str]:
    """Names of the answers asked for, as a set.

    Raises:
        InputError: An unknown name, or none.
    """
    names = {what} if isinstance(what, str) else set(what)
    if not names or not names <= set(ANSWERS):
        odd = ", ".join(sorted(names - set(ANSWERS))) or "nothing"
        raise InputError(f"what={odd}: give some of {', '.join(ANSWERS)}")
    return names


@contextmanager
def short_operations() -> Iterator[None]:
    """Within the block, one thread an operation, all threads for pieces; one block at a time.

    Where other processes are busy, the many short operations around the pass otherwise cost a third of a query: threads
    spin until all of them are there. The lock keeps the process's number of threads, which the block restores.
    """
    with _LOCK, large_pieces():
        yield


def warn_once(
    said: set[type[Warning]], given: Float[Tensor, "n 3"], points: Float[Tensor, "n 3"], frame: Normalisation
) -> None:
    """Warn of points outside the training box, and of points in too few digits for its place, once of each.

    Args:
        said: Warnings that were given; those given now are added.
        given: The points as given, file frame.
        points: The points in the network frame.
        frame: File frame -> network frame.
    """
    found: dict[type[Warning], str] = {}
    if outside_box(points).any():
        found[OutsideBoxWarning] = (
            "points outside the training box: their distances are lower bounds, their parts -1 (said once)"
        )
    spacing, size = _spacing(given, float(np.abs(frame.centre).max()) + BOX * frame.scale), 2 * frame.scale
    if spacing > COARSE * size:
        found[RoundedPointsWarning] = (
            f"points in {str(given.dtype).removeprefix('torch.')}, which so far from the origin come in steps of "
            f"{spacing:.2g} file units ({spacing / size:.1e} of the shape's size): give float64 (said once)"
        )
    for kind in found.keys() - said:
        said.add(kind)
        warnings.warn(found[kind], kind, stacklevel=3)


def _spacing(points: Float[Tensor, "n 3"], most: float) -> float:
    """Distance between neighbouring numbers of the points' type at their largest coordinate, or at `most` if less."""
    if points.numel() == 0 or points.dtype == torch.float64:
        return 0.0
    exponent = math.frexp(min(float(points.detach().abs().max()), most))[1] - 1
    return math.ldexp(torch.finfo(points.dtype).eps, exponent)


def _to_tensor(given: Any) -> Tensor:
    if isinstance(given, Tensor):
        points = given
    else:
        try:
            array = np.asarray(given, dtype=None if isinstance(given, ndarray) else np.float64)
            points = torch.from_numpy(array.astype(array.dtype.newbyteorder("="), order="C"))  # any strides, a copy
        except (TypeError, ValueError) as error:
            raise InputError(f"points: {first_line(error)}; give numbers in shape (n, 3)") from error
    if points.is_complex() or points.dtype == torch.bool:
        raise InputError(f"points of type {points.dtype}: give real numbers")
    return points if points.is_floating_point() else points.double()
