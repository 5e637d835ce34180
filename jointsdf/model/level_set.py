"""Closest points and curvatures of a field's level sets, in file units: methods of `JointField`."""

import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from numpy import ndarray
from torch import Tensor, nn

from jointsdf.model.closest import find_closest, onto_surface
from jointsdf.model.composition import evaluate_fused
from jointsdf.model.far_grid import FarGrid
from jointsdf.model.outside import Extended, extend, onto_box, outside_box
from jointsdf.model.query import join, parse_points, short_operations, warn_once
from jointsdf.model.second_derivatives import Differential, second_derivatives, shape_operator
from jointsdf.model.trunk import SirenTrunk
from jointsdf.values import Normalisation

CHUNK = 65536  # points whose answers are put together before those of the next


class UnreachedWarning(UserWarning):
    """From some points no surface was reached."""


class ClosestPoints(NamedTuple):
    """Closest points of the zero level set, file frame.

    Attributes:
        point: On the surface, shape (n, 3); NaN where it was not reached.
        distance: To it, file units, without sign, shape (n,); NaN where it was not reached.
    """

    point: Any
    distance: Any


class Curvatures(NamedTuple):
    """Curvatures of the level set through each point, positive where it bends away from the outward normal: 1 / r on a
    sphere of radius r. NaN outside the training box.

    Attributes:
        principal: Both principal curvatures, the larger one first, 1 / file unit, shape (n, 2).
        mean: Their mean, 1 / file unit, shape (n,).
        gaussian: Their product, 1 / file unit squared, shape (n,).
    """  # noqa: D205

    principal: Any
    mean: Any
    gaussian: Any


class LevelSet(nn.Module):
    """The level sets of a field made of trunk, head and grid, with its place in the file frame."""

    centre: Tensor
    scale: Tensor
    trunk: SirenTrunk
    head: nn.Module
    far: FarGrid | None
    _said: set[type[Warning]]

    @property
    def normalisation(self) -> Normalisation:
        """File frame -> network frame."""
        return Normalisation(self.centre.cpu().numpy(), float(self.scale))

    def closest(self, points: Any) -> ClosestPoints:
        """Closest points of the zero level set, also from outside the training box.

        Steps along the field's own gradient until |f| is below 1e-5 network length units (1e-10 of a float64 field),
        then along the surface to the foot point (`model/closest.py`). The end is a local minimum of the distance. What
        is not reached is NaN, and counted in an `UnreachedWarning`.

        Args:
            points: As for `query`.

        Returns:
            Answers of the type of the points.

        Raises:
            InputError: The points cannot be used.
        """
        ends, as_given = self._by_chunks(points, self._closest)
        if len(lost := ends.isnan().any(dim=1).nonzero()):
            warnings.warn(
                f"from {len(lost)} of {len(ends)} points no surface was reached, first from row {int(lost[0])}: NaN",
                UnreachedWarning,
                stacklevel=2,
            )
        return ClosestPoints(as_given(ends[:, :3]), as_given(ends[:, 3]))

    def curvatures(self, points: Any) -> Curvatures:
        """Principal, mean and Gaussian curvature of the level set through each point, by exact second derivatives.

        Eigenvalues of the shape operator H / |g| in the tangent plane (Goldman, "Curvature formulas for implicit curves
        and surfaces", 2005); positive on a sphere. Outside the training box, where the field is a bound, they are NaN.

        Args:
            points: As for `query`; anywhere in the training box, not on the surface alone.

        Returns:
            Answers of the type of the points.

        Raises:
            InputError: The points cannot be used.
        """
        principal, as_given = self._by_chunks(points, self._curvatures)
        mean, gaussian = principal.mean(dim=1), principal.prod(dim=1)
        return Curvatures(as_given(principal), as_given(mean), as_given(gaussian))

    def network_projection(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Ends of the steps along the gradient to the zero level set, network frame, for the extraction.

        Near a distance they are the closest points; from where the surface is not reached, they end near it.
        """
        parameter = self.trunk.output.weight
        with torch.no_grad():
            start = torch.as_tensor(points, dtype=parameter.dtype, device=parameter.device)
            return np.asarray(onto_surface(start, self._first).places.cpu())

    def _by_chunks(
        self, points: Any, answer: Callable[[Float[Tensor, "m 3"]], Float[Tensor, "m k"]]
    ) -> tuple[Float[Tensor, "n k"], Callable[[Tensor], Any]]:
        """Answers at points of the file frame, of a function of the network frame."""
        with torch.no_grad(), short_operations():
            rows, as_given = parse_points(points)
            answers = []
            for chunk in rows.split(CHUNK):
                inside = self._to_network(chunk)
                warn_once(self._said, chunk, inside, self.normalisation)
                answers.append(answer(inside))
        return join(answers), as_given

    def _to_network(self, points: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
        return ((points.to(self.centre) - self.centre) / self.scale).to(self.trunk.output.weight)

    def _first(self, points: Float[Tensor, "n 3"]) -> tuple[Float[Tensor, " n"], Float[Tensor, "n 3"]]:
        """Signed distance, or its lower bound outside the training box, and its gradient; network frame."""
        projected = onto_box(points)
        values = evaluate_fused(self.trunk, self.head, self.far, projected, {"sdf", "gradient"})
        found: Extended = extend(points, projected, values.sdf, values.grad)
        assert found.grad is not None
        return found.sdf, found.grad

    def _second(self, points: Float[Tensor, "n 3"]) -> Differential:
        """Gradient and second derivatives at points of the training box; network frame."""
        return second_derivatives(self.trunk, self.far, points)

    def _closest(self, points: Float[Tensor, "n 3"]) -> Float[Tensor, "n 4"]:
        """Closest points and their distances, file units in float64."""
        found = find_closest(points, self._first, self._second)
        distances = (points - found.places).norm(dim=1).to(self.scale) * self.scale
        ends = torch.cat([found.places.to(self.scale) * self.scale + self.centre, distances[:, None]], dim=1)
        return ends.masked_fill(~found.reached[:, None], torch.nan)

    def _curvatures(self, points: Float[Tensor, "n 3"]) -> Float[Tensor, "n 2"]:
        """Principal curvatures, 1 / file unit."""
        principal = shape_operator(self._second(onto_box(points))).principal / self.scale.to(points)
        return principal.masked_fill(outside_box(points)[:, None], torch.nan)
