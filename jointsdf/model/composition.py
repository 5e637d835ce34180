"""The whole field from its pieces: the network near the surface, the grid away from it, the head anywhere."""

from collections.abc import Callable
from typing import Any, NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn

from jointsdf.errors import require_one_of
from jointsdf.model.far_grid import FarGrid
from jointsdf.model.fused.inference import TappedHead, infer
from jointsdf.model.trunk import SirenTrunk
from jointsdf.threads import over_threads, pieces

GRID_PIECE = 4096  # points; their neighbourhoods in the grid take 1 MB


def make_trunk(*, far: str = "none", far_resolution: int = 64, **arguments: Any) -> tuple[SirenTrunk, FarGrid | None]:
    """Make trunk and grid.

    Args:
        far: `none` or `grid`.
        far_resolution: Points of the grid along each axis.
        **arguments: Of `SirenTrunk`.

    Raises:
        InputError: A value out of range.
    """
    require_one_of("trunk.far", far, ("none", "grid"))
    return SirenTrunk(**arguments), FarGrid(far_resolution) if far == "grid" else None


class NetworkValues(NamedTuple):
    """Values at points of the network frame, for the answers of a query; None for those it does not need.

    Attributes:
        sdf: Signed distance, network length units.
        logits: Pre-softmax scores.
        grad: Gradient of the signed distance, dimensionless.
    """

    sdf: Float[Tensor, " n"]
    logits: Float[Tensor, "n k"] | None = None
    grad: Float[Tensor, "n 3"] | None = None


Evaluate = Callable[[SirenTrunk, nn.Module, FarGrid | None, Float[Tensor, "n 3"], set[str]], NetworkValues]


def evaluate_fused(
    trunk: SirenTrunk, head: nn.Module, far: FarGrid | None, points: Float[Tensor, "n 3"], wanted: set[str]
) -> NetworkValues:
    """Evaluate the field without a graph, the network only where the grid does not tell all that is wanted."""
    if far is None:
        return _evaluate_network(trunk, head, points, wanted)
    values, slopes = _evaluate_grid(far, points, "gradient" in wanted)
    asked = values.abs() < far.outer
    near = _evaluate_network(trunk, head, points[asked], wanted)
    logits = near.logits
    if logits is not None and near.sdf.shape != values.shape:
        beyond = infer(trunk.sine_layers, trunk.output, points[~asked], sdf=False, tapped=TappedHead(trunk.tap, head))
        assert beyond.head is not None
        everywhere = points.new_empty(len(points), logits.shape[1])
        everywhere[asked], everywhere[~asked] = logits, beyond.head
        logits = everywhere
    if slopes is not None and near.grad is not None:
        slopes[asked] = far.blend_gradient((values[asked], slopes[asked]), (near.sdf, near.grad))
    values[asked] = far.blend(values[asked], near.sdf)
    return NetworkValues(values, logits, slopes)


def _evaluate_grid(
    far: FarGrid, points: Float[Tensor, "n 3"], gradient: bool
) -> tuple[Float[Tensor, " n"], Float[Tensor, "n 3"] | None]:
    parts = points.tensor_split(pieces(points, GRID_PIECE))
    if not gradient:
        return torch.cat(over_threads(far, parts)), None
    values, slopes = zip(*over_threads(far.value_and_gradient, parts), strict=True)
    return torch.cat(values), torch.cat(slopes)


def _evaluate_network(
    trunk: SirenTrunk, head: nn.Module, points: Float[Tensor, "n 3"], wanted: set[str]
) -> NetworkValues:
    """Evaluate trunk and head by the inference pass."""
    tapped = TappedHead(trunk.tap, head) if wanted & {"part", "logits"} else None
    found = infer(trunk.sine_layers, trunk.output, points, grad="gradient" in wanted, tapped=tapped)
    assert found.sdf is not None
    return NetworkValues(found.sdf, found.head, found.grad)


def evaluate_with_graph(
    trunk: SirenTrunk, head: nn.Module, far: FarGrid | None, points: Float[Tensor, "n 3"], wanted: set[str]
) -> NetworkValues:
    """Evaluate the field by plain autograd, differentiable any number of times."""
    if "gradient" in wanted and not points.requires_grad:
        points = points.detach().requires_grad_()
    sdf, features = trunk(points)
    if far is not None:
        sdf = far.blend(far(points), sdf)
    grad = torch.autograd.grad(sdf.sum(), points, create_graph=True)[0] if "gradient" in wanted else None
    return NetworkValues(sdf, head(features) if wanted & {"part", "logits"} else None, grad)
