"""Muon on the trunk's hidden matrices, Adam on the other parameters, as one optimizer."""

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.optim import Adam, Optimizer

from jointsdf.errors import InputError
from jointsdf.threads import over_threads, workers

Group = dict[str, Any]
Polynomial = tuple[float, float, float]  # a, b, c of a x + b x^3 + c x^5

# Newton-Schulz iterations: odd polynomials, applied in turn, that take singular values in (0, 1] near 1.
ITERATIONS: dict[str, Sequence[Polynomial]] = {
    # Jordan, "Muon" (2024): five times one polynomial steep at 0; singular values above 0.002 end in 0.68 to 1.21.
    "five": ((3.4445, -4.7750, 2.0315),) * 5,
    # Amsel et al., "The Polar Express" (2025): each the minimax polynomial of its degree on the range of the one
    # before. Singular values above 0.003 end in 0.80 to 1.20 with four, above 0.01 in 0.73 to 1.27 with three.
    "four": (
        (8.383674, -24.765906, 18.357082),
        (4.043420, -3.011405, 0.569512),
        (3.505571, -2.626654, 0.525719),
        (2.490116, -1.834275, 0.436835),
    ),
    "three": (
        (8.093369, -23.620430, 17.446152),
        (3.636586, -2.721927, 0.536546),
        (2.661300, -1.977155, 0.452616),
    ),
}


def parameter_groups(trunk: nn.Module, head: nn.Module, *, head_lr: float | None = None) -> list[Group]:
    """The field's parameters by name: `hidden` (the trunk's square matrices), `trunk` (its rest), `head`.

    Any torch optimizer takes the list as it is. A group without parameters is left out.

    Args:
        trunk: The shared trunk.
        head: The segmentation head.
        head_lr: Learning rate of the head; None for the optimizer's own.

    >>> [group["name"] for group in parameter_groups(nn.Linear(2, 2), nn.Identity())]
    ['hidden', 'trunk']
    """
    parameters = list(trunk.parameters())
    hidden = [p for p in parameters if p.ndim == 2 and p.shape[0] == p.shape[1]]
    rest = [p for p in parameters if not any(p is h for h in hidden)]
    groups: list[Group] = [{"name": "hidden", "params": hidden}, {"name": "trunk", "params": rest}]
    groups.append({"name": "head", "params": list(head.parameters())} | ({} if head_lr is None else {"lr": head_lr}))
    return [group for group in groups if group["params"]]


class Muon(Optimizer):
    """Momentum orthogonalised by Newton-Schulz iteration (Jordan et al., "Muon", 2024).

    The arithmetic is that of `torch.optim.Muon` (Nesterov momentum, no weight decay, rates times
    sqrt(max(1, rows / columns))), with two differences: matrices of one shape are orthogonalised together, and the
    precision is selectable, where torch uses bfloat16 on every processor.

    Args:
        params: Matrices.
        lr: Learning rate; a step is a near-orthogonal matrix times this.
        momentum: Decay of the running mean of the gradients per step.
        iterations: Name in `ITERATIONS`.

    Raises:
        InputError: Momentum out of range, or iterations of an unknown name.

    Attributes:
        dtype: Precision of the iteration's matrix products; None for that of the matrices.
    """

    def __init__(self, params: Iterable[Any], *, lr: float, momentum: float = 0.95, iterations: str = "five") -> None:
        if not 0 <= momentum < 1:
            raise InputError(f"optimizer.momentum={momentum}: give a number from 0 to below 1")
        if iterations not in ITERATIONS:
            raise InputError(f"optimizer.iterations={iterations}: accepted are {', '.join(ITERATIONS)}")
        self.dtype: torch.dtype | None = None
        self.polynomials = ITERATIONS[iterations]
        super().__init__(params, {"lr": lr, "momentum": momentum})

    @torch.no_grad()
    def step(self, closure: Callable[[], Any] | None = None) -> Any:  # noqa: ARG002 (torch's signature)
        """Update the parameters that have a gradient."""
        for group in self.param_groups:
            alike: dict[torch.Size, list[tuple[Tensor, Tensor]]] = {}
            for parameter in group["params"]:
                if parameter.grad is not None:
                    ahead = self._lookahead(parameter, parameter.grad, group["momentum"])
                    alike.setdefault(parameter.shape, []).append((parameter, ahead))
            for (rows, columns), moved in alike.items():
                directions = orthogonalise(torch.stack([ahead for _, ahead in moved]), self.polynomials, self.dtype)
                rate = group["lr"] * math.sqrt(max(1.0, rows / columns))
                for (parameter, _), direction in zip(moved, directions, strict=True):
                    parameter.sub_(direction, alpha=rate)

    def _lookahead(self, parameter: Tensor, gradient: Tensor, momentum: float) -> Tensor:
        """Update the running mean, and return Nesterov's mean of it and the gradient."""
        state = self.state[parameter]
        if "momentum_buffer" not in state:
            state["momentum_buffer"] = torch.zeros_like(parameter)
        return gradient.lerp(state["momentum_buffer"].lerp_(gradient, 1 - momentum), momentum)


