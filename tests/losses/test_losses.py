"""Loss terms: zero where theory says so, known values by hand, and schedules at and between their knots."""

import math
import re
from collections.abc import Callable

import pytest
import torch
from analytic import box_distance, cylinder_distance, sphere_distance
from torch import Tensor

from jointsdf.errors import InputError
from jointsdf.losses import Mixed
from jointsdf.losses.cross_entropy import CrossEntropy
from jointsdf.losses.dirichlet import Dirichlet
from jointsdf.losses.eikonal import Eikonal
from jointsdf.losses.near_distance import NearDistance
from jointsdf.losses.normals import Normals
from jointsdf.losses.schedule import Schedule
from jointsdf.losses.sign_agnostic import SignAgnostic
from jointsdf.losses.signed_distance import SignedDistance
from jointsdf.losses.weingarten import Weingarten
from jointsdf.model.derivatives import autograd_gradient, autograd_mixed, tangent_frame
from jointsdf.values import FieldValues, Step

Field = Callable[[Tensor], Tensor]
NONE, NOWHERE = torch.zeros(0), torch.zeros(0, 3)
RADIUS = 0.6
HALF = torch.tensor([0.7, 0.5, 0.3], dtype=torch.float64)


def sphere(points: Tensor) -> Tensor:
    return sphere_distance(points, RADIUS)


def cylinder(points: Tensor) -> Tensor:
    return cylinder_distance(points, RADIUS)


def box(points: Tensor) -> Tensor:
    return box_distance(points, HALF)


def plane(points: Tensor) -> Tensor:
    return points[:, 2] + 0 * points.square().sum(-1) - 0.1  # the zero keeps a graph for the second derivative


def uniform(count: int = 500, seed: int = 0) -> Tensor:
    return torch.rand(count, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(seed)) * 2.2 - 1.1


def onto(field: Field, points: Tensor) -> Tensor:
    """The points moved to the zero level set along the gradient of an exact distance."""
    for _ in range(3):  # a box's corner regions need a second look
        points = points.detach().requires_grad_()
        points = points - field(points).detach()[:, None] * autograd_gradient(field, points).detach()
    return points.detach()


def exact_step(field: Field) -> Step:
    """A step in which the field is its own exact signed distance."""

    def values(points: Tensor) -> FieldValues:
        points = points.clone().requires_grad_()
        grad = autograd_gradient(field, points)
        angles = torch.linspace(0, 2 * math.pi, len(points), dtype=torch.float64)
        u, v = tangent_frame(torch.nn.functional.normalize(grad.detach(), dim=-1), angles)
        return FieldValues(field(points), grad, autograd_mixed(field, points, u, v))

    surface, pool = onto(field, uniform(seed=1)), uniform(seed=2)
    fields = {
        "manifold": values(surface),
        "non_manifold": values(uniform(seed=3)),
        "shell": values(surface + 0.02 * uniform(seed=4)),
        "pool": values(pool),
    }
    normals = torch.nn.functional.normalize(autograd_gradient(field, surface.clone().requires_grad_()), dim=-1).detach()
    return Step(fields, torch.zeros(len(surface), dtype=torch.int64), normals, field(pool))


def step_of(**fields: FieldValues) -> Step:
    return Step(fields, torch.zeros(0, dtype=torch.int64), NOWHERE, NONE)


@pytest.mark.parametrize("field", [sphere, box, plane, cylinder])
@pytest.mark.parametrize(
    "term",
    [
        Dirichlet(),
        SignedDistance(),
        NearDistance(),
        Normals(),
        Eikonal("abs", ["manifold", "shell"]),
        Eikonal("squared", ["manifold", "non_manifold", "shell"]),
        Eikonal("abs", ["pool"]),
    ],
    ids=str,
)
def test_exact_distance_costs_nothing(field: Field, term: Callable[[Step], Tensor]) -> None:
    assert term(exact_step(field)).item() == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("normalised", [True, False])
@pytest.mark.parametrize("field", [sphere, plane])
def test_weingarten_is_zero_on_umbilic_and_flat_surfaces(field: Field, normalised: bool) -> None:
    assert Weingarten(normalised)(exact_step(field)).item() == pytest.approx(0, abs=1e-12)


