"""Checkpoints, fields, boards, rows and labels of a received folder run nothing."""

import logging
import pickle
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from command_line import Answer, assert_one_line_error, call
from hostile_configs import ALIVE, RUN, STORED, Bomb, hostile_folder

import jointsdf
from jointsdf.errors import InputError
from jointsdf.experiment.measurement import measure_again
from jointsdf.losses.eikonal import Eikonal
from jointsdf.model.field import JointField
from jointsdf.runs.plan import planned_runs
from jointsdf.runs.row import read_rows
from jointsdf.runs.status import read_state
from jointsdf.study.figures.loss_curves import read_curves
from jointsdf.training import fit as fit_module
from jointsdf.training.checkpoints import StoredCheckpoint, read_checkpoint
from jointsdf.training.module import JointSDFModule
from jointsdf.training.settings import FitSettings, Objective
from jointsdf.viewing.slice import main as draw_slice

pytestmark = pytest.mark.filterwarnings("default")
STOPPED = STORED.parent / "stopped"


def within(key: str) -> Callable[[dict[str, Any], Bomb], Any]:
    """Put the bomb at a key of a stored dictionary, or for no key in its place."""

    def put(stored: dict[str, Any], bomb: Bomb) -> Any:
        if not key:
            return bomb
        inner = stored
        *names, last = key.split(".")
        for name in names:
            inner = inner.setdefault(name, {})
        inner[last] = bomb
        return stored

    return put


def as_zip(path: Path, content: Any) -> None:
    torch.save(content, path)


def as_legacy(path: Path, content: Any) -> None:
    torch.save(content, path, _use_new_zipfile_serialization=False)


def as_pickle(path: Path, content: Any) -> None:
    path.write_bytes(pickle.dumps(content, protocol=2))


def as_torchscript(path: Path, content: Any) -> None:
    """An archive as `torch.jit.save` makes it, which torch.load hands to another reader."""
    torch.save(content, path)
    with zipfile.ZipFile(path, "a") as archive:
        (root,) = {name.split("/")[0] for name in archive.namelist()}
        archive.writestr(f"{root}/constants.pkl", pickle.dumps(content))


FORMATS = (as_zip, as_legacy, as_pickle, as_torchscript)
KEYS = {
    "field.ckpt": ("", "trunk", "head", "head.name", "state", "state.centre", "format", "more"),
    "last.ckpt": (
        *("", "state_dict", "global_step", "callbacks", "callbacks.Checkpoints.products", "loops", "optimizer_states"),
        *("lr_schedulers", "hyper_parameters", "datamodule_hyper_parameters", "pytorch-lightning_version", "more"),
    ),
}


def planted(place: Path, name: str, key: str, save: Callable[[Path, Any], None]) -> tuple[Path, Path]:
    """A folder with a bomb in one of its files of weights."""
    folder, canary = hostile_folder(place)
    source = (STORED if name == "field.ckpt" else STOPPED) / name
    save(folder / name, within(key)(torch.load(source, weights_only=True), Bomb(canary)))
    return folder, canary


@pytest.mark.parametrize("save", FORMATS)
@pytest.mark.parametrize("key", KEYS["field.ckpt"])
def test_a_field_runs_nothing(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, key: str, save: Callable[[Path, Any], None]
) -> None:
    folder, canary = planted(tmp_path, "field.ckpt", key, save)
    for read in (jointsdf.load_field, measure_again):
        with pytest.raises(InputError) as refused:
            read(folder)
        assert str(refused.value).startswith(f"{folder / 'field.ckpt'}: not a readable field checkpoint")
        assert "\n" not in str(refused.value)
    assert draw_slice([str(folder), str(tmp_path / "slice.png")]) == 2
    (line,) = caplog.messages
    assert line.startswith(f"error: {folder / 'field.ckpt'}: ")
    assert canary.read_text() == ALIVE


@pytest.mark.parametrize("save", FORMATS)
@pytest.mark.parametrize("key", KEYS["last.ckpt"])
def test_a_checkpoint_runs_nothing(
    tmp_path: Path, small_field: Callable[..., JointField], key: str, save: Callable[[Path, Any], None]
) -> None:
    folder, canary = planted(tmp_path, "last.ckpt", key, save)
    module = JointSDFModule(small_field(), Objective({"e": Eikonal()}, {"e": 1.0}), torch.optim.Adam, FitSettings(8))
    with pytest.raises(InputError, match=rf"^{folder / 'last.ckpt'}: damaged checkpoint; resume=never "):
        read_checkpoint(folder / "last.ckpt", module)
    assert canary.read_text() == ALIVE


def resumed(tmp_path: Path, key: str) -> tuple[Answer, Path]:
    folder, canary = planted(tmp_path, "last.ckpt", key, as_zip)
    (folder / "result.json").unlink()
    return call("train.py", *RUN, f"paths.outputs={tmp_path}"), canary


def test_a_run_that_resumes_runs_nothing(tmp_path: Path) -> None:
    answer, canary = resumed(tmp_path, "callbacks.Checkpoints.products")
    assert_one_line_error(answer, "last.ckpt: damaged checkpoint; resume=never")
    assert canary.read_text() == ALIVE


def test_lightning_itself_unpickles_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The check before the fit is not the only one."""
    monkeypatch.setattr(fit_module, "read_checkpoint", lambda *_: StoredCheckpoint(5, None))
    answer, canary = resumed(tmp_path, "hyper_parameters")
    assert_one_line_error(answer, "last.ckpt: damaged checkpoint (", "Weights only load failed")
    assert canary.read_text() == ALIVE


def test_the_bomb_goes_off_where_pickles_are_loaded(tmp_path: Path) -> None:
    """The oracle of the tests above."""
    for name in KEYS:
        folder, canary = planted(tmp_path / name, name, "more", as_zip)
        torch.load(folder / name, weights_only=False)
        assert canary.read_text() == ""


@pytest.mark.parametrize(
    "name", ["result.json", "status.json", "sweep.json", "labels.npy", "labels.json", "tb/events.1"]
)
def test_a_pickle_under_any_other_name_is_never_loaded(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, name: str
) -> None:
    caplog.set_level(logging.CRITICAL, "tensorboard")
    folder, canary = hostile_folder(tmp_path)
    place = folder / name
    place.parent.mkdir(exist_ok=True)
    np.save(folder / "x.npy", np.array([Bomb(canary)], dtype=object), allow_pickle=True)
    place.write_bytes((folder / ("x.npy" if name.endswith("npy") else "bomb.pkl")).read_bytes())
    rows, problems = read_rows(tmp_path)
    assert (len(rows), len(problems)) == ((0, 1) if name == "result.json" else (1, 0))
    assert read_state(folder).kind == "done"
    assert planned_runs(folder) == []
    assert read_curves(folder / "tb") == {}
    with pytest.raises(InputError) as refused:
        jointsdf.load_shape("part_01", labels=folder / "labels.npy")
    assert "\n" not in str(refused.value)
    assert canary.read_text() == ALIVE
