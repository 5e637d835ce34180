"""Backward half of the fused pass (formulas in `evaluate.py`): from adjoints of the outputs to those of the parameters.

An adjoint of x, the derivative of the loss by x, is named x_bar; where no loss depends on x it is None, not zeros.
"""

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from jointsdf.model.fused.forward import Layers, Record

Bars = list[Tensor | None]  # one per layer


class OutputBars(NamedTuple):
    """Adjoints of the outputs of the pass, in their order."""

    sdf: Tensor | None
    feature: Tensor | None
    grad: Tensor | None
    mixed: Tensor | None
    hessian: Tensor | None


@dataclass
class LayerBars:
    """Adjoints of h_i, c_i and g_i, as far as they are known on the way through the record."""

    sines: Bars
    cosines: Bars
    adjoints: Bars

    @classmethod
    def none(cls, layers: int) -> "LayerBars":
        """None in any layer."""
        return cls([None] * layers, [None] * layers, [None] * layers)


@dataclass
class ParameterBars:
    """Adjoints of the parameters; of W_i and b_i with omega in them until `unscale`."""

    weights: list[Tensor]
    biases: list[Tensor]
    output: Tensor
    offset: Tensor

    @classmethod
    def zeros(cls, net: Layers) -> "ParameterBars":
        """Zeros to add to."""
        return cls(
            [torch.zeros_like(weight) for weight in net.weights],
            [torch.zeros_like(bias) for bias in net.biases],
            torch.zeros_like(net.output),
            torch.zeros_like(net.offset),
        )

    def in_order(self) -> list[Tensor]:
        """W_1, b_1, W_2, ..., w, b."""
        layers = [bar for pair in zip(self.weights, self.biases, strict=True) for bar in pair]
        return [*layers, self.output, self.offset]

    def add(self, other: "ParameterBars") -> None:
        """Add another piece's share, in place."""
        for total, share in zip(self.in_order(), other.in_order(), strict=True):
            total += share

    def unscale(self, omegas: list[float]) -> None:
        """From adjoints of omega W and omega b to those of W and b, in place."""
        for weight, bias, omega in zip(self.weights, self.biases, omegas, strict=True):
            weight.mul_(omega)
            bias.mul_(omega)


def backward(net: Layers, record: Record, tap: int | None, outputs: OutputBars) -> ParameterBars:
    """One piece's share of the parameter gradients, going through the forward pass in reverse order."""
    sums, layers = ParameterBars.zeros(net), LayerBars.none(len(net.weights))
    if outputs.mixed is not None:
        _reverse_hessian_vector(net, record, outputs.mixed, layers, sums)
    if outputs.hessian is not None:
        _reverse_hessian(net, record, outputs.hessian, layers, sums)
    if any(bar is not None for bar in (outputs.grad, outputs.mixed, outputs.hessian)):
        start = torch.zeros_like(record.points) if outputs.grad is None else outputs.grad
        sums.output += _reverse_gradient(net, record, start, layers, sums)
    if outputs.sdf is not None:
        sums.output += outputs.sdf @ record.sines[-1]
        sums.offset += outputs.sdf.sum()
        layers.sines[-1] = _plus(layers.sines[-1], outputs.sdf[:, None], net.output)
    if outputs.feature is not None and tap:
        own = layers.sines[tap - 1]
        layers.sines[tap - 1] = outputs.feature if own is None else own + outputs.feature
    _reverse_value(net, record, layers, sums)
    return sums


def _reverse_hessian_vector(
    net: Layers, record: Record, mixed_bar: Tensor, layers: LayerBars, sums: ParameterBars
) -> None:
    """Set the adjoints of h_i, c_i and g_i, from q_0 up through the layers and from t_L down again."""
    assert record.frame is not None
    argument_tangent_bars: list[Tensor] = []
    q_bar = mixed_bar[:, None] * record.frame[1]
    for i, low in enumerate(net.low_precision):
        right = q_bar.to(low.dtype)
        _accumulate(sums.weights[i], record.curvature(i).to(low.dtype), right)
        e_bar = (right @ low.T).to(q_bar.dtype)
        h, c, g = record.sines[i], record.cosines[i], record.adjoints[i]
        p, q = record.argument_tangents[i], record.adjoint_tangents[i]
        layers.cosines[i] = None if q is None else q * e_bar
        q_bar = c * e_bar
        g_e, h_e = (g * e_bar).neg_(), (h * e_bar).neg_()
        layers.sines[i] = p * g_e
        argument_tangent_bars.append(h * g_e)
        layers.adjoints[i] = p * h_e
    t_bar: Tensor | None = None
    for i in range(len(net.low_precision) - 1, -1, -1):
        p_bar = argument_tangent_bars[i]
        if t_bar is not None:
            p_bar.addcmul_(record.cosines[i], t_bar)
            layers.cosines[i] = _plus(layers.cosines[i], record.argument_tangents[i], t_bar)
        left = p_bar.to(net.low_precision[i].dtype)
        _accumulate(sums.weights[i], left, record.tangent(i).to(left.dtype))
        t_bar = (left @ net.low_precision[i]).to(p_bar.dtype) if i else None