def cylinder_step(angle: float, steepness: float) -> Step:
    turn = torch.linspace(0, 6, 50, dtype=torch.float64)
    zero = torch.zeros_like(turn)
    points = (RADIUS * torch.stack([turn.cos(), turn.sin(), zero], -1)).requires_grad_()
    around, along = torch.stack([-turn.sin(), turn.cos(), zero], -1), torch.stack([zero, zero, zero + 1], -1)
    u, v = math.cos(angle) * along + math.sin(angle) * around, math.cos(angle) * around - math.sin(angle) * along

    def field(at: Tensor) -> Tensor:
        return steepness * cylinder(at)

    shell = FieldValues(field(points), autograd_gradient(field, points), autograd_mixed(field, points, u, v))
    return step_of(shell=shell)


@pytest.mark.parametrize("angle", [0.0, 0.4, math.pi / 4, 2.0])
@pytest.mark.parametrize("steepness", [1.0, 2.5])
def test_weingarten_on_a_cylinder(angle: float, steepness: float) -> None:
    """|sin 2a| / 2r for any steepness of the field; the unnormalised form scales with it."""
    expected = abs(math.sin(2 * angle)) / (2 * RADIUS)
    step = cylinder_step(angle, steepness)
    assert Weingarten(normalised=True)(step).item() == pytest.approx(expected, abs=1e-12)
    assert Weingarten(normalised=False)(step).item() == pytest.approx(steepness * expected, abs=1e-12)


def test_dirichlet_by_hand() -> None:
    assert Dirichlet()(step_of(manifold=FieldValues(torch.tensor([0.5, -1.5, 1.0])))).item() == 1.0


def test_sign_agnostic_by_hand() -> None:
    sdf = torch.tensor([0.0, 0.01, -0.02], dtype=torch.float64)
    step = step_of(non_manifold=FieldValues(sdf))
    assert SignAgnostic()(step).item() == pytest.approx((1 + math.exp(-1) + math.exp(-2)) / 3, rel=1e-12)
    assert SignAgnostic(50.0)(step).item() == pytest.approx((1 + math.exp(-0.5) + math.exp(-1)) / 3, rel=1e-12)


def pool_step(found: Tensor, known: list[float]) -> Step:
    nothing = torch.zeros(0, dtype=torch.int64)
    return Step({"pool": FieldValues(found)}, nothing, NOWHERE, torch.tensor(known, dtype=torch.float64))


def test_signed_distance_by_hand() -> None:
    step = pool_step(torch.tensor([1.0, -1.0, 0.0], dtype=torch.float64), [0.0, -1.0, 0.5])
    assert SignedDistance()(step).item() == 0.5


def test_near_distance_by_hand() -> None:
    """At the surface an error counts whole, at the band half; a wrong side costs beside it, less clear than `clear`."""
    found = torch.tensor([0.01, -0.05, 0.03, 0.5], dtype=torch.float64)
    step = pool_step(found, [0.0, -0.02, -0.02, 0.58])
    errors = [0.01, 0.03 / 2, 0.05 / 2, 0.08 * 0.02 / 0.6]
    assert NearDistance(0.02, 0.3, 0.1)(step).item() == pytest.approx((sum(errors) + 0.3 * 0.04) / 4, rel=1e-12)


def test_a_sheet_far_from_the_surface_is_pushed_away_whatever_its_depth() -> None:
    found = torch.tensor([-0.9, -0.01, 0.04, 0.06], dtype=torch.float64, requires_grad=True)
    (slope,) = torch.autograd.grad(NearDistance(0.02, 1.0, 0.1)(pool_step(found, [0.9] * 4)), found)
    far = 0.02 / 0.92
    torch.testing.assert_close(4 * slope, -torch.tensor([1 + far, 1 + far, 1 + far, far], dtype=torch.float64))


@pytest.mark.parametrize("name", ["band", "side", "clear"])
def test_near_distance_refuses_a_number_without_sense(name: str) -> None:
    with pytest.raises(InputError, match=f"{name}=0"):
        NearDistance(**{name: 0.0})


def test_normals_by_hand() -> None:
    """A right angle costs the root of two, a length of 3 costs 2, a flat field 1; and that has a finite gradient."""
    grad = torch.tensor([[0.0, 1, 0], [1, 0, 0], [3, 0, 0], [0, 0, 0]], dtype=torch.float64, requires_grad=True)
    normals = torch.tensor([[1.0, 0, 0]] * 4, dtype=torch.float64)
    step = Step({"manifold": FieldValues(torch.zeros(4), grad)}, torch.zeros(4, dtype=torch.int64), normals, NONE)
    loss = Normals()(step)
    assert loss.item() == pytest.approx((math.sqrt(2) + 0 + 2 + 1) / 4, rel=1e-12)
    (slope,) = torch.autograd.grad(loss, grad)
    half = math.sqrt(0.5)
    torch.testing.assert_close(4 * slope, torch.tensor([[-half, half, 0], [0] * 3, [1, 0, 0], [-1, 0, 0]]).double())


