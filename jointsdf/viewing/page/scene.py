"""What a page draws: ground truth or points, and fits with their errors and fields, as packed arrays."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.geometry.distance import ClosestPoint, ExactDistance
from jointsdf.model.field import JointField
from jointsdf.values import LabelledMesh, Scan, Shape, Subject
from jointsdf.viewing.page.display import Display, display
from jointsdf.viewing.page.errors import (
    errors_beside_points,
    errors_of_fit,
    errors_of_points,
    errors_of_truth,
)
from jointsdf.viewing.page.field_grid import Evaluate, FieldGrid, sample_grid
from jointsdf.viewing.page.packed_surfaces import empty_fit, pack_fit, pack_grid, pack_mesh, pack_points


@dataclass(frozen=True)
class Detail:
    """How much of a run a page holds.

    Attributes:
        faces: Number to which the faces of each surface are merged.
        grid: Points of a field's grid along each axis.
        truth_grid: Those of the exact distance, which is slower.
        points: Most points of a cloud.
    """

    faces: int = 40_000
    grid: int = 48
    truth_grid: int = 24
    points: int = 60_000


@dataclass(frozen=True)
class Fit:
    """A fitted field and its mesh, file frame; the name tells the fits of a page apart."""

    name: str
    mesh: LabelledMesh
    field: JointField


@dataclass(frozen=True)
class Scene:
    """The content of the 3D view.

    Attributes:
        shape: What was fitted.
        fits: Its fits.
        surfaces: Truth or points first; for the page's scripts.
    """

    shape: Subject
    fits: Sequence[Fit]
    surfaces: list[dict[str, Any]]

    @cached_property
    def corners(self) -> Float[ndarray, "n 3"]:
        """Points whose bounding box is that of what was fitted."""
        return corners_of(self.shape)

    @cached_property
    def part_ids(self) -> Int[ndarray, " k"]:
        """Ids of the page's parts, ascending, -1 for what has none."""
        return all_parts(self.shape, self.fits)

    @property
    def size(self) -> float:
        """Longest side of what was fitted, file units."""
        return float(np.ptp(self.corners, axis=0).max())

    @property
    def largest(self) -> float:
        """Largest error of all, file units."""
        return max((surface.get("largest", 0.0) for surface in self.surfaces), default=0.0)


def build_scene(shape: Subject, fits: Sequence[Fit], detail: Detail) -> Scene:
    """Merge, compare and pack the surfaces.

    Args:
        shape: Mesh or point cloud; a cloud's truth is shown where there is one.
        fits: Fits of it, at least one; those without a surface are shown empty.
        detail: How much of it.
    """
    parts, truth = all_parts(shape, fits), shape.truth
    surfaces = []
    if truth is None:
        assert isinstance(shape, Scan)
        chosen = np.arange(0, len(shape.points), -(-len(shape.points) // detail.points))
        surfaces.append(pack_points(shape, chosen, parts))
        surfaces += [_fit_beside_points(shape, chosen, fit, parts, detail) for fit in fits]
        return Scene(shape, fits, surfaces)
    frame = fits[0].field.normalisation
    exact = ExactDistance(truth.mesh, watertight=truth.watertight, folded=truth.folded)
    shown = display(truth.mesh, detail.faces, exact.closest)
    grid = pack_grid(sample_grid(exact.signed, frame, *_box(shape), detail.truth_grid))
    surfaces.append({"role": "truth", "name": "ground truth", **pack_mesh(shown, parts, {}), "field": grid})
    surfaces += [_fit_beside_truth(truth, exact, shown, fit, parts, detail) for fit in fits]
    return Scene(shape, fits, surfaces)


def corners_of(shape: Subject) -> Float[ndarray, "n 3"]:
    """Points whose bounding box is that of what was fitted."""
    if shape.truth is None:
        assert isinstance(shape, Scan)
        return shape.points
    return shape.truth.mesh.vertices[np.unique(shape.truth.mesh.faces)].astype(np.float64)


def all_parts(shape: Subject, fits: Sequence[Fit]) -> Int[ndarray, " k"]:
    """Part ids of truth and fits, ascending, -1 for what has none."""
    given = shape.truth.mesh.labels if shape.truth is not None else shape.labels
    return np.unique(np.concatenate([given, *(fit.mesh.labels for fit in fits)]))


def _fit_beside_truth(
    truth: Shape, exact: ExactDistance, shown: Display, fit: Fit, parts: Int[ndarray, " k"], detail: Detail
) -> dict[str, Any]:
    if fit.mesh.is_empty:
        return empty_fit(fit.name)
    full = ClosestPoint(fit.mesh)
    mine = display(fit.mesh, detail.faces, full)
    errors = errors_of_fit(truth.mesh, exact, full, mine.mesh)
    missed = errors_of_truth(shown.mesh, mine.mesh, full, fit.mesh.labels, fit.field)
    return pack_fit(fit.name, mine, errors, missed, parts, _grid_of(fit, truth, detail))


def _fit_beside_points(
    scan: Scan, chosen: Int[ndarray, " n"], fit: Fit, parts: Int[ndarray, " k"], detail: Detail
) -> dict[str, Any]:
    if fit.mesh.is_empty:
        return empty_fit(fit.name)
    full = ClosestPoint(fit.mesh)
    mine = display(fit.mesh, detail.faces, full)
    errors = errors_beside_points(scan, mine.mesh)
    missed = errors_of_points(scan, chosen, full, fit.mesh.labels, fit.field)
    return pack_fit(fit.name, mine, errors, missed, parts, _grid_of(fit, scan, detail))


def _box(shape: Subject) -> tuple[Float[ndarray, "3"], Float[ndarray, "3"]]:
    corners = corners_of(shape)
    return corners.min(axis=0), corners.max(axis=0)


def _grid_of(fit: Fit, shape: Subject, detail: Detail) -> FieldGrid:
    frame = fit.field.normalisation

    def evaluate(points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        return fit.field.network_sdf(frame.forward(points)).astype(np.float64) * frame.scale

    answer: Evaluate = evaluate
    return sample_grid(answer, frame, *_box(shape), detail.grid)
