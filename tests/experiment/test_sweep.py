"""Sweeps that survive: what is finished is left alone, what fails costs itself only, and the end says how all stand."""

import csv
import fcntl
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import yaml
from command_line import PLACE, QUICK, ROOT, Answer, call, finished, train
from omegaconf import OmegaConf

from jointsdf.experiment import build, sweep
from jointsdf.model.heads.relu import ReluHead
from jointsdf.runs import status
from jointsdf.runs.lock import Busy, lock
from jointsdf.runs.row import config_hash
from jointsdf.study.__main__ import main as study
from jointsdf.training.module import JointSDFModule

pytestmark = pytest.mark.filterwarnings("default")
SWEEPS = sorted(path.stem for path in (ROOT / "sweeps").glob("*.yaml"))
HEADS = ("none", "relu", "siren", "hybrid", "deep_skip")
TWO = ("-m", "head=none,siren")


def stored(name: str) -> dict:
    return yaml.safe_load((ROOT / "sweeps" / f"{name}.yaml").read_text())


def swept(name: str, key: str) -> list[str]:
    values = stored(name)["hydra"]["sweeper"]["params"][key]
    return [value.strip() for value in values.split(",")]


def contents(folder: Path) -> dict[Path, tuple[int, bytes]]:
    return {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in folder.rglob("*") if path.is_file()}


def folders_with(name: str, outputs: Path) -> list[str]:
    return sorted(path.parent.relative_to(outputs).as_posix() for path in outputs.rglob(name))


def row_of(folder: Path) -> dict:
    return json.loads((folder / "result.json").read_text())


def without_times(text: str) -> str:
    return re.sub(r"\[(\d+/\d+)[^]]*\]", r"[\1]", text)


@pytest.fixture
def composed(monkeypatch) -> list:
    """The configs of the runs that a sweep makes; nothing is run."""
    configs: list = []
    monkeypatch.setattr(sweep, "run_one", lambda cfg: configs.append(cfg.copy()))
    return configs


@pytest.fixture
def scores(monkeypatch) -> list[float | None]:
    """What the runs of a sweep return to Hydra, in their order."""
    returned: list[float | None] = []
    original = sweep.run_one
    monkeypatch.setattr(sweep, "run_one", lambda *args, **how: returned.append(original(*args, **how)) or returned[-1])
    return returned


def test_the_stored_sweeps_are_the_papers_and_the_ablations() -> None:
    assert {"main", "paired", "builtin", "smoke"} < set(SWEEPS)
    abc, parts = [f"abc_{n:04d}" for n in range(1, 51)], [f"part_{n:02d}" for n in range(1, 51)]
    assert (swept("main", "shape"), swept("main", "head")) == (abc, list(HEADS[1:]))
    assert (swept("paired", "shape"), swept("paired", "head")) == (abc, list(HEADS))
    assert (swept("builtin", "shape"), swept("builtin", "head")) == (parts, list(HEADS))
    assert (swept("points", "shape"), swept("points", "head")) == (abc, ["none", "hybrid"])
    assert set(swept("smoke", "shape")) < set(parts)
    assert len(swept("smoke", "shape")) * len(swept("smoke", "head")) >= 4


@pytest.mark.parametrize("name", SWEEPS)
def test_a_stored_sweep_makes_the_runs_that_it_says(tmp_path, composed, name) -> None:
    """Narrowed to one of its shapes by the command line."""
    shape = swept(name, "shape")[0]
    answer = call("train.py", f"sweeps={name}", f"shape={shape}", f"paths.outputs={tmp_path}", "paths.abc_root=/data")
    params = {key: values.count(",") + 1 for key, values in stored(name)["hydra"]["sweeper"]["params"].items()}
    del params["shape"]
    count = 1
    for values in params.values():
        count *= values
    assert answer.code == 1, "nothing was run"
    assert answer.lines[-1] == f"{count} runs: 0 done, 0 skipped, 0 failed, {count} missing"
    assert len(composed) == count
    assert {cfg.shape for cfg in composed} == {shape}
    assert {cfg.study for cfg in composed} == {name}
    assert {cfg.paths.abc_missing for cfg in composed} == {"error" if shape.startswith("abc") else "fallback"}
    assert {cfg.recipe for cfg in composed} == {name if name in ("smoke", "points") else "fast"}
    for cfg in composed:
        build.check_config(cfg)
    wanted = [build.folder_of(cfg) for cfg in composed]
    assert status.planned_runs(tmp_path / name) == wanted
    assert len(set(wanted)) == count, "every run has a folder of its own"