def test_points_without_a_normal_do_not_count() -> None:
    grad = torch.tensor([[0.0, 1, 0], [5, 5, 5], [3, 0, 0]], dtype=torch.float64, requires_grad=True)
    normals = torch.tensor([[1.0, 0, 0], [0, 0, 0], [1, 0, 0]], dtype=torch.float64)
    fields, labels = {"manifold": FieldValues(torch.zeros(3), grad)}, torch.zeros(3, dtype=torch.int64)
    loss = Normals()(Step(fields, labels, normals, NONE))
    assert loss.item() == pytest.approx((math.sqrt(2) + 2) / 2, rel=1e-12)
    assert not torch.autograd.grad(loss, grad)[0][1].any()
    nothing = Normals()(Step(fields, labels, 0 * normals, NONE))
    assert nothing.item() == 0
    assert not torch.autograd.grad(nothing, grad)[0].any()


def eikonal_step() -> Step:
    lengths = {"manifold": [1.0, 2.0], "shell": [0.5], "non_manifold": [3.0, 0.0, 1.0]}
    return step_of(
        **{
            name: FieldValues(
                torch.zeros(len(sizes)), torch.tensor([[0.6 * s, 0.0, -0.8 * s] for s in sizes], dtype=torch.float64)
            )
            for name, sizes in lengths.items()
        }
    )


@pytest.mark.parametrize(
    ("form", "on", "expected"),
    [
        ("abs", ["manifold", "shell"], (0 + 1 + 0.5) / 3),
        ("squared", ["manifold", "shell"], (0 + 9 + 0.5625) / 3),
        ("abs", ["manifold", "non_manifold", "shell"], (0 + 1 + 2 + 1 + 0 + 0.5) / 6),
        ("squared", ["manifold", "non_manifold", "shell"], (0 + 9 + 64 + 1 + 0 + 0.5625) / 6),
        ("abs", ["shell"], 0.5),
    ],
)
def test_eikonal_by_hand(form: str, on: list[str], expected: float) -> None:
    term = Eikonal(form, on)
    assert term(eikonal_step()).item() == pytest.approx(expected, rel=1e-12)
    assert set(term.needs) == set(on)


@pytest.mark.parametrize("form", ["abs", "squared"])
def test_eikonal_has_a_finite_gradient_where_the_field_is_flat(form: str) -> None:
    grad = torch.tensor([[0.0, 0.0, 0.0], [1e-30, 0.0, 0.0], [1.0, 0.0, 0.0]], requires_grad=True)
    Eikonal(form, ["shell"])(step_of(shell=FieldValues(torch.zeros(3), grad))).backward()
    assert grad.grad is not None
    assert grad.grad.isfinite().all()


def test_weingarten_has_a_finite_gradient_where_the_field_is_flat() -> None:
    grad = torch.zeros(2, 3, requires_grad=True)
    mixed = torch.zeros(2, requires_grad=True)
    Weingarten()(step_of(shell=FieldValues(torch.zeros(2), grad, mixed))).backward()
    assert grad.grad is not None
    assert mixed.grad is not None
    assert grad.grad.isfinite().all()
    assert mixed.grad.isfinite().all()


def segmentation_step(labels: list[int], logits: Tensor) -> Step:
    values = FieldValues(torch.zeros(len(labels)), logits=logits)
    return Step({"manifold": values}, torch.tensor(labels, dtype=torch.int64), torch.zeros(len(labels), 3), NONE)


def test_cross_entropy_is_torchs_mean_over_labelled_points() -> None:
    logits = torch.randn(6, 4, dtype=torch.float64, generator=torch.Generator().manual_seed(0)).requires_grad_()
    labels = [2, -1, 0, 3, -1, 1]
    loss = CrossEntropy()(segmentation_step(labels, logits))
    expected = torch.nn.functional.cross_entropy(logits[[0, 2, 3, 5]], torch.tensor([2, 0, 3, 1]))
    torch.testing.assert_close(loss, expected, rtol=1e-14, atol=0)
    (found,), (wanted,) = torch.autograd.grad(loss, logits), torch.autograd.grad(expected, logits)
    torch.testing.assert_close(found, wanted, rtol=0, atol=1e-16)
    assert (found[[1, 4]] == 0).all()


