"""Several processes on the same runs: each run is made once, and killed processes cost nothing that was finished."""

import fcntl
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
from command_line import PLACE, QUICK, ROOT, Answer, finished, train
from run_folders import contents, folders_with, row_of

from jointsdf.experiment import sweep
from jointsdf.runs import status
from jointsdf.runs.lock import Busy, lock

pytestmark = pytest.mark.filterwarnings("default")
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


def test_a_run_of_another_process_is_tried_again_at_the_end(tmp_path, held, monkeypatch) -> None:
    original = sweep.wait_for_postponed

    def other_dies_first() -> None:
        assert folders_with("result.json", tmp_path) == ["smoke/base/none/part_01/seed0"], "went on with the next"
        held.send_signal(signal.SIGKILL)
        original()

    monkeypatch.setattr(sweep, "wait_for_postponed", other_dies_first)
    answer = train(tmp_path, "-m", "head=siren,none")
    assert answer.code == 0, answer.text
    assert f"{tmp_path / PLACE}: another process works on it; it is tried again at the end" in answer.lines
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
        def flock(file, operation: int) -> None:
            if operation == fcntl.LOCK_EX:
                action()
            original(file, operation)

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
