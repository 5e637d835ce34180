"""Settings of a fit: objective, length and learning rates."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from jointsdf.errors import InputError, require_integer, require_number
from jointsdf.losses import Term
from jointsdf.losses.schedule import Schedule


@dataclass(frozen=True)
class Objective:
    """A weighted sum of loss terms, whose weights may follow schedules.

    Attributes:
        terms: Loss terms by name.
        weights: Weight of each term, under the same names. A term of weight 0 is not computed.
        schedules: Factor on the weight over the run, for the terms that have one.

    Raises:
        InputError: The names differ, a weight is negative, or none is above 0.
    """

    terms: Mapping[str, Term]
    weights: Mapping[str, float | int]
    schedules: Mapping[str, Schedule] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check names and weights."""
        if odd := (self.terms.keys() ^ self.weights.keys()) | (self.schedules.keys() - self.terms.keys()):
            raise InputError(f"loss: {', '.join(sorted(odd))} must stand under both terms and weights")
        for name, weight in self.weights.items():
            require_number(f"loss.weights.{name}", weight, 0)
        if not any(self.weights.values()):
            raise InputError(f"loss.weights={dict(self.weights)}: one of them must be > 0")

    def active_weights(self, share: float) -> dict[str, float]:
        """Weights above 0 when this share of the steps (0..1) is done."""
        scheduled = {
            name: weight * (self.schedules[name](share) if name in self.schedules else 1.0)
            for name, weight in self.weights.items()
        }
        return {name: weight for name, weight in scheduled.items() if weight > 0}


@dataclass(frozen=True)
class FitSettings:
    """Length and learning rates of a fit.

    Attributes:
        max_steps: Length of the run.
        seed: Seed of the run; dropout masks are a function of (seed, step).
        head_lr: Learning rate of the head; None for the optimizer's own.
        clip: Largest gradient norm, of the trunk and of the head each.
        cosine: Whether every learning rate falls to 0 along a half cosine.
        warmup: Share of the steps over which the rates rise linearly from 0.
        trunk_rate: Factor on the trunk's learning rates.
        log_every: Steps between two logged ones.
        refit: Iterations of L-BFGS on the head's last layer after the steps; 0 for none.

    Raises:
        InputError: A value out of its range.
    """

    max_steps: int
    seed: int = 0
    head_lr: float | None = None
    clip: float = 10.0
    cosine: bool = False
    warmup: float = 0.0
    trunk_rate: float = 1.0
    log_every: int = 1
    refit: int = 0

    def __post_init__(self) -> None:
        """Check the ranges."""
        require_integer("seed", self.seed, 0)
        require_integer("trainer.max_steps", self.max_steps, 1)
        require_integer("trainer.log_every", self.log_every, 1)
        require_integer("trainer.refit", self.refit, 0)
        require_number("trainer.clip", self.clip, 1e-12)
        require_number("trainer.warmup", self.warmup, 0, 1)
        if self.head_lr is not None:
            require_number("trainer.head_lr", self.head_lr, 0, 1e6)
