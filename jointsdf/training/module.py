"""The training step: evaluate what the active terms need, add the weighted terms, refuse non-finite losses, log."""

import math
from collections.abc import Callable, Mapping
from typing import Any

import torch
from jaxtyping import Float
from lightning import LightningModule
from lightning.pytorch.utilities.types import OptimizerLRSchedulerConfig
from torch import Tensor, nn
from torch.nn.functional import normalize
from torch.nn.utils import clip_grad_norm_
from torch.optim import Optimizer
from torch.optim.lr_scheduler import LambdaLR

from jointsdf.errors import InputError
from jointsdf.losses import Mixed, Needs, Term
from jointsdf.model.derivatives import mixed_stencil, tangent_frame
from jointsdf.model.field import JointField
from jointsdf.model.fused.evaluate import Evaluation, evaluate
from jointsdf.model.fused.pieces import in_pieces
from jointsdf.optimizers import Group, MuonAdam, parameter_groups
from jointsdf.threads import MAX_PIECE_POINTS
from jointsdf.training.matrix_products import Products, Sizes
from jointsdf.training.random_state import seeded
from jointsdf.training.settings import FitSettings, Objective
from jointsdf.values import FieldValues, Samples, Step


class NonFiniteLossError(InputError):
    """A loss term or the gradient became NaN or infinite; the last checkpoint was written before."""


