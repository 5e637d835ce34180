"""Sweeps in one process: finished runs are left alone, a failed one stops no other, the last line counts all."""

import json
import os
import re
import signal

import pytest
from command_line import PLACE, train
from run_folders import contents, folders_with, row_of
from steps import forbid_training

from jointsdf.experiment import sweep
from jointsdf.model.heads.relu import ReluHead
from jointsdf.runs import status
from jointsdf.runs.lock import lock
from jointsdf.study.__main__ import main as study
from jointsdf.training.module import JointSDFModule

pytestmark = pytest.mark.filterwarnings("default")
TWO = ("-m", "head=none,siren")


def without_times(text: str) -> str:
    return re.sub(r"\[(\d+/\d+)[^]]*\]", r"[\1]", text)


@pytest.fixture
def scores(monkeypatch) -> list[float | None]:
    """What the runs of a sweep return to Hydra, in their order."""
    returned: list[float | None] = []
    original = sweep.run_one
    monkeypatch.setattr(
        sweep, "run_one", lambda *args, **options: returned.append(original(*args, **options)) or returned[-1]
    )
    return returned


def test_a_finished_run_is_skipped_untouched_and_its_score_returned(tmp_path, scores) -> None:
    first = train(tmp_path, *TWO)
    assert first.code == 0, first.text
    assert first.lines[0] == "2 runs wanted, 0 of them finished before"
    assert [line.split(":")[0] for line in without_times(first.text).splitlines()[1:3]] == [
        "[1/2] part_01 none",
        "[2/2] part_01 siren",
    ]
    assert first.lines[3:] == ["2 runs: 2 done, 0 skipped, 0 failed, 0 missing"]
    before = contents(tmp_path / "smoke/base")
    again = train(tmp_path, *TWO)
    assert again.code == 0
    assert again.lines == ["2 runs wanted, 2 of them finished before", "2 runs: 0 done, 2 skipped, 0 failed, 0 missing"]
    assert contents(tmp_path / "smoke/base") == before
    rows = [row_of(tmp_path / f"smoke/base/{head}/part_01/seed0") for head in ("none", "siren")]
    assert scores == [row["scores"]["unit"]["cd_l1"] for row in rows] * 2


def test_a_bug_in_the_middle_costs_one_run(tmp_path, monkeypatch) -> None:
    def broken(self, samples, batch_idx):
        if isinstance(self.field.head, ReluHead):
            raise RuntimeError("a bug\nof ours")
        return original(self, samples, batch_idx)

    original = JointSDFModule.training_step
    three = ("-m", "head=none,relu,siren")
    with monkeypatch.context() as patch:
        patch.setattr(JointSDFModule, "training_step", broken)
        answer = train(tmp_path, *three)
    assert answer.code == 1
    assert "Traceback" not in answer.text
    assert "error: base/relu/part_01/seed0: RuntimeError: a bug of ours" in answer.lines
    folder = tmp_path / "smoke/base/relu/part_01/seed0"
    assert answer.lines[-2:] == [
        f"failed: {folder}: RuntimeError: a bug of ours",
        "3 runs: 2 done, 0 skipped, 1 failed, 0 missing",
    ]
    assert "in broken" in (folder / "traceback.txt").read_text()
    assert json.loads((folder / "status.json").read_text())["state"] == "failed"
    assert len(folders_with("result.json", tmp_path)) == 2
    mended = train(tmp_path, *three)
    assert mended.code == 0
    assert mended.lines[-1] == "3 runs: 1 done, 2 skipped, 0 failed, 0 missing"
    assert not folders_with("status.json", tmp_path) + folders_with("traceback.txt", tmp_path)


def test_a_shape_that_is_not_there_costs_its_runs_only(tmp_path) -> None:
    absent = ("paths.abc_missing=error", f"paths.abc_root={tmp_path / 'absent'}")
    answer = train(tmp_path / "out", "-m", "shape=abc_0003,nowhere/box.stl,part_01", *absent)
    assert answer.code == 1
    assert answer.lines[-1] == "3 runs: 1 done, 0 skipped, 2 failed, 0 missing"
    assert folders_with("traceback.txt", tmp_path / "out") == [
        "smoke/base/siren/abc_0003/seed0",
        "smoke/base/siren/box/seed0",
    ]
    assert folders_with("result.json", tmp_path / "out") == [PLACE.as_posix()]


def test_another_config_in_the_folder_is_refused_with_both_hashes_and_left_as_it_is(tmp_path) -> None:
    assert train(tmp_path, "-m", "head=siren").code == 0
    kept = row_of(tmp_path / PLACE)
    answer = train(tmp_path, "-m", "head=siren", "trainer.clip=3")
    assert answer.code == 1
    (error,) = (line for line in answer.lines if line.startswith("error: "))
    there = kept["provenance"]["config_hash"]
    (here,) = re.findall(rf"trainer.clip \(10.0 -> 3.0\); hash {there} there, (\w{{16}}) here; variant=", error)
    assert here != there
    assert row_of(tmp_path / PLACE) == kept
    assert train(tmp_path, "-m", "head=siren").lines[-1] == "1 runs: 0 done, 1 skipped, 0 failed, 0 missing"
    assert not folders_with("status.json", tmp_path)
    forced = train(tmp_path, "-m", "head=siren", "trainer.clip=3", "force=true")
    assert forced.code == 0
    assert row_of(tmp_path / PLACE)["provenance"]["config_hash"] == here


