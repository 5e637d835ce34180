"""Objectives that cannot be trained are refused in one line."""

import pytest

from jointsdf.errors import InputError
from jointsdf.losses.dirichlet import Dirichlet
from jointsdf.losses.schedule import Schedule
from jointsdf.training.settings import Objective


@pytest.mark.parametrize(
    ("terms", "weights", "schedules", "odd"),
    [
        (["a", "b"], ["a"], [], "b"),
        (["a"], ["a", "c"], [], "c"),
        (["a"], ["a"], ["d"], "d"),
    ],
)
def test_names_that_do_not_match_are_an_input_error(
    terms: list[str], weights: list[str], schedules: list[str], odd: str
) -> None:
    with pytest.raises(InputError, match=f"^loss: {odd} must stand under both terms and weights$"):
        Objective(
            {name: Dirichlet() for name in terms},
            dict.fromkeys(weights, 1.0),
            {name: Schedule() for name in schedules},
        )


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        ({"a": 0.0, "b": 0.0}, r"^loss\.weights=\{'a': 0\.0, 'b': 0\.0\}: one of them must be > 0$"),
        ({"a": 1.0, "b": -1.0}, r"^loss\.weights\.b=-1\.0: give a number, at least 0$"),
    ],
)
def test_weights_that_cannot_train_are_an_input_error(weights: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Objective({"a": Dirichlet(), "b": Dirichlet()}, weights)
