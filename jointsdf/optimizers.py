"""Muon on the trunk's hidden matrices and Adam on the rest, as one optimizer: what torch lacks."""

from collections.abc import Callable
from typing import Any

import torch
from torch import nn
from torch.optim import Adam, Muon, Optimizer

from jointsdf.values import InputError

Group = dict[str, Any]


def parameter_groups(trunk: nn.Module, head: nn.Module, *, head_lr: float | None = None) -> list[Group]:
    """The field's parameters by name: `hidden` (the trunk's square matrices), `trunk` (its rest), `head`.

    Any torch optimizer takes the list as it is. A group without parameters is left out.

    Args:
        trunk: The shared trunk.
        head: The segmentation head.
        head_lr: Learning rate of the head, where it is not the optimizer's own.
    """
    parameters = list(trunk.parameters())
    hidden = [p for p in parameters if p.ndim == 2 and p.shape[0] == p.shape[1]]
    rest = [p for p in parameters if not any(p is h for h in hidden)]
    groups: list[Group] = [{"name": "hidden", "params": hidden}, {"name": "trunk", "params": rest}]
    groups.append({"name": "head", "params": list(head.parameters())} | ({} if head_lr is None else {"lr": head_lr}))
    return [group for group in groups if group["params"]]


class MuonAdam(Optimizer):
    """Muon on the group named `hidden`, Adam on every other group, stepped together.

    Args:
        groups: From `parameter_groups`.
        lr: Adam's rate.
        muon_lr: Muon's rate; its steps are orthogonal matrices times this.
        momentum: Muon's momentum.

    Raises:
        InputError: A trunk of one layer, which has no hidden matrix.
    """

    def __init__(self, groups: list[Group], *, lr: float, muon_lr: float, momentum: float = 0.95) -> None:
        hidden = [group for group in groups if group["name"] == "hidden"]
        rest = [group for group in groups if group["name"] != "hidden"]
        if not hidden:
            raise InputError("optimizer=muon needs a hidden matrix: trunk.depth >= 2, or optimizer=adam")
        self.muon = Muon(hidden, lr=muon_lr, weight_decay=0.0, momentum=momentum)
        self.adam = Adam(rest, lr=lr)
        super().__init__(groups, {})
        self.param_groups = self.muon.param_groups + self.adam.param_groups

    def step(self, closure: Callable[[], Any] | None = None) -> Any:
        """One step of both."""
        loss = None
        if closure is not None:
            with torch.enable_grad():
                loss = closure()
        self.muon.step()
        self.adam.step()
        return loss

    def state_dict(self) -> dict[str, Any]:
        """Both states, as plain values."""
        return {"muon": self.muon.state_dict(), "adam": self.adam.state_dict()}

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """Restore both; the groups stay shared with the schedulers."""
        self.muon.load_state_dict(state_dict["muon"])
        self.adam.load_state_dict(state_dict["adam"])
        self.param_groups = self.muon.param_groups + self.adam.param_groups
