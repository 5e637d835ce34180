"""One training step against the same losses in the released formulation (`released`), and against the machine's peak.

A step is: gradients to zero, objective, backward, clip, Adam. One thread; no head, as in the released code; `flatcad`
objective, with the curvature term (ODW) at its full weight and at weight 0.
On our side freed memory is kept for the next step, as in a run; on the other it goes back by glibc's own rule.
"""

from collections.abc import Callable, Mapping

import torch
from torch import Tensor

from benchmarks import released
from benchmarks.scene import built, composed, measured
from benchmarks.table import Row, interleaved, machine
from jointsdf.losses import Term
from jointsdf.training.module import JointSDFModule, merged_needs
from jointsdf.values import Samples, Step

PASSES = {True: 3 + 6 + 12, False: 3 + 6 + 6}  # of matrix products over a point set: uniform, surface, near; with ODW
TARGETS = {True: 3.5, False: 5.0}
OBJECTIVE = ("recipe=paper", "loss=flatcad", "head=none", "trunk.hidden_omega=30", "trainer.backward=float32")
CLAIMED = 20000  # points a set, of the targets
LARGEST_ERROR = 1e-3  # of float32 gradients: where a derivative is nearly 0, its sign may differ between the two sides


def rows(sizes: tuple[int, ...] = (2000, 20000), repetitions: int = 3) -> list[Row]:
    """Both sides with ODW and without; on the other side torch's own matrix products, then the same as on ours."""
    return [row for points in sizes for odw in (True, False) for row in _rows(points, repetitions, odw=odw)]


def _rows(points: int, repetitions: int, *, odw: bool) -> list[Row]:
    module, samples = prepared(points)
    ours = measured(composed(*OBJECTIVE), module).matmul
    weights = weights_of(module, odw=odw)
    error = gradient_error(module, samples, weights)
    assert error < LARGEST_ERROR, f"the gradients differ by {error:.1e}"
    fast, slow, equal = interleaved(
        repetitions,
        timed(module, lambda: our_loss(module, samples, weights), ours, keep_memory=True),
        timed(module, lambda: released_loss(module, samples, weights), "default"),
        timed(module, lambda: released_loss(module, samples, weights), ours),
    )
    name = f"step, {points} points a set, {'with' if odw else 'without'} ODW"
    target = TARGETS[odw] if points == CLAIMED else None
    return [
        Row(name, "released formulation as released", fast, slow, "s", slow / fast, target),
        Row(name, f"released formulation, {ours} matrix products", fast, equal, "s", equal / fast),
        share(name, module, points, PASSES[odw], fast, ours),
        share(name, module, points, PASSES[odw], fast, "default"),
    ]


def prepared(points: int) -> tuple[JointSDFModule, Samples]:
    """A field at its start and one step's samples, so many in each set."""
    counts = [f"data.counts.{name}={points}" for name in ("manifold", "non_manifold", "shell")]
    _, data, module = built(composed(*OBJECTIVE, *counts))
    return module, data.sampler.draw(0)


def weights_of(module: JointSDFModule, *, odw: bool) -> dict[str, float]:
    """Weights of the geometric terms."""
    weights = {
        name: float(weight) for name, weight in module.objective.weights.items() if weight and name != "cross_entropy"
    }
    return weights | ({} if odw else {"weingarten": 0.0})


def our_loss(module: JointSDFModule, samples: Samples, weights: Mapping[str, float]) -> Tensor:
    """The objective as a run evaluates it: terms of weight 0 are not computed."""
    terms = {name: module.objective.terms[name] for name, weight in weights.items() if weight}
    return total(module.evaluate(samples, merged_needs(terms)), terms, weights)


def released_loss(module: JointSDFModule, samples: Samples, weights: Mapping[str, float]) -> Tensor:
    """The objective in the released formulation: every term is computed."""
    step = released.evaluate(lambda points: module.field.trunk(points)[0], samples)
    return total(step, {name: module.objective.terms[name] for name in weights}, weights)


def total(step: Step, terms: Mapping[str, Term], weights: Mapping[str, float]) -> Tensor:
    """Weighted sum of terms."""
    return torch.stack([weights[name] * term(step) for name, term in terms.items()]).sum()


def timed(
    module: JointSDFModule, loss: Callable[[], Tensor], matmul: str, *, keep_memory: bool = False
) -> Callable[[], None]:
    """One whole step, to be timed; the learning rate is 0, so that every repetition is the same."""
    parameters = list(module.field.trunk.parameters())
    optimizer = torch.optim.Adam(parameters, lr=0.0)

    def step() -> None:
        with machine(1, matmul, keep_memory=keep_memory):
            optimizer.zero_grad()
            loss().backward()
            torch.nn.utils.clip_grad_norm_(parameters, module.settings.clip)
            optimizer.step()

    return step


def gradient_error(module: JointSDFModule, samples: Samples, weights: Mapping[str, float]) -> float:
    """Largest relative difference between both sides' gradients, over the parameters."""
    parameters = list(module.field.trunk.parameters())
    sides = [torch.autograd.grad(loss(module, samples, weights), parameters) for loss in (our_loss, released_loss)]
    return max(float((a - b).norm() / b.norm()) for a, b in zip(*sides, strict=True))


def share(name: str, module: JointSDFModule, points: int, passes: int, seconds: float, matmul: str) -> Row:
    """The step's rate of arithmetic, of hidden layers alone, against plain matrix products of the same shapes."""
    layers = [layer.linear for layer in module.field.trunk.sine_layers[1:]]
    flop = 2 * points * passes * sum(layer.weight.numel() for layer in layers)
    peak = max(product_rate(1000, layers[0].in_features, matmul, across=across) for across in (False, True))
    rate = flop / seconds / 1e9
    target = 0.7 if points == CLAIMED and matmul == "onednn" else None
    return Row(name, f"peak of {matmul} float32 products, same shapes", rate, peak, "GFLOP/s", rate / peak, target)


def product_rate(points: int, width: int, matmul: str, *, across: bool) -> float:
    """GFLOP/s of one matrix product of a pass; `across` the points for the gradient of the weights."""
    values, weights = torch.randn(points, width), torch.randn(width, width)
    other = torch.randn(points, width)
    count = 200

    def products() -> None:
        with machine(1, matmul):
            for _ in range(count):
                _ = values.T @ other if across else values @ weights

    (seconds,) = interleaved(3, products)
    return count * 2 * points * width**2 / seconds / 1e9