def test_a_damaged_result_is_reported_and_the_run_done_again(tmp_path) -> None:
    assert train(tmp_path, *TWO).code == 0
    scores = row_of(tmp_path / PLACE)["scores"]
    (tmp_path / PLACE / "result.json").write_text('{"schema": 1, "study"')
    answer = train(tmp_path, *TWO)
    assert answer.code == 0
    (line,) = (line for line in answer.lines if "not a readable result row" in line)
    assert str(tmp_path / PLACE / "result.json") in line
    assert line.endswith("; the run is done again")
    assert answer.lines[-1] == "2 runs: 1 done, 1 skipped, 0 failed, 0 missing"
    assert row_of(tmp_path / PLACE)["scores"] == scores


def test_ctrl_c_stops_the_sweep_and_the_same_command_goes_on(tmp_path, monkeypatch) -> None:
    original = JointSDFModule.training_step

    def interrupted(self, samples, batch_idx):
        if self.global_step == 2 and isinstance(self.field.head, ReluHead):
            os.kill(os.getpid(), signal.SIGINT)
        return original(self, samples, batch_idx)

    three = ("-m", "head=none,relu,siren")
    with monkeypatch.context() as patch:
        patch.setattr(JointSDFModule, "training_step", interrupted)
        stopped = train(tmp_path, *three)
    assert stopped.code == 130
    assert stopped.lines[-1] == "3 runs: 1 done, 0 skipped, 0 failed, 2 missing"
    resumed = train(tmp_path, *three)
    assert resumed.code == 0
    assert "going on from step 3 of 4" in resumed.lines
    assert resumed.lines[-1] == "3 runs: 2 done, 1 skipped, 0 failed, 0 missing"


def test_a_run_of_another_study_is_reused(tmp_path) -> None:
    common = (f"paths.results={tmp_path / 'results'}", "reuse=true")
    out = tmp_path / "out"
    assert train(out, "-m", "study=first", "head=siren", *common).code == 0
    answer = train(out, "-m", "study=second", "variant=again", "head=none,siren", *common)
    assert answer.code == 0
    assert answer.lines[-1] == "2 runs: 1 done, 1 skipped, 0 failed, 0 missing"
    first, second = out / "first/base/siren/part_01/seed0", out / "second/again/siren/part_01/seed0"
    taken, made = row_of(second), row_of(first)
    assert taken["provenance"].pop("reused_from") == "first/base/siren/part_01/seed0"
    assert taken == made | {"study": "second", "variant": "again"}
    assert sorted(path.name for path in second.iterdir()) == ["config.yaml", "result.json"]
    before = contents(second)
    assert train(out, "study=second", "variant=again", *common).code == 0
    assert contents(second) == before
    assert train(out, "study=second", "variant=again", "reuse=false").code == 0
    assert "reused_from" not in row_of(second)["provenance"]
    assert (second / "mesh.ply").is_file()


def test_committed_rows_count_as_finished_in_any_clone(tmp_path, monkeypatch, scores) -> None:
    common = (*TWO, "study=mine", "reuse=true", f"paths.results={tmp_path / 'results'}")
    assert train(tmp_path / "here", *common).code == 0
    assert study(["results", "mine", str(tmp_path / "here"), "--results", str(tmp_path / "results")]) == 0

    forbid_training(monkeypatch)
    answer = train(tmp_path / "clone", *common)
    assert answer.code == 0, answer.text
    assert answer.lines[-1] == "2 runs: 0 done, 2 skipped, 0 failed, 0 missing"
    assert scores[:2] == scores[2:]
    for head in ("none", "siren"):
        there, here = (row_of(tmp_path / root / f"mine/base/{head}/part_01/seed0") for root in ("clone", "here"))
        assert there["provenance"].pop("reused_from") == (tmp_path / "results/mine/runs.csv").as_posix()
        assert there == here
    other = train(tmp_path / "clone", *common, "seed=1")
    assert "trained again" in other.text, "another seed is another run"


def test_two_deaths_at_the_same_step_are_a_failure_and_the_next_start_tries_again(tmp_path) -> None:
    folder = tmp_path / PLACE
    with lock(folder, wait=False):
        status.begin(folder)
        status.begin(folder)  # as a second process does after the first was killed
    answer = train(tmp_path, *TWO)
    assert answer.code == 1
    assert f"failed: {folder}: its process was killed twice at step 0: is memory short?" in answer.text
    assert answer.lines[-1] == "2 runs: 1 done, 0 skipped, 1 failed, 0 missing"
    assert train(tmp_path, *TWO).code == 0


@pytest.mark.parametrize("engine", ["ray", "slurm"])
def test_an_engine_that_is_not_installed_is_one_line(tmp_path, engine, monkeypatch) -> None:
    monkeypatch.setattr(sweep, "find_spec", lambda _: None)
    answer = train(tmp_path / "out", *TWO, f"hydra/launcher={engine}")
    assert answer.code == 2
    assert answer.lines[-1] == f"error: hydra/launcher={engine} is not installed: pip install '.[{engine}]'"
    assert not (tmp_path / "out").exists()