def _reverse_hessian(net: Layers, record: Record, hessian_bar: Tensor, layers: LayerBars, sums: ParameterBars) -> None:
    """Add to the adjoints of h_i, c_i and g_i, from P_L down through the layers."""
    symmetric = hessian_bar + hessian_bar.mT
    from_above: Tensor | None = None  # adjoint of c_i P_i
    for i in range(len(net.low_precision) - 1, -1, -1):
        h, c, g, jacobian = record.sines[i], record.cosines[i], record.adjoints[i], record.jacobians[i]
        jacobian_bar = symmetric @ jacobian
        product_bar = (jacobian * jacobian_bar).sum(1).mul_(-0.5)  # of h_i g_i
        layers.sines[i] = _plus(layers.sines[i], g, product_bar)
        layers.adjoints[i] = _plus(layers.adjoints[i], h, product_bar)
        jacobian_bar.mul_((h * g).neg_()[:, None])
        if from_above is not None:
            c_bar = (jacobian * from_above).sum(1)
            before = layers.cosines[i]
            layers.cosines[i] = c_bar if before is None else before + c_bar
            jacobian_bar.addcmul_(c[:, None], from_above)
        if not i:
            sums.weights[0] += jacobian_bar.sum(0).T
            return
        left = jacobian_bar.flatten(0, 1).to(net.low_precision[i].dtype)
        _accumulate(sums.weights[i], left, record.output_jacobian(i).flatten(0, 1).to(left.dtype))
        from_above = (left @ net.low_precision[i]).to(jacobian_bar.dtype).view_as(record.jacobians[i - 1])


def _reverse_gradient(net: Layers, record: Record, grad_bar: Tensor, layers: LayerBars, sums: ParameterBars) -> Tensor:
    """Add to the adjoints of c_i, from g_0 up through the layers; returns that of w = g_L."""
    g_bar = grad_bar
    for i, low in enumerate(net.low_precision):
        right = g_bar.to(low.dtype)
        _accumulate(sums.weights[i], (record.cosines[i] * record.adjoints[i]).to(low.dtype), right)
        d_bar = (right @ low.T).to(g_bar.dtype)
        layers.cosines[i] = _plus(layers.cosines[i], record.adjoints[i], d_bar)
        g_bar = _plus(layers.adjoints[i], record.cosines[i], d_bar)
    return g_bar.sum(0)


def _reverse_value(net: Layers, record: Record, layers: LayerBars, sums: ParameterBars) -> None:
    """Add to the adjoints of the parameters, from f down through the layers."""
    from_above: Tensor | None = None
    for i in range(len(net.low_precision) - 1, -1, -1):
        h_bar, c_bar = layers.sines[i], layers.cosines[i]
        if from_above is not None:
            h_bar = from_above if h_bar is None else h_bar + from_above
        if h_bar is None and c_bar is None:
            continue
        a_bar = torch.zeros_like(record.sines[i]) if h_bar is None else record.cosines[i] * h_bar
        if c_bar is not None:
            a_bar.addcmul_(record.sines[i], c_bar, value=-1)
        left = a_bar.to(net.low_precision[i].dtype)
        _accumulate(sums.weights[i], left, record.inputs(i).to(left.dtype))
        sums.biases[i] += a_bar.sum(0)
        from_above = (left @ net.low_precision[i]).to(a_bar.dtype) if i else None


def _accumulate(total: Tensor, left: Tensor, right: Tensor) -> None:
    """Add left^T right to the total, in place."""
    if left.dtype == total.dtype:
        total.addmm_(left.T, right)
    else:
        total += left.T @ right


def _plus(total: Tensor | None, a: Tensor, b: Tensor) -> Tensor:
    """The total plus a b, in the total's own memory."""
    return a * b if total is None else total.addcmul_(a, b)
