"""Fields to export, points everywhere, and what every exported form must answer."""

from collections.abc import Callable, Mapping
from typing import Any

import analytic
import numpy as np
import pytest
from numpy import ndarray

from jointsdf.model.field import JointField
from jointsdf.model.heads import HEADS
from jointsdf.values import Normalisation

FAR_AWAY = Normalisation(np.array([4e6, -3.0, 11.0]), 25.0)  # where float32 coordinates come in steps of 0.25
SIDE = 2 * FAR_AWAY.scale
FORMS = [  # head, grid away from the surface, half precision
    *((head, "grid", False) for head in HEADS),
    *(("siren", "none", half) for half in (False, True)),
    ("deep_skip", "grid", True),
]


def make_field(build: Callable[..., JointField], head: str = "siren", far: str = "grid") -> JointField:
    """A small field far from its origin; its grid, if any, holds the distance to a block."""
    field = build(head, normalisation=FAR_AWAY, far=far, far_resolution=24).eval()
    if field.far is not None:
        field.far.fill(lambda points: analytic.box_distance(points, np.array([0.8, 0.5, 0.3])))
    return field


def everywhere(count: int = 1500) -> ndarray:
    """Points within the training box and outside of it, file frame."""
    return FAR_AWAY.inverse(np.random.default_rng(0).uniform(-1.6, 1.6, (count, 3)))


def assert_answers(found: Mapping[str, Any], field: JointField, points: ndarray) -> None:
    """The answers are those of the field itself, distances within 1e-5 of the longest side."""
    with pytest.warns(UserWarning, match="outside the training box"):
        wanted = field.query(points)
    np.testing.assert_allclose(found["sdf"], wanted.sdf, rtol=0, atol=1e-5 * SIDE)
    np.testing.assert_allclose(found["gradient"], wanted.gradient, rtol=0, atol=2e-3)
    if "logits" in found:
        np.testing.assert_allclose(found["logits"], wanted.logits, rtol=0, atol=1e-4)
    if "part" in found:
        np.testing.assert_array_equal(found["part"], wanted.part)
