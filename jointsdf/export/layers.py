"""The field's network as a list of dense layers, the form that every exported file holds."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float32
from numpy import ndarray
from torch import Tensor, nn

from jointsdf.errors import InputError
from jointsdf.model.heads.deep_skip import DeepSkipHead
from jointsdf.model.heads.none import NoHead
from jointsdf.model.layers import SineLayer


@dataclass(frozen=True, eq=False)  # known by identity
class Dense:
    """Layer `activation(omega (W x + b))`; omega is 1 but for sine layers.

    Attributes:
        weight: W.
        bias: b.
        activation: `sine`, `relu` or `none`.
        omega: Factor on the pre-activation.
        inputs: What x is joined from: 0 the network's input, k the output of its layer k.
    """

    weight: Float32[ndarray, "o i"]
    bias: Float32[ndarray, " o"]
    activation: str
    omega: float
    inputs: tuple[int, ...]


def sine_layers(layers: Iterable[SineLayer]) -> list[Dense]:
    """The trunk's sine layers, each after the one before."""
    return [_dense(layer, (number,)) for number, layer in enumerate(layers)]


def head_layers(head: nn.Module) -> list[Dense]:
    """The layers of a head from [f; x] to the logits; none for a field without parts. Dropout is left out.

    Raises:
        InputError: A head that is no chain of sine, linear, ReLU and dropout layers, and none of those known.
    """
    if isinstance(head, NoHead):
        return []
    if isinstance(head, DeepSkipHead):
        wiring = ((head.first, (0,)), (head.second, (1,)), (head.third, (2, 1, 0)), (head.fourth, (3,)))
        return [*(_dense(layer, inputs) for layer, inputs in wiring), _dense(head.classifier, (4,))]
    chain: list[Dense] = []
    for layer in getattr(head, "layers", head.children()):
        if isinstance(layer, SineLayer | nn.Linear):
            chain.append(_dense(layer, (len(chain),)))
        elif isinstance(layer, nn.ReLU) and chain and chain[-1].activation == "none":
            chain[-1] = Dense(chain[-1].weight, chain[-1].bias, "relu", 1.0, chain[-1].inputs)
        elif not isinstance(layer, nn.Dropout):
            raise InputError(
                f"head {type(head).__name__}: its {type(layer).__name__} has no exported form; use --to field"
            )
    return chain


def _dense(layer: SineLayer | nn.Linear, inputs: tuple[int, ...]) -> Dense:
    linear = layer.linear if isinstance(layer, SineLayer) else layer
    kind, omega = ("sine", layer.omega) if isinstance(layer, SineLayer) else ("none", 1.0)
    return Dense(_array(linear.weight), _array(linear.bias), kind, omega, inputs)


def _array(values: Tensor) -> Any:
    return np.array(values.detach().cpu().numpy(), dtype=np.float32)


def in_half(weight: Float32[ndarray, "..."]) -> Any:
    """The weights as float16 where that loses nothing, as of a field rounded to half precision; else as they are.

    >>> in_half(np.float32([0.5])).dtype, in_half(np.float32([0.1])).dtype
    (dtype('float16'), dtype('float32'))
    """
    with np.errstate(over="ignore"):
        half = weight.astype(np.float16)
    return half if np.array_equal(half.astype(np.float32), weight) else weight
