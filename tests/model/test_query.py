"""Queries of a field: answers of the points' type, only those asked for, and one line for what is no query."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import torch
from conftest import BOX_PARTS

from jointsdf.errors import InputError
from jointsdf.model.field import JointField
from jointsdf.model.fused import inference
from jointsdf.model.query import OutsideBoxWarning, RoundedPointsWarning
from jointsdf.values import BOX, UNMOVED, Normalisation

BuildField = Callable[..., JointField]

NORMALISATION = Normalisation(np.array([100.0, -20.0, 3.5]), 47.0)

KINDS: dict[str, Callable[[np.ndarray], object]] = {
    "tensor": torch.from_numpy,
    "array": np.asarray,
    "lists": np.ndarray.tolist,
}


def file_points(count: int = 60) -> np.ndarray:
    return NORMALISATION.inverse(np.random.default_rng(0).uniform(-1.05, 1.05, (count, 3)))


@pytest.mark.parametrize("kind", KINDS)
def test_answers_are_of_the_kind_of_the_points(small_field: BuildField, kind: str) -> None:
    field = small_field("siren", normalisation=NORMALISATION).eval()
    points = file_points(5)
    expected = field.query(torch.from_numpy(points))
    given = KINDS[kind](points)
    for name, answer in field.query(given)._asdict().items():
        assert type(answer) is type(given), name
        np.testing.assert_array_equal(np.asarray(answer), getattr(expected, name).numpy(), err_msg=name)


@pytest.mark.parametrize("kind", KINDS)
def test_one_point_is_answered_without_the_first_axis(small_field: BuildField, kind: str) -> None:
    field = small_field("siren", normalisation=NORMALISATION).eval()
    points = file_points(1)
    answer, rows = field.query(KINDS[kind](points[0])), field.query(points)
    assert [np.shape(column) for column in answer] == [(), (), (4,), (3,)]
    for found, row in zip(answer, rows, strict=True):
        np.testing.assert_array_equal(np.asarray(found), row[0])


@pytest.mark.parametrize("empty", [[], np.zeros((0, 3)), torch.zeros(0, 3)], ids=["lists", "array", "tensor"])
def test_no_points_have_no_answers(small_field: BuildField, empty: object) -> None:
    assert [np.shape(column)[0] for column in small_field("siren").query(empty)] == [0, 0, 0, 0]


@pytest.mark.parametrize("what", [("sdf",), "part", ("logits", "sdf"), ("gradient",), ("sdf", "part", "gradient")])
def test_only_what_is_asked_is_answered_and_the_same(small_field: BuildField, what: str | tuple[str, ...]) -> None:
    field = small_field("siren", normalisation=NORMALISATION).eval()
    points = torch.from_numpy(file_points())
    whole, some = field.query(points), field.query(points, what=what)
    asked = {what} if isinstance(what, str) else set(what)
    for name, answer in some._asdict().items():
        if name in asked:
            torch.testing.assert_close(answer, getattr(whole, name), rtol=1e-4, atol=1e-3)
        else:
            assert answer is None


def test_a_distance_alone_runs_no_head_and_takes_no_cosine(
    small_field: BuildField, monkeypatch: pytest.MonkeyPatch
) -> None:
    field = small_field("siren", normalisation=NORMALISATION).eval()
    monkeypatch.setattr(field.head, "forward", lambda _: pytest.fail("the head was run"))
    monkeypatch.setattr(inference, "cosine", lambda *_: pytest.fail("a cosine was taken"))
    assert field.query(file_points(), what="sdf").sdf.shape == (60,)


def test_differentiable_answers_have_the_gradients_of_plain_autograd(small_field: BuildField) -> None:
    """Of a loss on distance, gradient and logits: to the points, and to every parameter, against finite differences."""
    field = small_field("siren", normalisation=NORMALISATION, omega=4.0, hidden_omega=4.0).double().eval()
    points = torch.from_numpy(file_points(4)).requires_grad_()

    def loss(at: torch.Tensor) -> torch.Tensor:
        answer = field.query(at, differentiable=True)
        return answer.sdf.sum() + answer.gradient.square().sum() + answer.logits.square().sum()

    assert torch.autograd.gradcheck(loss, points, atol=1e-5)
    total = loss(points)
    total.backward()
    assert all(p.grad is not None and p.grad.abs().sum() > 0 for p in field.parameters() if p is not None)
    with torch.no_grad():
        weight, h = field.trunk.sine_layers[0].linear.weight, 1e-6
        slope = weight.grad[0, 0].item()
        weight[0, 0] += h
        up = loss(points.detach()).item()
        weight[0, 0] -= 2 * h
        down = loss(points.detach()).item()
    assert (up - down) / (2 * h) == pytest.approx(slope, rel=1e-4, abs=1e-6)


def test_differentiable_and_plain_answers_agree(small_field: BuildField) -> None:
    field = small_field("hybrid", normalisation=NORMALISATION).eval()
    points = torch.from_numpy(file_points())
    for plain, kept in zip(field.query(points), field.query(points, differentiable=True), strict=True):
        torch.testing.assert_close(kept, plain, rtol=1e-4, atol=1e-4)
        assert not plain.requires_grad


def test_outside_the_box_it_warns_once_and_answers_no_part(small_field: BuildField) -> None:
    field = small_field("siren", normalisation=NORMALISATION).eval()
    points = NORMALISATION.inverse(np.array([[0.0, 0, 0], [1.2, 0, 0], [0, 0, -5.0]]))
    with pytest.warns(OutsideBoxWarning, match="outside the training box") as caught:
        answer = field.query(points)
    assert len(caught) == 1
    assert answer.part[0] in BOX_PARTS
    assert answer.part[1:].tolist() == [-1, -1]
    assert np.isfinite(answer.sdf).all()
    assert field.query(points).part[1:].tolist() == [-1, -1]  # a second warning would be an error here
    edge = NORMALISATION.inverse(np.array([[BOX, -BOX, BOX]]))
    assert field.query(edge).part[0] in BOX_PARTS


@pytest.mark.usefixtures("as_in_training")
@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((4, 2)), r"points of shape \(4, 2\): give \(n, 3\), or \(3,\) for one point"),
        (np.zeros((2, 2, 3)), r"points of shape \(2, 2, 3\)"),
        ([1.0, 2.0], r"points of shape \(2,\)"),
        ([[0.0, 0.0, 0.0], [0.0, float("nan"), 1.0]], r"points: row 1 is \[0\.0, nan, 1\.0\]; give finite coordinates"),
        (torch.tensor([[0.0, float("inf"), 0.0]]), "points: row 0 is"),
        ([[1.0, 2.0, 3.0], [4.0]], "points: .*give numbers in shape"),
        ("a point", "points: .*give numbers in shape"),
        (np.zeros((1, 3), dtype=complex), "points of type .*give real numbers"),
        (np.zeros((1, 3), dtype=bool), "points of type .*give real numbers"),
        (None, "points"),
    ],
    ids=str,
)
def test_points_that_are_none_are_one_line(small_field: BuildField, points: object, message: str) -> None:
    with pytest.raises(InputError, match=f"^{message}[^\n]*$"):
        small_field("siren").query(points)


def test_unknown_answers_are_one_line(small_field: BuildField) -> None:
    with pytest.raises(InputError, match=r"^what=normal: give some of sdf, part, logits, gradient$"):
        small_field().query([[0.0, 0, 0]], what=("sdf", "normal"))
    with pytest.raises(InputError, match=r"^what=nothing"):
        small_field().query([[0.0, 0, 0]], what=())
    with pytest.raises(InputError, match=r"^differentiable=True: give the points as a tensor"):
        small_field().query([[0.0, 0, 0]], differentiable=True)


def test_whole_numbers_are_points(small_field: BuildField) -> None:
    field = small_field("siren").eval()
    exact = field.query(np.array([[5.0, -3.0, 11.0]]))
    for given in (np.array([[5, -3, 11]]), [[5, -3, 11]], torch.tensor([[5, -3, 11]])):
        np.testing.assert_array_equal(np.asarray(field.query(given).sdf), exact.sdf)


@pytest.mark.parametrize("kind", ["reversed", "read only", "big endian", "Fortran order"])
def test_arrays_of_any_layout_are_points(small_field: Callable[..., JointField], kind: str) -> None:
    field = small_field("siren").eval()
    points = np.array([[5.0, -3.0, 11.0], [7.0, -1.0, 9.0], [1.0, 2.0, 3.0]])
    given = {
        "reversed": points[::-1].copy()[::-1],
        "read only": points.copy(),
        "big endian": points.astype(">f8"),
        "Fortran order": np.asfortranarray(points),
    }[kind]
    given.flags.writeable = kind != "read only"
    np.testing.assert_array_equal(field.query(given).sdf, field.query(points).sdf)


@pytest.mark.parametrize(("centre", "scale"), [(4e6, 50.0), (-4e6, 50.0), (3e-4, 5e-5), (-4e15, 5e10)])
def test_a_field_anywhere_and_of_any_size_answers_as_in_its_own_frame(
    small_field: BuildField, centre: float, scale: float
) -> None:
    points = (2 * np.random.default_rng(0).integers(-32, 32, (60, 3)) + 1) / 64
    expected = small_field("siren", normalisation=UNMOVED).eval().query(points)
    far = small_field("siren", normalisation=Normalisation(np.full(3, centre), scale)).eval()
    for kind in KINDS.values():
        found = far.query(kind(points * scale + centre))
        np.testing.assert_array_equal(found.sdf, expected.sdf * np.float32(scale))
        for name in ("part", "logits", "gradient"):
            np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))


@pytest.mark.filterwarnings("ignore::jointsdf.model.query.OutsideBoxWarning")
@pytest.mark.parametrize(("kind", "steps"), [("float32", r"0\.25 .*\(2\.5e-03 "), ("bfloat16", r"1\.6e\+04 .*")])
def test_too_coarse_points_are_told_once(small_field: BuildField, kind: str, steps: str) -> None:
    far = small_field("siren", normalisation=Normalisation(np.full(3, -4e6), 50.0)).eval()
    points = torch.full((4, 3), -4e6, dtype=torch.float64)
    coarse = points.to(getattr(torch, kind))
    far.query(points)  # a warning would fail the test
    with pytest.warns(RoundedPointsWarning, match=rf"^points in {kind}, .* steps of {steps}.*: give float64"):
        far.query(coarse)
    far.query(coarse)  # as would a second one, or one of points far from a near shape
    small_field("siren").eval().query(points.float())


def test_queries_of_several_threads_give_the_same_and_leave_the_number_of_threads(small_field: BuildField) -> None:
    field, points = small_field("siren", normalisation=NORMALISATION).eval(), file_points(3000)
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        expected = field.query(points).sdf
        with ThreadPoolExecutor(4) as pool:
            found = [answer.sdf for answer in pool.map(field.query, [points] * 12)]
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(before)
    for sdf in found:
        np.testing.assert_array_equal(sdf, expected)
