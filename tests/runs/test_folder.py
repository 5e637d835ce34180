"""A run folder is taken by one config, and what it holds of another one is never overwritten unasked."""

from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from study_rows import ROW

from jointsdf.errors import InputError
from jointsdf.runs.fingerprint import NUMBERS
from jointsdf.runs.folder import CHECKPOINT, CONFIG, REUSED, claim, finished_row, read_config, read_result
from jointsdf.runs.lock import LOCK, lock
from jointsdf.runs.row import ROW_FILE, config_hash, write_row
from jointsdf.runs.status import STATUS, begin

FINGERPRINT = {"seed": 0, "data": {"cloud_size": 10}, "shape": {"name": "part_01"}}
SETTINGS = dict.fromkeys(NUMBERS, 0) | {"shape": "part_01", "labels": None, "paths": {"outputs": "outputs"}}


def take(folder: Path, *, resume: str = "auto", force: bool = False) -> None:
    claim(folder, SETTINGS, FINGERPRINT, resume=resume, force=force)


def test_a_claimed_folder_holds_config_and_fingerprint(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "run"
    take(folder)
    assert yaml.safe_load((folder / CONFIG).read_text()) == read_config(folder) == SETTINGS | {"identity": FINGERPRINT}
    assert list(folder.iterdir()) == [folder / CONFIG]


@pytest.mark.parametrize(
    ("left", "resume", "force", "stays"),
    [
        (("mesh.ply",), "auto", False, False),
        (("mesh.ply", CHECKPOINT), "auto", False, True),
        (("mesh.ply", CHECKPOINT), "never", False, False),
        (("mesh.ply", CHECKPOINT), "auto", True, False),
    ],
)
def test_what_an_earlier_attempt_left_goes_unless_its_checkpoint_is_resumed(
    tmp_path: Path, left: tuple[str, ...], resume: str, force: bool, stays: bool
) -> None:
    with lock(tmp_path, wait=False):
        begin(tmp_path)
        (tmp_path / "tb").mkdir()
        for name in (*left, "tb/events"):
            (tmp_path / name).write_text("")
        take(tmp_path, resume=resume, force=force)
        assert {entry.name for entry in tmp_path.iterdir()} == {LOCK, STATUS, CONFIG} | (
            {*left, "tb"} if stays else set()
        )


def test_a_damaged_result_is_logged_and_done_again(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    take(tmp_path)
    (tmp_path / ROW_FILE).write_text("{")
    assert finished_row(tmp_path, FINGERPRINT, force=False, reuse=True) is None
    take(tmp_path)
    assert caplog.messages[0].startswith(f"{tmp_path / ROW_FILE}: not a readable result row")
    assert caplog.messages[0].endswith("; the run is done again")


def test_a_finished_run_is_found_unless_forced(tmp_path: Path) -> None:
    assert finished_row(tmp_path, FINGERPRINT, force=False, reuse=True) is None
    take(tmp_path)
    write_row(tmp_path, ROW)
    assert finished_row(tmp_path, FINGERPRINT, force=False, reuse=False) == ROW == read_result(tmp_path)
    assert finished_row(tmp_path, FINGERPRINT, force=True, reuse=True) is None


def test_a_row_of_another_study_is_found_where_reuse_is_wanted(tmp_path: Path) -> None:
    take(tmp_path)
    row = replace(ROW, provenance=ROW.provenance | {REUSED: "paired/base/siren/part_01/seed0"})
    write_row(tmp_path, row)
    assert finished_row(tmp_path, FINGERPRINT, force=False, reuse=True) == row
    assert finished_row(tmp_path, FINGERPRINT, force=False, reuse=False) is None


@pytest.mark.parametrize("name", [ROW_FILE, CHECKPOINT])
def test_a_run_of_another_config_is_refused_with_what_differs(tmp_path: Path, name: str) -> None:
    take(tmp_path)
    (tmp_path / name).write_text("")
    wanted = FINGERPRINT | {"data": {"cloud_size": 20}, "head": {"name": "relu"}}
    with pytest.raises(InputError) as caught:
        finished_row(tmp_path, wanted, force=False, reuse=True)
    assert str(caught.value) == (
        f"{tmp_path} holds another config: data.cloud_size (10 -> 20), head.name (None -> relu); "
        f"hash {config_hash(FINGERPRINT)} there, {config_hash(wanted)} here; "
        "variant=<name> makes a new folder, force=true overwrites"
    )
    (tmp_path / CONFIG).unlink()
    with pytest.raises(InputError, match=rf"^{tmp_path} holds a run without its config.yaml; force=true"):
        finished_row(tmp_path, wanted, force=False, reuse=True)
    assert finished_row(tmp_path, wanted, force=True, reuse=True) is None


@pytest.mark.parametrize("text", ["", "[]", "seed: [", "identity: {shape: {}}", "\udcff"])
def test_a_damaged_config_is_one_line(tmp_path: Path, text: str) -> None:
    (tmp_path / CONFIG).write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(InputError, match=rf"^{tmp_path / CONFIG}: damaged; force=true starts the run over$"):
        read_config(tmp_path)


def test_what_is_no_finished_run_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"not a run folder \(no config.yaml\); give one that train.py made$"):
        read_config(tmp_path)
    with pytest.raises(InputError, match=r"no finished run \(no result.json\); the same train.py command finishes it$"):
        read_result(tmp_path)
    (tmp_path / ROW_FILE).write_text("{")
    with pytest.raises(InputError, match=r"not a readable result row: .*, or force=true$"):
        read_result(tmp_path)
