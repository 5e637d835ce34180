"""Schedules at and between their knots."""

import re
from collections.abc import Callable

import pytest

from jointsdf.errors import InputError
from jointsdf.losses.schedule import Schedule

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


@pytest.mark.usefixtures("as_in_training")
@pytest.mark.parametrize(
    ("make", "named"),
    [
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
