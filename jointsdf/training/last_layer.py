"""Refit of the head's last layer: multinomial logistic regression on the features below it, solved to optimality.

The steps of a fit leave the head's border between two parts where its last, small steps put it. With all layers below
kept, the best last layer is a convex problem. It is solved by L-BFGS (Liu and Nocedal 1989) on features that are
whitened by their second moments near the borders, which is the Hessian up to what differs between the parts.
"""

import logging
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float32, Int
from numpy import ndarray
from scipy.optimize import minimize
from torch import Tensor, nn

from jointsdf.model.field import JointField
from jointsdf.model.fused.inference import TappedHead, infer
from jointsdf.threads import over_threads
from jointsdf.values import UNLABELLED, LabelledPoints

log = logging.getLogger(__name__)

PENALTY = 10.0  # of the squared change of a weight, beside the sum over the points: 1 / variance of a prior about it
MEMORY = 20  # updates that L-BFGS keeps
PIECE = 4096  # points; the same for any number of threads, so that sums have the same last bits


@dataclass(frozen=True)
class Regression:
    """The loss over the matrix W of the last layer, weights and biases side by side.

    (1 / n) [ sum_i -log softmax(W a_i)_{y_i} + (penalty / 2) |W - W_0|^2 ]

    Attributes:
        features: Outputs of the layer below, with a column of ones: a.
        labels: Class of each point: y.
        start: Matrix about which the penalty lies: W_0.
        penalty: Of the squared change; above 0, so that there is one minimum, a finite one.
    """

    features: Float32[Tensor, "n d"]
    labels: Int[Tensor, " n"]
    start: Float32[Tensor, "k d"]
    penalty: float = PENALTY

    def whitener(self) -> Float[Tensor, "d d"]:
        """Lower Cholesky factor L of the features' second moments, each point weighted by 1 - max softmax(W_0 a)."""

        def moments(piece: Float32[Tensor, "p d"]) -> Float32[Tensor, "d d"]:
            unsure = 1 - (piece @ self.start.T).softmax(-1).amax(-1)
            return (piece * unsure[:, None]).T @ piece

        total = torch.stack(over_threads(moments, self.features.split(PIECE))).double().sum(0)
        ridge = self.penalty * torch.eye(len(total), dtype=torch.float64)
        return torch.linalg.cholesky((total + ridge) / len(self.features))

    def solve(self, iterations: int) -> Float32[Tensor, "k d"]:
        """W after so many iterations of L-BFGS from W_0, over V = W L with the features L^-1 a."""
        whitener = self.whitener()
        inverse = torch.linalg.inv(whitener)
        start, white = (self.start.double() @ whitener).numpy(), self.features @ inverse.T.float()
        curvature = (inverse @ inverse.T).numpy()

        def objective(flat: Float[ndarray, " kd"]) -> tuple[float, Float[ndarray, " kd"]]:
            matrix = flat.reshape(start.shape)
            loss, slope = _cross_entropy(white, self.labels, torch.from_numpy(matrix).float())
            change = matrix - start
            pull = self.penalty * change @ curvature
            count = len(white)
            return (loss + 0.5 * float((change * pull).sum())) / count, ((slope + pull) / count).ravel()

        options = {"maxiter": iterations, "maxcor": MEMORY, "ftol": 0.0, "gtol": 0.0}
        found = minimize(objective, start.ravel(), jac=True, method="L-BFGS-B", options=options)
        return (torch.from_numpy(found.x.reshape(start.shape)) @ inverse).float()


def refit_last_layer(field: JointField, given: LabelledPoints, iterations: int) -> None:
    """Move the last layer of a field's head to where labelled points want it, in place; all other layers are kept.

    Where more of the judges have a wrong label afterwards than before, as on shapes of few parts, whose borders the
    steps have learned well, the layer is left as it is.

    Args:
        field: On the CPU, in evaluation mode. A head with fewer than two classes is left as it is.
        given: Points with their parts; unlabelled ones do not count.
        iterations: Most iterations of L-BFGS.
    """
    kept = given.labels != UNLABELLED
    if iterations == 0 or len(field.part_ids) < 2 or not kept[: len(kept) - given.judges].any():
        return
    layer = last_layer(field.head)
    features = below_last_layer(field, given.points[kept].astype(np.float32))
    features, labels = torch.cat([features, torch.ones(len(features), 1)], -1), torch.from_numpy(given.labels[kept])
    learned = len(labels) - int(kept[len(kept) - given.judges :].sum())
    start = torch.cat([layer.weight, layer.bias[:, None]], -1).detach()
    matrix = Regression(features[:learned], labels[:learned], start).solve(iterations)
    before, after = (
        int(((features[learned:] @ chosen.T).argmax(-1) != labels[learned:]).sum()) for chosen in (start, matrix)
    )
    if after > before:
        log.info("labels: the head's last layer stays; refitted it errs at %d points instead of %d", after, before)
        return
    with torch.no_grad():
        layer.weight.copy_(matrix[:, :-1])
        layer.bias.copy_(matrix[:, -1])


def last_layer(head: nn.Module) -> nn.Linear:
    """The linear layer that makes a head's logits: its last one (`layers.classifier`)."""
    return [layer for layer in head.modules() if isinstance(layer, nn.Linear)][-1]


def below_last_layer(field: JointField, points: Float32[ndarray, "n 3"]) -> Float32[Tensor, "n d"]:
    """What the head's last layer sees at points of the network frame."""
    name = next(name for name, layer in field.head.named_modules() if layer is last_layer(field.head))
    parent = field.head.get_submodule(name.rpartition(".")[0])
    layer = last_layer(field.head)
    setattr(parent, name.rpartition(".")[2], nn.Identity())
    try:
        trunk = field.trunk
        tapped = TappedHead(trunk.tap, field.head)
        found = infer(trunk.sine_layers, trunk.output, torch.from_numpy(points), sdf=False, tapped=tapped).head
    finally:
        setattr(parent, name.rpartition(".")[2], layer)
    assert found is not None
    return found


def _cross_entropy(
    features: Float32[Tensor, "n d"], labels: Int[Tensor, " n"], matrix: Float32[Tensor, "k d"]
) -> tuple[float, Float[ndarray, "k d"]]:
    """Sum over the points of the cross-entropy of `features @ matrix.T`, and its gradient to the matrix."""

    def piece(part: tuple[Tensor, Tensor]) -> tuple[float, Tensor]:
        rows, wanted = part
        logits = rows @ matrix.T
        normaliser = logits.logsumexp(-1, keepdim=True)
        loss = (normaliser - logits.gather(-1, wanted[:, None])).sum()
        residual = logits.sub_(normaliser).exp_()
        residual[torch.arange(len(rows)), wanted] -= 1
        return loss.item(), residual.T @ rows

    losses, slopes = zip(
        *over_threads(piece, zip(features.split(PIECE), labels.split(PIECE), strict=True)), strict=True
    )
    return sum(losses), torch.stack(slopes).double().sum(0).numpy()