@pytest.mark.parametrize("name", [name for name in SWEEPS if (ROOT / "results" / name / "runs.csv").is_file()])
def test_the_committed_rows_are_of_the_runs_that_the_sweep_makes(tmp_path, composed, name) -> None:
    """What decides their numbers, shape and seed apart, is the same, so that no clone makes them again."""
    with (ROOT / "results" / name / "runs.csv").open(newline="") as file:
        made = {(row["variant"], row["head"]): row["settings_hash"] for row in csv.DictReader(file)}
    shape = swept(name, "shape")[0]
    call("train.py", f"sweeps={name}", f"shape={shape}", f"paths.outputs={tmp_path}", "paths.abc_root=/data")
    wanted = {}
    for cfg in composed:
        build.check_config(cfg)
        settings = OmegaConf.to_container(cfg, resolve=True)
        wanted[cfg.variant, cfg.head.name] = config_hash(build.shared_settings(settings))
    shared = wanted.keys() & made.keys()
    assert shared
    assert {key: wanted[key] for key in shared} == {key: made[key] for key in shared}


def test_the_borders_of_the_recipe_are_one_side_of_the_comparison(tmp_path, composed) -> None:
    """So that `main` has that side already."""
    run = ("shape=part_02", "head=siren", f"paths.outputs={tmp_path}")
    call("train.py", "sweeps=boundaries", *run)
    call("train.py", "sweeps=main", "paths.abc_missing=fallback", *run)
    plain, balanced, default = ((cfg.data.counts.balanced, cfg.data.counts.borders) for cfg in composed)
    assert plain == (0.0, 0.0)
    assert balanced == default


def test_the_command_line_narrows_any_axis(tmp_path, composed) -> None:
    call("train.py", "sweeps=ablation_tap", "shape=part_02,part_03", "trunk.tap=2", f"paths.outputs={tmp_path}")
    assert [(cfg.shape, cfg.trunk.tap, cfg.variant) for cfg in composed] == [
        ("part_02", 2, "tap=2"),
        ("part_03", 2, "tap=2"),
    ]


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


@pytest.mark.usefixtures("composed")
def test_runs_that_share_a_folder_are_named(tmp_path) -> None:
    answer = train(tmp_path, "-m", "trunk.tap=2,3")
    assert "2 runs share 1 folders: name what differs in variant=, e.g. 'variant=tap=${trunk.tap}'" in answer.text


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

    def forbidden(*_):
        raise AssertionError("trained again")

    monkeypatch.setattr(JointSDFModule, "training_step", forbidden)
    answer = train(tmp_path / "clone", *common)
    assert answer.code == 0, answer.text
    assert answer.lines[-1] == "2 runs: 0 done, 2 skipped, 0 failed, 0 missing"
    assert scores[:2] == scores[2:]
    for head in ("none", "siren"):
        place = f"mine/base/{head}/part_01/seed0/result.json"
        there, here = (json.loads((tmp_path / root / place).read_text()) for root in ("clone", "here"))
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


HOLD = """
import sys, time
from pathlib import Path
from jointsdf.runs import status
from jointsdf.runs.lock import lock
with lock(Path(sys.argv[1]), wait=False):
    status.begin(Path(sys.argv[1]))
    status.note_progress(Path(sys.argv[1]), 7, 20, 14.0)
    print("held", flush=True)
    time.sleep(float(sys.argv[2]))
"""


@pytest.fixture
def held(tmp_path) -> Iterator[subprocess.Popen]:
    """Another process that works on the run folder until it is killed."""
    command = [sys.executable, "-c", HOLD, str(tmp_path / PLACE), "3600"]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


def test_a_lock_keeps_others_out_and_dies_with_its_process(tmp_path, held) -> None:
    folder = tmp_path / PLACE
    assert status.read_state(folder) == status.RunState("running", 7, 20, 14.0)
    with pytest.raises(Busy), lock(folder, wait=False):
        raise AssertionError("two at once")
    held.send_signal(signal.SIGKILL)
    held.wait()
    assert status.read_state(folder) == status.RunState("stopped", 7, 20, 14.0)
    with lock(folder, wait=False):
        assert (folder / ".lock").exists()
    assert not (folder / ".lock").exists()