def orthogonalise(
    matrices: Float[Tensor, "k r c"], polynomials: Sequence[Polynomial], dtype: torch.dtype | None = None
) -> Float[Tensor, "k r c"]:
    """Approximate polar factors by Newton-Schulz iteration: U p(S / |S|) V^T near U V^T, for each matrix U S V^T.

    Args:
        matrices: Any; they are divided by their Frobenius norms first, so that no singular value is above 1.
        polynomials: p, applied in turn to the singular values, from `ITERATIONS`.
        dtype: Precision of the products; None for that of the matrices.

    Returns:
        Matrices of the given shape and precision.

    >>> orthogonalise(torch.diag(torch.tensor([3.0, 2.0]))[None], ITERATIONS["four"]).round(decimals=1)
    tensor([[[0.9000, 0.0000],
             [0.0000, 0.8000]]])
    """
    tall = matrices.shape[1] > matrices.shape[2]
    wide = matrices.mT if tall else matrices
    x = (wide / torch.linalg.matrix_norm(wide, keepdim=True).clamp(min=1e-7)).to(dtype or wide.dtype)

    def iterate(part: Tensor) -> Tensor:
        for a, b, c in polynomials:
            gram = part @ part.mT
            part = torch.baddbmm(part, torch.baddbmm(gram, gram, gram, beta=b, alpha=c), part, beta=a)
        return part

    shares = 1 if x.is_cuda else max(1, min(len(x), workers()))
    found = torch.cat(over_threads(iterate, x.tensor_split(shares))).to(matrices.dtype)
    return found.mT if tall else found


class MuonAdam(Optimizer):
    """Muon on the group named `hidden`, Adam on every other group, stepped together.

    Args:
        groups: From `parameter_groups`.
        lr: Adam's learning rate.
        muon_lr: Muon's learning rate.
        momentum: Muon's momentum.
        iterations: Muon's iterations, a name in `ITERATIONS`.

    Raises:
        InputError: A trunk of one layer, which has no hidden matrix; iterations of an unknown name.
    """

    def __init__(
        self, groups: list[Group], *, lr: float, muon_lr: float, momentum: float = 0.95, iterations: str = "five"
    ) -> None:
        hidden = [group for group in groups if group["name"] == "hidden"]
        rest = [group for group in groups if group["name"] != "hidden"]
        if not hidden:
            raise InputError("optimizer=muon needs a hidden matrix: trunk.depth >= 2, or optimizer=adam")
        self.muon = Muon(hidden, lr=muon_lr, momentum=momentum, iterations=iterations)
        self.adam = Adam(rest, lr=lr)
        super().__init__(groups, {})
        self.param_groups = self.muon.param_groups + self.adam.param_groups

    def step(self, closure: Callable[[], Any] | None = None) -> Any:
        """Step both; the closure is called once, with gradients on."""
        loss = None
        if closure is not None:
            with torch.enable_grad():
                loss = closure()
        self.muon.step()
        self.adam.step()
        return loss

    def state_dict(self) -> dict[str, Any]:
        """States of both, as plain values."""
        return {"hidden": self.muon.state_dict(), "rest": self.adam.state_dict()}

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """Restore both; the groups stay shared with the schedulers.

        Raises:
            InputError: The state is that of torch's own Muon with Adam, as version 0.1.0 wrote it.
        """
        if "muon" in state_dict:
            raise InputError(
                "the checkpoint holds the state of torch.optim.Muon, which optimizer=muon no longer is; "
                "resume=never starts the fit over"
            )
        self.muon.load_state_dict(state_dict["hidden"])
        self.adam.load_state_dict(state_dict["rest"])
        self.param_groups = self.muon.param_groups + self.adam.param_groups
