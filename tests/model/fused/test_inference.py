"""The inference pass against plain autograd, at any size, number of points and of threads."""

from collections.abc import Iterator

import pytest
import torch
from sine_networks import NETWORKS, network, plain, random_points, relative
from torch import Tensor

from jointsdf import threads
from jointsdf.model.composition import evaluate_with_graph
from jointsdf.model.derivatives import autograd_gradient
from jointsdf.model.fused import inference
from jointsdf.model.fused.inference import Inferred, TappedHead, infer
from jointsdf.model.heads.siren import SirenHead
from jointsdf.model.trunk import SirenTrunk
from jointsdf.values import BOX

Sizes = tuple[int, int, float, float]


@pytest.fixture(params=[1, 3])
def number(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Threads, which share pieces of a few points."""
    monkeypatch.setattr(inference, "PIECE", 7)
    monkeypatch.setattr(threads, "MIN_PIECE_POINTS", 2)
    before = torch.get_num_threads()
    torch.set_num_threads(request.param)
    yield request.param
    torch.set_num_threads(before)


def squares(features: Tensor) -> Tensor:
    """A head whose answers show the order of its inputs."""
    return features.square().cumsum(1)


@pytest.mark.usefixtures("number")
@pytest.mark.parametrize("tap", ["first", "last"])
@pytest.mark.parametrize("sizes", NETWORKS, ids=str)
def test_value_gradient_and_head_equal_autograd(sizes: Sizes, tap: str) -> None:
    trunk, (points, _) = network(*sizes), random_points(101)
    layer = 1 if tap == "first" else sizes[1]
    at = points.clone().requires_grad_()
    sdf, feature = plain(trunk, at, layer)
    grad = autograd_gradient(lambda x: plain(trunk, x)[0], at)
    tapped = TappedHead(layer, squares)
    found = infer(trunk.sine_layers, trunk.output, points, grad=True, tapped=tapped)
    expected = (sdf, grad, squares(torch.cat([feature, points], 1)))
    assert all(relative(a, b) < 1e-12 for a, b in zip(found, expected, strict=True))
    assert not any(answer.requires_grad for answer in found)
    asked: list[dict[str, object]] = [{"sdf": True}, {"grad": True}, {"tapped": tapped}]
    parts = [infer(trunk.sine_layers, trunk.output, points, **{"sdf": False, **alone}) for alone in asked]
    assert [[answer is not None for answer in part] for part in parts] == torch.eye(3, dtype=torch.bool).tolist()
    for k, part in enumerate(parts):
        torch.testing.assert_close(part[k], found[k], rtol=1e-12, atol=1e-12)


@pytest.fixture(scope="module")
def fast() -> tuple[SirenTrunk, SirenHead]:
    """Trunk and head of the usual size, with weights as large as fitted ones."""
    torch.manual_seed(0)
    trunk, head = SirenTrunk(), SirenHead(259, 6, widths=[256, 128], omega=30.0)
    torch.nn.init.uniform_(trunk.output.weight, -0.05, 0.05)
    return trunk, head


def answers(fast: tuple[SirenTrunk, SirenHead], points: Tensor) -> Inferred:
    trunk, head = fast
    return infer(trunk.sine_layers, trunk.output, points, grad=True, tapped=TappedHead(trunk.tap, head))


def test_float32_answers_are_those_of_plain_autograd(fast: tuple[SirenTrunk, SirenHead]) -> None:
    points = (torch.rand(1500, 3, generator=torch.Generator().manual_seed(0)) * 2 - 1) * BOX
    found, expected = answers(fast, points), evaluate_with_graph(*fast, None, points, {"gradient", "logits"})
    assert (found.sdf - expected.sdf).abs().max() < 1e-6 * 2 * BOX
    steepest = expected.grad.norm(dim=1).max()
    assert (found.grad - expected.grad).norm(dim=1).max() < 1e-4 * steepest
    assert (found.head - expected.logits).abs().max() < 1e-4 * expected.logits.abs().max()


def test_a_points_answer_does_not_depend_on_those_beside_it(fast: tuple[SirenTrunk, SirenHead]) -> None:
    """Pieces of other sizes, and memory that other points have used before."""
    points = (torch.rand(1500, 3, generator=torch.Generator().manual_seed(1)) * 2 - 1) * BOX
    whole = answers(fast, points)
    for count in (0, 1, 2, 511, 513, 1025):
        for some, all_of_them in zip(answers(fast, points[:count]), whole, strict=True):
            torch.testing.assert_close(some, all_of_them[:count], rtol=0, atol=1e-5 * float(all_of_them.abs().max()))


def test_layers_above_the_tapped_one_are_left_out_for_the_head_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    trunk, (points, _) = network(*NETWORKS[3]), random_points()
    expected = squares(torch.cat([plain(trunk, points, 2)[1], points], 1))
    sines = []
    monkeypatch.setattr(inference, "sine_", lambda argument: sines.append(argument) or argument.sin_())
    found = infer(trunk.sine_layers, trunk.output, points, sdf=False, tapped=TappedHead(2, squares))
    assert found.sdf is found.grad is None
    assert len(sines) == 2
    assert relative(found.head, expected) < 1e-12


def test_memory_is_that_of_a_piece_for_each_thread(number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """However many points: no matrix is larger than a piece, and there are as many sets as threads."""
    made: list[inference._Memory] = []
    start = inference._Memory.__init__

    def counted(self: inference._Memory, like: Tensor) -> None:
        start(self, like)
        made.append(self)

    monkeypatch.setattr(inference._Memory, "__init__", counted)
    trunk, (points, _) = network(*NETWORKS[3]), random_points(300)
    infer(trunk.sine_layers, trunk.output, points, grad=True, tapped=TappedHead(1, squares))
    assert len(made) == number
    rows = 32 + 3
    assert max(len(flat) for memory in made for flat in memory.flat.values()) <= 7 * rows
    used = [memory for memory in made if memory.flat]
    assert all(len(memory.flat) == 2 + 5 + 1 + 1 for memory in used)