def test_a_run_of_another_process_is_looked_at_again_in_the_end(tmp_path, held, monkeypatch) -> None:
    original = sweep.wait_for_postponed

    def other_dies_first() -> None:
        assert folders_with("result.json", tmp_path) == ["smoke/base/none/part_01/seed0"], "went on with the next"
        held.send_signal(signal.SIGKILL)
        original()

    monkeypatch.setattr(sweep, "wait_for_postponed", other_dies_first)
    answer = train(tmp_path, "-m", "head=siren,none")
    assert answer.code == 0, answer.text
    assert f"{tmp_path / PLACE}: another process works on it; it is looked at again in the end" in answer.lines
    assert answer.lines[-1] == "2 runs: 2 done, 0 skipped, 0 failed, 0 missing"


def start(outputs: Path, *overrides: str) -> subprocess.Popen:
    command = [sys.executable, ROOT / "train.py", *QUICK, f"paths.outputs={outputs}", *overrides]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}
    pipe = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    return subprocess.Popen(command, env=environment, cwd=outputs.parent, **pipe)


def output_of(process: subprocess.Popen) -> Answer:
    text = process.communicate(timeout=1500)[0]
    return Answer(process.returncode, text)


def wait_until(happened, process: subprocess.Popen, seconds: float = 300) -> None:
    until = time.monotonic() + seconds
    while not happened() and process.poll() is None and time.monotonic() < until:
        time.sleep(0.02)
    assert happened(), process.communicate()[0] if process.poll() is not None else "too slow"


SMOKE = ("sweeps=smoke", "shape=part_01", "trainer.max_steps=40", "trainer.checkpoint_seconds=0")


@pytest.mark.slow
def test_kill_9_half_way_and_the_second_start_finishes_only_the_rest(tmp_path) -> None:
    out = tmp_path / "out"
    with start(out, *SMOKE) as process:
        wait_until(lambda: len(folders_with("result.json", out)) == 2 and folders_with("last.ckpt", out), process)
        process.kill()
    assert process.returncode == -signal.SIGKILL
    finished_before = folders_with("result.json", out)
    before = {name: contents(out / name) for name in finished_before}
    assert 2 <= len(finished_before) < 5
    second = output_of(start(out, *SMOKE))
    assert second.code == 0, second.text
    rest = 5 - len(finished_before)
    assert second.lines[-1] == f"5 runs: {rest} done, {5 - rest} skipped, 0 failed, 0 missing"
    assert {name: contents(out / name) for name in finished_before} == before
    assert len(folders_with("result.json", out)) == 5
    assert not folders_with("status.json", out) + folders_with(".lock", out) + folders_with("last.ckpt", out)


@pytest.mark.slow
def test_two_sweeps_at_once_do_every_run_once(tmp_path) -> None:
    out = tmp_path / "out"
    answers = [output_of(process) for process in [start(out, *SMOKE), start(out, *SMOKE)]]
    assert [answer.code for answer in answers] == [0, 0], answers
    counts = [re.fullmatch(r"5 runs: (\d) done, (\d) skipped, 0 failed, 0 missing", a.lines[-1]) for a in answers]
    made = [len([line for line in answer.lines if line.startswith("[")]) for answer in answers]
    assert all(counts)
    assert len(folders_with("result.json", out)) == 5
    assert not folders_with(".lock", out)
    assert max(made) <= 5
    writers = [{path.name.split(".")[-2] for path in tb.glob("events*")} for tb in out.glob("smoke/*/*/*/seed0/tb")]
    assert [len(processes) for processes in writers] == [1] * 5, "a run that two processes write"


@pytest.fixture
def when_waiting(monkeypatch) -> Callable[[Callable[[], object]], None]:
    """Has something done as soon as a run waits for another process."""
    original = fcntl.flock

    def arrange(action: Callable[[], object]) -> None:
        def flock(file, how: int) -> None:
            if how == fcntl.LOCK_EX:
                action()
            original(file, how)

        monkeypatch.setattr(fcntl, "flock", flock)

    return arrange


def test_a_plain_run_waits_for_the_other_process(tmp_path, held, when_waiting) -> None:
    when_waiting(held.kill)
    answer = train(tmp_path)
    assert answer.code == 0, answer.text
    assert f"{tmp_path / PLACE}: another process works on it; waiting for that one" in answer.lines
    assert folders_with("result.json", tmp_path) == [PLACE.as_posix()]


def test_a_run_that_the_other_process_has_finished_meanwhile_is_not_made_again(tmp_path, held, when_waiting) -> None:
    made = finished()

    def finish() -> None:
        shutil.copytree(made, tmp_path / PLACE, dirs_exist_ok=True)
        held.kill()

    when_waiting(finish)
    answer = train(tmp_path)
    assert answer.code == 0, answer.text
    assert row_of(tmp_path / PLACE) == row_of(finished())
