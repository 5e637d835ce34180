"""A damaged checkpoint is one line with the fix, up to the first step after it, and is never trained from."""

import pickle
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest
import torch
from command_line import assert_one_line_error, call
from hostile_configs import RUN, STORED, hostile_folder

from jointsdf.errors import InputError
from jointsdf.experiment import run
from jointsdf.training.fit import fit

pytestmark = pytest.mark.filterwarnings("default")
STOPPED = STORED.parent / "stopped"


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, ...]:
    """Module, data and machine of the stored run, before its fit."""
    found: list[Any] = []

    def record(*arguments: Any, **_: Any) -> None:
        found.extend(arguments)
        raise InputError("recorded")

    with mock.patch.object(run, "fit", record):
        call("train.py", *RUN, f"paths.outputs={tmp_path_factory.mktemp('prepared')}")
    module, data, _, machine = found
    return module, data, machine


def resume(prepared: tuple[Any, ...], folder: Path) -> None:
    module, data, machine = prepared
    fit(deepcopy(module), deepcopy(data), folder, machine)


def assert_damaged(prepared: tuple[Any, ...], folder: Path) -> None:
    with pytest.raises(InputError) as refused:
        resume(prepared, folder)
    message = str(refused.value)
    assert message.startswith(f"{folder / 'last.ckpt'}: ")
    assert message.endswith("resume=never starts the fit over")
    assert message.isprintable()
    assert len(message) < 700


def test_the_stored_checkpoint_itself_is_resumed(tmp_path: Path, prepared: tuple[Any, ...]) -> None:
    (tmp_path / "last.ckpt").write_bytes((STOPPED / "last.ckpt").read_bytes())
    resume(prepared, tmp_path)
    assert torch.load(tmp_path / "last.ckpt", weights_only=True)["global_step"] == 8


def _flip_shapes(states: list[Any]) -> list[Any]:
    states[0]["hidden"]["state"][0]["momentum_buffer"] = torch.zeros(3)
    return states


CHECKPOINT_JUNK: dict[str, tuple[str, Any]] = {
    **{
        f"{key} is {name}": (key, junk)
        for key in ("state_dict", "optimizer_states", "lr_schedulers", "loops", "global_step")
        for name, junk in {"null": None, "a list": [], "a number": 3, "an empty object": {}, "missing": ...}.items()
    },
    "no callbacks": ("callbacks", ...),
    "callbacks are null": ("callbacks", None),
    "callbacks are a list": ("callbacks", []),
    "callbacks of a list": ("callbacks", {"Checkpoints": []}),
    "optimizers without state": ("optimizer_states", [{}]),
    "optimizers without groups": ("optimizer_states", [{"hidden": {"state": {}}, "rest": {"state": {}}}]),
    "two optimizers": ("optimizer_states", lambda states: states * 2),
    "a state of another shape": ("optimizer_states", _flip_shapes),
    "step -1": ("global_step", -1),
    "step 10^30": ("global_step", 10**30),
    "loops of another step": ("global_step", 3),
}


@pytest.mark.parametrize("case", CHECKPOINT_JUNK)
def test_a_checkpoint_with_junk_is_one_line(tmp_path: Path, prepared: tuple[Any, ...], case: str) -> None:
    key, junk = CHECKPOINT_JUNK[case]
    content = torch.load(STOPPED / "last.ckpt", weights_only=True)
    if junk is ...:
        del content[key]
    else:
        content[key] = junk(content[key]) if callable(junk) else junk
    torch.save(content, tmp_path / "last.ckpt")
    assert_damaged(prepared, tmp_path)


def test_a_truncated_checkpoint_is_one_line_wherever_it_ends(tmp_path: Path, prepared: tuple[Any, ...]) -> None:
    whole = (STOPPED / "last.ckpt").read_bytes()
    for size in (*range(0, 400, 80), *np.linspace(400, len(whole) - 1, 20).astype(int).tolist()):
        (tmp_path / "last.ckpt").write_bytes(whole[:size])
        assert_damaged(prepared, tmp_path)


def test_a_checkpoint_of_another_kind_is_one_line(tmp_path: Path, prepared: tuple[Any, ...]) -> None:
    contents: list[Callable[[], bytes]] = [
        lambda: b"PK\x03\x04" + bytes(100),
        lambda: pickle.dumps([1, 2]),
        lambda: (STORED / "field.ckpt").read_bytes(),
        lambda: b"\x80\x02" + b"(" * 100_000,
    ]
    for make in contents:
        (tmp_path / "last.ckpt").write_bytes(make())
        assert_damaged(prepared, tmp_path)


def test_the_command_says_so_as_well(tmp_path: Path) -> None:
    folder, _ = hostile_folder(tmp_path)
    (folder / "result.json").unlink()
    content = torch.load(STOPPED / "last.ckpt", weights_only=True)
    del content["optimizer_states"]
    torch.save(content, folder / "last.ckpt")
    answer = call("train.py", *RUN, f"paths.outputs={tmp_path}")
    assert_one_line_error(answer, "last.ckpt: damaged checkpoint (", "resume=never starts the fit over")
    assert "paths.outputs" not in answer.lines[-1]
