"""Backward half of the training pass (formulas in `sine_pass`): adjoints of the record, down to the parameters."""

import torch
from torch import Tensor

from jointsdf.model.fused.forward import Layers, Record

Bars = list[Tensor | None]  # adjoints, one per layer


def backward(net: Layers, record: Record, tap: int | None, bars: Bars) -> list[Tensor]:
    """One piece's share of the parameter gradients, going through the forward pass in reverse order.

    Returns:
        Adjoints of W_1, b_1, W_2, ..., w, b; omega is not yet in them.
    """
    sums = [torch.zeros_like(x) for pair in zip(net.weights, net.biases, strict=True) for x in pair]
    sums += [torch.zeros_like(net.output), torch.zeros_like(net.offset)]
    sdf_bar, feature_bar, grad_bar, mixed_bar = bars
    sine_bars, cosine_bars, adjoint_bars = (_none(net) for _ in range(3))
    if mixed_bar is not None:
        sine_bars, cosine_bars, adjoint_bars = _hessian_vector_bars(net, record, mixed_bar, sums)
    if grad_bar is not None or mixed_bar is not None:
        start = torch.zeros_like(record.points) if grad_bar is None else grad_bar
        sums[-2] += _gradient_bars(net, record, start, cosine_bars, adjoint_bars, sums)
    if sdf_bar is not None:
        sums[-2] += sdf_bar @ record.sines[-1]
        sums[-1] += sdf_bar.sum()
        sine_bars[-1] = _plus(sine_bars[-1], sdf_bar[:, None], net.output)
    if feature_bar is not None and tap:
        sine_bars[tap - 1] = feature_bar if (own := sine_bars[tap - 1]) is None else own + feature_bar
    _value_bars(net, record, sine_bars, cosine_bars, sums)
    return sums


def _hessian_vector_bars(net: Layers, record: Record, mixed_bar: Tensor, sums: list[Tensor]) -> tuple[Bars, Bars, Bars]:
    """Adjoints of h_i, c_i and g_i, from q_0 up through the layers and from t_L down again."""
    assert record.frame is not None
    sine_bars, cosine_bars, adjoint_bars = (_none(net) for _ in range(3))
    argument_tangent_bars: list[Tensor] = []
    q_bar = mixed_bar[:, None] * record.frame[1]
    for i, low in enumerate(net.low):
        right = q_bar.to(low.dtype)
        _accumulate(sums[2 * i], record.curvature(i).to(low.dtype), right)
        e_bar = (right @ low.T).to(q_bar.dtype)
        h, c, g = record.sines[i], record.cosines[i], record.adjoints[i]
        p, q = record.argument_tangents[i], record.adjoint_tangents[i]
        cosine_bars[i] = None if q is None else q * e_bar
        q_bar = c * e_bar
        g_e, h_e = (g * e_bar).neg_(), (h * e_bar).neg_()
        sine_bars[i] = p * g_e
        argument_tangent_bars.append(h * g_e)
        adjoint_bars[i] = p * h_e
    t_bar: Tensor | None = None
    for i in range(len(net.low) - 1, -1, -1):
        p_bar = argument_tangent_bars[i]
        if t_bar is not None:
            p_bar.addcmul_(record.cosines[i], t_bar)
            cosine_bars[i] = _plus(cosine_bars[i], record.argument_tangents[i], t_bar)
        left = p_bar.to(net.low[i].dtype)
        _accumulate(sums[2 * i], left, record.tangent(i).to(left.dtype))
        t_bar = (left @ net.low[i]).to(p_bar.dtype) if i else None
    return sine_bars, cosine_bars, adjoint_bars


def _gradient_bars(
    net: Layers,
    record: Record,
    grad_bar: Tensor,
    cosine_bars: Bars,
    adjoint_bars: Bars,
    sums: list[Tensor],
) -> Tensor:
    """Add to the adjoints of c_i, from g_0 up through the layers; returns that of w = g_L."""
    g_bar = grad_bar
    for i, low in enumerate(net.low):
        right = g_bar.to(low.dtype)
        _accumulate(sums[2 * i], (record.cosines[i] * record.adjoints[i]).to(low.dtype), right)
        d_bar = (right @ low.T).to(g_bar.dtype)
        cosine_bars[i] = _plus(cosine_bars[i], record.adjoints[i], d_bar)
        g_bar = _plus(adjoint_bars[i], record.cosines[i], d_bar)
    return g_bar.sum(0)


def _value_bars(net: Layers, record: Record, sine_bars: Bars, cosine_bars: Bars, sums: list[Tensor]) -> None:
    """From f down through the layers."""
    from_above: Tensor | None = None
    for i in range(len(net.low) - 1, -1, -1):
        h_bar, c_bar = sine_bars[i], cosine_bars[i]
        if from_above is not None:
            h_bar = from_above if h_bar is None else h_bar + from_above
        if h_bar is None and c_bar is None:
            continue
        a_bar = torch.zeros_like(record.sines[i]) if h_bar is None else record.cosines[i] * h_bar
        if c_bar is not None:
            a_bar.addcmul_(record.sines[i], c_bar, value=-1)
        left = a_bar.to(net.low[i].dtype)
        _accumulate(sums[2 * i], left, record.inputs(i).to(left.dtype))
        sums[2 * i + 1] += a_bar.sum(0)
        from_above = (left @ net.low[i]).to(a_bar.dtype) if i else None


def _none(net: Layers) -> Bars:
    return [None] * len(net.weights)


def _accumulate(total: Tensor, left: Tensor, right: Tensor) -> None:
    """Add left^T right to the total."""
    if left.dtype == total.dtype:
        total.addmm_(left.T, right)
    else:
        total += left.T @ right


def _plus(total: Tensor | None, a: Tensor, b: Tensor) -> Tensor:
    """The total plus a b, in the total's own memory."""
    return a * b if total is None else total.addcmul_(a, b)
