"""The training step: evaluate the field where the active terms need it, add the weighted terms, guard, log."""

import math
from collections.abc import Callable, Mapping, Sequence
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
from jointsdf.losses import Needs, Term
from jointsdf.losses.schedule import Schedule
from jointsdf.model.derivatives import Mixed, mixed_stencil, tangent_frame
from jointsdf.model.field import JointField
from jointsdf.model.fused.evaluate import Evaluation, evaluate
from jointsdf.model.fused.pieces import in_pieces
from jointsdf.optimizers import Group, MuonAdam, parameter_groups
from jointsdf.threads import MOST
from jointsdf.training.matrix_products import Products, Sizes
from jointsdf.values import FieldValues, Samples, Step


class NonFiniteLossError(InputError):
    """A loss term or the gradient became NaN or infinite; the last checkpoint is from before."""


class JointSDFModule(LightningModule):
    """One field, its objective and its optimizer.

    Args:
        field: What is fitted.
        terms: Loss terms by name.
        weights: Weight of each term, under the same names. Weight 0: the term is not computed.
        schedules: Factor on the weight over the run, for the terms that have one.
        optimizer: Parameter groups -> optimizer.
        max_steps: Length of the run, for the schedules.
        seed: Of the run; dropout masks are a function of (seed, step).
        head_lr: Learning rate of the head where it is not the optimizer's own.
        clip: Largest gradient norm, of the trunk and of the head each.
        cosine: Whether every learning rate falls to 0 along a half cosine.
        warmup: Share of the steps over which the rates rise linearly from 0.
        trunk_rate: Factor on the trunk's learning rates.
        log_every: Steps between two that are logged, the trainer's own number.

    Attributes:
        products: Precision of the matrix products; the fit may choose another before it starts.
    """

    def __init__(
        self,
        field: JointField,
        terms: Mapping[str, Term],
        weights: Mapping[str, float | int],
        schedules: Mapping[str, Schedule],
        optimizer: Callable[[list[Group]], Optimizer],
        *,
        max_steps: int,
        seed: int,
        head_lr: float | None = None,
        clip: float = 10.0,
        cosine: bool = False,
        warmup: float = 0.0,
        trunk_rate: float = 1.0,
        log_every: int = 1,
    ) -> None:
        super().__init__()
        if terms.keys() != weights.keys() or not schedules.keys() <= terms.keys():
            odd = (terms.keys() ^ weights.keys()) | (schedules.keys() - terms.keys())
            raise InputError(f"loss: {', '.join(sorted(odd))} must stand under both terms and weights")
        if min(weights.values()) < 0 or not any(weights.values()):
            raise InputError(f"loss.weights={dict(weights)}: must be >= 0, and one of them > 0")
        self.field = field
        self.terms, self.weights, self.schedules = dict(terms), dict(weights), dict(schedules)
        self.optimizer = optimizer
        self.max_steps, self.seed = max_steps, seed
        self.head_lr, self.clip = head_lr, clip
        self.cosine, self.warmup, self.trunk_rate = cosine, warmup, trunk_rate
        self.products, self.log_every = Products(), log_every
        self.drops = any(isinstance(layer, nn.Dropout) for layer in field.modules())

    def active_weights(self, step: int) -> dict[str, float]:
        """Weight of every term that counts in this step; terms at 0 are left out."""
        share = step / self.max_steps
        scheduled = {
            name: weight * (self.schedules[name](share) if name in self.schedules else 1.0)
            for name, weight in self.weights.items()
        }
        return {name: weight for name, weight in scheduled.items() if weight > 0}

    def training_step(self, samples: Samples, batch_idx: int) -> Tensor:  # noqa: ARG002 (Lightning's signature)
        """The paper's objective on one step's samples."""
        if self.drops:
            torch.manual_seed(hash((self.seed, self.global_step)))
        weights = self.active_weights(self.global_step)
        step = self.evaluate(samples, merged_needs([self.terms[name] for name in weights]))
        losses = {name: self.terms[name](step) for name in weights}
        losses["total"] = torch.stack([weights[name] * loss for name, loss in losses.items()]).sum()
        if not torch.isfinite(losses["total"]):
            name, loss = next((name, loss) for name, loss in losses.items() if not torch.isfinite(loss))
            raise NonFiniteLossError(
                f"loss term {name} is {loss.item()} at step {self.global_step}: lower the learning rate or its weight"
            )
        if self.logs:
            self.report({f"loss/{name}": loss for name, loss in losses.items()})
        return losses["total"]

    @property
    def logs(self) -> bool:
        """Whether this step's numbers are written."""
        return (self.global_step + 1) % self.log_every == 0

    def report(self, numbers: Mapping[str, Tensor]) -> None:
        """Write numbers of this step to the board at once: Lightning's own `log` copies all it holds at every call."""
        if self.logger is not None:
            self.logger.log_metrics({name: number.item() for name, number in numbers.items()}, self.global_step)

    def evaluate(self, samples: Samples, needs: Needs) -> Step:
        """Evaluate the field once per point set, no more than is needed."""
        fields = {
            name: self._evaluate_set(getattr(samples, name), samples.angles, wanted) for name, wanted in needs.items()
        }
        return Step(fields, samples.labels, samples.normals, samples.pool_distances)

    def _evaluate_set(
        self, points: Float[Tensor, "n 3"], angles: Float[Tensor, " s"], wanted: frozenset[str | Mixed]
    ) -> FieldValues:
        how = next((need for need in wanted if isinstance(need, Mixed)), None)
        found = self._pass(
            points,
            grad="grad" in wanted or how is not None,
            angles=angles if how is not None and how.derivative == "exact" else None,
            tap=self.field.trunk.tap if "logits" in wanted else None,
        )
        mixed = found.mixed
        if how is not None and how.derivative == "finite_difference":
            assert found.grad is not None
            u, v = tangent_frame(normalize(found.grad.detach(), dim=-1), angles)
            mixed = mixed_stencil(lambda at: self._pass(at).sdf, points, u, v, how.spacing)
        logits = None if found.feature is None else self._logits(torch.cat([found.feature, points], -1))
        return FieldValues(found.sdf, found.grad, mixed, logits)

    def _logits(self, features: Float[Tensor, "n i"]) -> Float[Tensor, "n k"]:
        head = self.field.head
        logits: Tensor = head(features) if self.drops and head.training else in_pieces(head, features)
        return logits

    def _pass(self, points: Float[Tensor, "n 3"], **wanted: Any) -> Evaluation:
        trunk = self.field.trunk
        low = self.products.dtype("backward")
        return evaluate(trunk.sine_layers, trunk.output, points, backward_dtype=low, **wanted)

    @property
    def sizes(self) -> Sizes:
        """What a step multiplies."""
        width, depth = self.field.trunk.feature_width - 3, len(self.field.trunk.sine_layers)
        return Sizes(MOST, width, depth - 1, self.device)

    def configure_optimizers(self) -> OptimizerLRSchedulerConfig:
        """The optimizer over the named groups, and the learning-rate schedule by step."""
        groups = parameter_groups(self.field.trunk, self.field.head, head_lr=self.head_lr)
        optimizer = self.optimizer(groups)
        if isinstance(optimizer, MuonAdam):
            optimizer.muon.dtype = self.products.dtype("orthogonalisation")

        def of_head(step: int) -> float:  # plain functions: LambdaLR would store a method's attributes in checkpoints
            return self.rate(step)

        def of_trunk(step: int) -> float:
            return self.trunk_rate * self.rate(step)

        rates: list[Callable[[int], float]] = [
            of_head if group["name"] == "head" else of_trunk for group in optimizer.param_groups
        ]
        return {"optimizer": optimizer, "lr_scheduler": {"scheduler": LambdaLR(optimizer, rates), "interval": "step"}}

    def rate(self, step: int) -> float:
        """Factor on every learning rate at this step, beside `trunk_rate`."""
        share = step / self.max_steps
        rising = min(1.0, (step + 1) / max(1.0, self.warmup * self.max_steps))
        return rising * (0.5 * (1 + math.cos(math.pi * min(share, 1.0))) if self.cosine else 1.0)

    def configure_gradient_clipping(
        self,
        optimizer: Optimizer,  # noqa: ARG002 (Lightning's signature)
        gradient_clip_val: float | None = None,  # noqa: ARG002
        gradient_clip_algorithm: str | None = None,  # noqa: ARG002
    ) -> None:
        """Clip trunk and head apart, so that neither's scale decides the other's step."""
        for name, part in (("trunk", self.field.trunk), ("head", self.field.head)):
            parameters = list(part.parameters())
            if not parameters:  # head=none
                continue
            norm = clip_grad_norm_(parameters, self.clip)
            if not torch.isfinite(norm):
                raise NonFiniteLossError(
                    f"gradient norm of the {name} is {norm.item()} at step {self.global_step}: lower the learning rate"
                )
            if self.logs:
                self.report({f"gradient_norm/{name}": norm})


def merged_needs(terms: Sequence[Term]) -> Needs:
    """The union of what the terms need, per point set."""
    merged: dict[str, frozenset[str | Mixed]] = {}
    for term in terms:
        for name, wanted in term.needs.items():
            merged[name] = merged.get(name, frozenset()) | wanted
    return merged