def test_cross_entropy_of_uniform_logits_is_log_k() -> None:
    loss = CrossEntropy()(segmentation_step([0, 6, 3], torch.zeros(3, 7, dtype=torch.float64)))
    assert loss.item() == pytest.approx(math.log(7), rel=1e-12)


@pytest.mark.parametrize("classes", [0, 1, 5])
def test_cross_entropy_without_labels_is_zero_with_a_zero_gradient(classes: int) -> None:
    source = torch.randn(4, 8, requires_grad=True)
    loss = CrossEntropy()(segmentation_step([-1] * 4, source[:, :classes]))
    loss.backward()
    assert loss.item() == 0
    assert source.grad is not None
    assert (source.grad == 0).all()


@pytest.mark.usefixtures("as_in_training")
@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: Eikonal("cubed"), "eikonal.form=cubed: accepted are squared, abs"),
        (lambda: Eikonal("abs", ["manifold", "nowhere"]), "nowhere"),
        (lambda: Eikonal("abs", []), "eikonal.on=[]"),
        (lambda: Weingarten(derivative="guess"), "weingarten.derivative=guess: accepted are exact, finite_difference"),
        (lambda: Weingarten(spacing=0.0), "weingarten.spacing=0.0: must be > 0"),
        (lambda: Schedule("cubic"), "schedule.form=cubic: accepted are constant, linear, quintic, step"),
        (lambda: Schedule("linear", []), "schedule.knots=[]"),
        (lambda: Schedule("linear", [[0.0, 1.0], [0.0, 2.0]]), "shares must ascend"),
        (lambda: Schedule("linear", [[0.5, 1.0], [0.2, 2.0]]), "shares must ascend"),
        (lambda: Schedule("linear", [[0.5]]), "schedule.knots=[[0.5]]"),
        (lambda: Schedule("linear", [[0.0, 1.0], [0.5, -1.0]]), "factor >= 0"),
    ],
)
def test_bad_values_are_input_errors_of_one_line(make: Callable[[], object], named: str) -> None:
    with pytest.raises(InputError, match=f"^[^\\n]*{re.escape(named)}[^\\n]*$"):
        make()


def test_weingarten_asks_for_its_own_derivative() -> None:
    assert Weingarten().needs == {"shell": frozenset({"grad", Mixed("exact", 0.05)})}
    assert Mixed("finite_difference", 0.01) in Weingarten(derivative="finite_difference", spacing=0.01).needs["shell"]


KNOTS = [[0.0, 1.0], [0.2, 1.0], [0.5, 0.0001], [1.0, 0.0]]  # 10 until 20%, 0.001 at 50%, 0 at the end


@pytest.mark.parametrize("form", ["linear", "quintic"])
@pytest.mark.parametrize(
    ("share", "factor"), [(0.0, 1), (0.1, 1), (0.2, 1), (0.5, 1e-4), (1.0, 0), (1.5, 0), (-0.1, 1)]
)
def test_interpolating_schedules_meet_their_knots(form: str, share: float, factor: float) -> None:
    assert Schedule(form, KNOTS)(share) == pytest.approx(factor, abs=1e-12)


@pytest.mark.parametrize(("share", "progress"), [(0.275, 0.25), (0.35, 0.5), (0.44, 0.8)])
def test_schedules_between_two_knots(share: float, progress: float) -> None:
    assert Schedule("linear", KNOTS)(share) == pytest.approx(1 + (1e-4 - 1) * progress, rel=1e-9)
    assert Schedule("quintic", KNOTS)(share) == pytest.approx(1e-4 + (1 - 1e-4) * (1 - progress) ** 5, rel=1e-9)
    assert Schedule("step", KNOTS)(share) == 1e-4
    assert Schedule("constant", KNOTS)(share) == 1.0


@pytest.mark.parametrize(("share", "factor"), [(0.0, 1), (0.2, 1), (0.201, 1e-4), (0.5, 1e-4), (0.501, 0), (2.0, 0)])
def test_step_schedule_drops_as_soon_as_a_knot_is_passed(share: float, factor: float) -> None:
    assert Schedule("step", KNOTS)(share) == factor


def test_quintic_falls_fast_and_ends_flat() -> None:
    schedule, h = Schedule("quintic", [[0.0, 1.0], [1.0, 0.0]]), 1e-4
    assert (1 - schedule(h)) / h == pytest.approx(5, rel=1e-3)
    assert abs(schedule(1 - h)) < 1e-15
    assert schedule(0.5) == 1 / 32


def test_default_schedule_is_one_throughout() -> None:
    assert {Schedule()(share) for share in (0.0, 0.3, 1.0)} == {1.0}