class JointSDFModule(LightningModule):
    """One field, its objective and its optimizer.

    Args:
        field: The field to fit.
        objective: The weighted loss terms.
        optimizer: Parameter groups -> optimizer.
        settings: Length and learning rates.

    Attributes:
        products: Precision of the matrix products; set by the fit before it starts.
    """

    def __init__(
        self,
        field: JointField,
        objective: Objective,
        optimizer: Callable[[list[Group]], Optimizer],
        settings: FitSettings,
    ) -> None:
        super().__init__()
        self.field, self.objective, self.optimizer, self.settings = field, objective, optimizer, settings
        self.products = Products()
        self.has_dropout = any(isinstance(layer, nn.Dropout) for layer in field.modules())

    def training_step(self, samples: Samples, batch_idx: int) -> Tensor:  # noqa: ARG002 (Lightning's signature)
        """The paper's objective on one step's samples."""
        weights = self.objective.active_weights(self.global_step / self.settings.max_steps)
        terms = {name: self.objective.terms[name] for name in weights}
        step = self.evaluate(samples, merged_needs(terms))
        losses = {name: term(step) for name, term in terms.items()}
        losses["total"] = torch.stack([weights[name] * loss for name, loss in losses.items()]).sum()
        if not torch.isfinite(losses["total"]):
            name, loss = next((name, loss) for name, loss in losses.items() if not torch.isfinite(loss))
            raise NonFiniteLossError(
                f"loss term {name} is {loss.item()} at step {self.global_step}: lower the learning rate or its weight"
            )
        if self.is_logged_step:
            self.log_scalars({f"loss/{name}": loss for name, loss in losses.items()})
        return losses["total"]

    @property
    def is_logged_step(self) -> bool:
        """True if this step's scalars are logged."""
        return (self.global_step + 1) % self.settings.log_every == 0

    def log_scalars(self, scalars: Mapping[str, Tensor]) -> None:
        """Log scalars of this step directly: Lightning's own `log` copies all it holds at every call."""
        if self.logger is not None:
            self.logger.log_metrics({name: value.item() for name, value in scalars.items()}, self.global_step)

    def evaluate(self, samples: Samples, needs: Needs) -> Step:
        """Evaluate the field once per point set, and there only what is needed."""
        fields = {
            name: self._evaluate_set(getattr(samples, name), samples.angles, wanted) for name, wanted in needs.items()
        }
        return Step(fields, samples.labels, samples.normals, samples.pool_distances, samples.far_gradients)

    def _evaluate_set(
        self, points: Float[Tensor, "n 3"], angles: Float[Tensor, " s"], wanted: frozenset[str | Mixed]
    ) -> FieldValues:
        need = next((need for need in wanted if isinstance(need, Mixed)), None)  # at most one: see `merged_needs`
        found = self._pass(
            points,
            grad="grad" in wanted or need is not None,
            angles=angles if need is not None and need.derivative == "exact" else None,
            hessian="hessian" in wanted,
            tap=self.field.trunk.tap if "logits" in wanted else None,
        )
        mixed = found.mixed
        if need is not None and need.derivative == "finite_difference":
            assert found.grad is not None
            u, v = tangent_frame(normalize(found.grad.detach(), dim=-1), angles)
            mixed = mixed_stencil(lambda at: self._pass(at).sdf, points, u, v, need.spacing)
        logits = None if found.feature is None else self._logits(torch.cat([found.feature, points], -1))
        return FieldValues(found.sdf, found.grad, mixed, logits, found.hessian)

    def _logits(self, features: Float[Tensor, "n i"]) -> Float[Tensor, "n k"]:
        head = self.field.head
        if not (self.has_dropout and head.training):
            return in_pieces(head, features)
        with seeded(hash((self.settings.seed, self.global_step)), features.device):
            logits: Tensor = head(features)
        return logits

    def _pass(self, points: Float[Tensor, "n 3"], **wanted: Any) -> Evaluation:
        trunk = self.field.trunk
        low = self.products.dtype("backward")
        return evaluate(trunk.sine_layers, trunk.output, points, backward_dtype=low, **wanted)

    @property
    def sizes(self) -> Sizes:
        """Sizes of a step's matrix products."""
        width, depth = self.field.trunk.feature_width - 3, len(self.field.trunk.sine_layers)
        return Sizes(MAX_PIECE_POINTS, width, depth - 1, self.device)

    def configure_optimizers(self) -> OptimizerLRSchedulerConfig:
        """The optimizer over the named groups, and the learning-rate schedule by step."""
        groups = parameter_groups(self.field.trunk, self.field.head, head_lr=self.settings.head_lr)
        optimizer = self.optimizer(groups)
        if isinstance(optimizer, MuonAdam):
            optimizer.muon.dtype = self.products.dtype("orthogonalisation")

        def head_rate(step: int) -> float:  # plain functions: LambdaLR would store a method's attributes in checkpoints
            return self.rate(step)

        def trunk_rate(step: int) -> float:
            return self.settings.trunk_rate * self.rate(step)

        rates: list[Callable[[int], float]] = [
            head_rate if group["name"] == "head" else trunk_rate for group in optimizer.param_groups
        ]
        return {"optimizer": optimizer, "lr_scheduler": {"scheduler": LambdaLR(optimizer, rates), "interval": "step"}}

    def rate(self, step: int) -> float:
        """Factor on every learning rate at this step: linear warm-up times half cosine, without `trunk_rate`."""
        steps, warmup = self.settings.max_steps, self.settings.warmup
        rising = min(1.0, (step + 1) / max(1.0, warmup * steps))
        return rising * (0.5 * (1 + math.cos(math.pi * min(step / steps, 1.0))) if self.settings.cosine else 1.0)

    def configure_gradient_clipping(
        self,
        optimizer: Optimizer,  # noqa: ARG002 (Lightning's signature)
        gradient_clip_val: float | None = None,  # noqa: ARG002
        gradient_clip_algorithm: str | None = None,  # noqa: ARG002
    ) -> None:
        """Clip trunk and head separately, so that neither's scale decides the other's step."""
        for name, part in (("trunk", self.field.trunk), ("head", self.field.head)):
            parameters = list(part.parameters())
            if not parameters:  # head=none
                continue
            norm = clip_grad_norm_(parameters, self.settings.clip)
            if not torch.isfinite(norm):
                raise NonFiniteLossError(
                    f"gradient norm of the {name} is {norm.item()} at step {self.global_step}: lower the learning rate"
                )
            if self.is_logged_step:
                self.log_scalars({f"gradient_norm/{name}": norm})


def merged_needs(terms: Mapping[str, Term]) -> Needs:
    """Union of the terms' needs, per point set.

    Args:
        terms: Loss terms by name.

    Raises:
        InputError: Two terms want different mixed derivatives on one point set, where a step computes one.
    """
    merged: dict[str, frozenset[str | Mixed]] = {}
    first: dict[str, tuple[str, Mixed]] = {}
    for name, term in terms.items():
        for points, wanted in term.needs.items():
            merged[points] = merged.get(points, frozenset()) | wanted
            for need in wanted:
                if isinstance(need, Mixed) and first.setdefault(points, (name, need))[1] != need:
                    other = first[points][0]
                    raise InputError(
                        f"loss.terms.{other} and loss.terms.{name} want different mixed derivatives on {points}: "
                        "give both the same derivative and spacing"
                    )
    return merged
