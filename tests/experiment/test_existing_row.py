"""A run folder that holds a row, another config or damaged files: returned, refused or run again."""

import json
from contextlib import contextmanager

import numpy as np
import pytest
import yaml
from command_line import FILES, PLACE, finished, train
from run_folders import contents, own_copy, row_of

from jointsdf.experiment import existing_row, run
from jointsdf.shapes.builtin import BUILTINS

pytestmark = pytest.mark.filterwarnings("default")


def test_the_same_command_gives_the_row_at_once_and_touches_nothing(tmp_path):
    folder = own_copy(tmp_path)
    before = contents(tmp_path)
    answer = train(tmp_path, "trainer.preview_every=2")
    assert answer.code == 0
    assert "holds this run's result already; force=true runs it again" in answer.lines[0]
    assert contents(tmp_path) == before
    for where_and_how in ("trainer.log_every=7", "data.workers=1", "trainer.checkpoint_seconds=3", "resume=never"):
        assert train(tmp_path, where_and_how).code == 0
        assert contents(tmp_path) == before, where_and_how
    assert folder.is_dir()
    answer = train(tmp_path, "unit=in")
    assert answer.lines[1].endswith(f"{folder.name}: its files are in mm, not in; force=true writes them again")
    assert contents(tmp_path) == before


def test_another_config_is_refused_and_the_keys_are_listed(tmp_path):
    own_copy(tmp_path)
    before = contents(tmp_path)
    answer = train(tmp_path, "trainer.clip=3", "loss.weights.eikonal=7")
    assert answer.code == 2
    (line,) = answer.lines
    assert "holds another config: loss.weights.eikonal (50.0 -> 7.0), trainer.clip (10.0 -> 3.0)" in line
    assert "variant=<name>" in line
    assert "force=true" in line
    assert contents(tmp_path) == before


def test_force_and_variant_are_the_ways_out(tmp_path):
    folder = own_copy(tmp_path)
    assert train(tmp_path, "trainer.clip=3", "variant='clip=3'").code == 0
    assert (tmp_path / "smoke/clip=3/siren/part_01/seed0/result.json").is_file()
    assert row_of(folder) == row_of(finished())
    (folder / "stale").touch()
    assert train(tmp_path, "trainer.clip=3", "force=true").code == 0
    assert yaml.safe_load((folder / "config.yaml").read_text())["trainer"]["clip"] == 3
    assert {path.name for path in folder.iterdir()} == FILES
    assert row_of(folder)["provenance"]["config_hash"] != row_of(finished())["provenance"]["config_hash"]


def test_other_labels_of_the_same_mesh_are_another_run(tmp_path):
    own_copy(tmp_path)
    np.save(tmp_path / "other.npy", np.arange(len(BUILTINS["part_01"]().faces)) % 3)
    answer = train(tmp_path, f"labels={tmp_path / 'other.npy'}")
    assert answer.code == 2
    assert "holds another config: shape.labels_sha256" in answer.text


@pytest.mark.parametrize(
    ("name", "text", "named"),
    [
        ("config.yaml", "seed: [0", "force=true"),
        ("config.yaml", "", "force=true"),
        ("config.yaml", None, "force=true"),
    ],
)
def test_a_damaged_folder_is_one_line_with_the_fix(tmp_path, name, text, named):
    folder = own_copy(tmp_path)
    (folder / name).unlink() if text is None else (folder / name).write_text(text)
    answer = train(tmp_path)
    assert answer.code == 2
    (line,) = answer.lines
    assert line.startswith("error: ")
    assert str(folder) in line
    assert named in line


@pytest.mark.parametrize("text", ['{"schema": 1, "study"', "", "[1, 2]"])
def test_a_damaged_result_is_reported_and_the_run_done_again(tmp_path, text):
    folder = own_copy(tmp_path)
    (folder / "result.json").write_text(text)
    answer = train(tmp_path, "trainer.preview_every=2")
    assert answer.code == 0, answer.text
    assert answer.text.count("the run is done again") == 1
    assert f"{folder / 'result.json'}: not a readable result row" in answer.text
    assert row_of(folder)["scores"] == row_of(finished())["scores"]


def finish_meanwhile(monkeypatch, module, outputs):
    """Another process makes the run while this one waits for its lock."""

    @contextmanager
    def lock(*_, **__):
        own_copy(outputs)
        yield

    monkeypatch.setattr(module, "lock", lock)


def test_who_waited_for_another_process_says_the_result_as_well(tmp_path, monkeypatch):
    finish_meanwhile(monkeypatch, run, tmp_path)
    answer = train(tmp_path, "trainer.preview_every=2")
    assert answer.code == 0, answer.text
    assert answer.lines[-1].startswith("part_01 siren: cd_l1 ")
    assert answer.lines[-1].endswith(str(tmp_path / PLACE))
    assert row_of(tmp_path / PLACE) == row_of(finished())


def test_a_row_of_another_study_does_not_replace_the_run_that_another_process_made(tmp_path, monkeypatch):
    own_copy(tmp_path).parents[3].rename(tmp_path / "other")
    finish_meanwhile(monkeypatch, existing_row, tmp_path)
    answer = train(tmp_path, "trainer.preview_every=2", "reuse=true")
    assert answer.code == 0, answer.text
    assert {path.name for path in (tmp_path / PLACE).iterdir()} == FILES


@pytest.mark.parametrize("key", ["scores", "seconds"])
def test_a_row_without_the_scores_of_this_config_is_shown_with_nan(tmp_path, key):
    folder = own_copy(tmp_path)
    content = row_of(folder) | {key: {}}
    (folder / "result.json").write_text(json.dumps(content))
    answer = train(tmp_path, "trainer.preview_every=2")
    assert answer.code == 0, answer.text
    assert "nan" in answer.lines[-1]
