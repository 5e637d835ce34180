"""Load on run folders: many processes on one sweep, tables meanwhile, kills at any time, processes that stand still."""

import os
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from command_line import PLACE, train
from forked import kill, start, train_and_write, wait_until
from run_folders import assert_same_weights, finished_weights, folders_with, weights

from jointsdf.experiment import run, sweep
from jointsdf.runs import status
from jointsdf.runs.row import ROW_FILE, write_row
from jointsdf.study.__main__ import main as study

pytestmark = pytest.mark.filterwarnings("default")
EVERY_STEP = "trainer.checkpoint_seconds=0"
HEADS = ("none", "siren", "relu")
PROCESSES = (int(os.environ.get("JOINTSDF_LOAD", "0")) and 6) or 3
KILLS = int(os.environ.get("JOINTSDF_LOAD", "0")) or 3
IN_ONE_RUN = 3  # kills


def test_processes_on_one_sweep_make_each_run_once_and_tables_go_on(tmp_path: Path) -> None:
    outputs, answers = tmp_path / "outputs", [tmp_path / f"answer{k}" for k in range(PROCESSES)]
    command = ("-m", f"head={','.join(HEADS)}")
    processes = [start(train_and_write, outputs, answer, *command) for answer in answers]
    tables = []
    while any(process.is_alive() for process in processes):
        seen = len(folders_with(ROW_FILE, outputs))
        code = study(["tables", str(outputs), "--results", str(tmp_path / "none")])
        assert code == 0 or not seen, "tables of the rows that are there"
        tables.append(code)
        time.sleep(0.5)
    for answer in answers:
        code, *lines = answer.read_text().splitlines()
        assert (code, lines[-1][:7]) == ("0", "3 runs:"), lines
        assert ", 0 failed, 0 missing" in lines[-1]
    runs = [outputs / f"smoke/base/{head}/part_01/seed0" for head in HEADS]
    writers = [{path.name.split(".")[-2] for path in folder.glob("tb/events*")} for folder in runs]
    assert [len(found) for found in writers] == [1, 1, 1], "a run that two processes made"
    assert (
        not folders_with(".lock", outputs) + folders_with("last.ckpt", outputs) + folders_with("status.json", outputs)
    )
    assert study(["tables", str(outputs), "--results", str(tmp_path / "none")]) == 0
    assert len((outputs / "tables/runs.csv").read_text().splitlines()) == 1 + 2 * len(HEADS)


def test_killed_at_any_time_a_run_goes_on_to_the_same_bits(tmp_path: Path) -> None:
    began = time.monotonic()
    start(train_and_write, tmp_path / "whole", tmp_path / "answer", EVERY_STEP).join()
    whole, random, killed = time.monotonic() - began, np.random.default_rng(0), 0
    left: set[tuple[str, ...]] = set()
    for number in range(10 * KILLS):
        outputs = tmp_path / f"outputs{number}"
        for _ in range(IN_ONE_RUN):  # the later ones in what the earlier ones left
            began = time.monotonic()
            process = start(train_and_write, outputs, tmp_path / "answer", EVERY_STEP)
            process.join(random.uniform(0, whole))
            if not process.is_alive():
                whole = max(whole / 2, time.monotonic() - began)  # the machine has become less busy
                break
            kill(process)
            killed += 1
            left.add(tuple(sorted(path.name for path in outputs.glob(f"{PLACE}/*"))))
        answer = train(outputs, EVERY_STEP)
        assert answer.code == 0, answer.text
        assert_same_weights(weights(outputs), finished_weights())
        assert not list(outputs.rglob("*.tmp")) + list(outputs.rglob("last.ckpt")) + list(outputs.rglob(".lock"))
        if killed >= KILLS:
            break
    sys.stdout.write(f"{killed} kills in {number + 1} runs left {len(left)} kinds of folders: {sorted(left)}\n")
    assert killed >= KILLS
    assert len(left) > 1 or KILLS < 10, "all at one place of the run"


def test_a_run_that_stands_still_keeps_its_folder_and_goes_on_to_the_same_bits(tmp_path: Path) -> None:
    outputs = tmp_path / "outputs"
    process = start(train_and_write, outputs, tmp_path / "answer", EVERY_STEP)
    wait_until(lambda: (outputs / PLACE / "last.ckpt").is_file(), process)
    assert process.pid is not None
    os.kill(process.pid, signal.SIGSTOP)
    try:
        assert status.read_state(outputs / PLACE).kind == "running", "a process that stands still is not a dead one"
        held = {path.name: path.stat().st_mtime_ns for path in (outputs / PLACE).iterdir()}
        second = start(train_and_write, outputs, tmp_path / "other", EVERY_STEP)
        second.join(2.0)
        assert second.is_alive(), "it waits"
        kill(second)
        assert {path.name: path.stat().st_mtime_ns for path in (outputs / PLACE).iterdir()} == held
    finally:
        os.kill(process.pid, signal.SIGCONT)
    process.join()
    assert (tmp_path / "answer").read_text().startswith("0\n")
    assert_same_weights(weights(outputs), finished_weights())


def test_a_clock_that_goes_back_changes_neither_counts_nor_results(tmp_path: Path, monkeypatch) -> None:
    """An hour back at each look at it, and files that are of 1970."""
    looks = iter(range(10**9))
    monkeypatch.setattr(time, "time", lambda: 1e9 - 3600 * next(looks))

    def dated(folder, row):
        path = write_row(folder, row)
        os.utime(path, (0, 0))
        return path

    monkeypatch.setattr(run, "write_row", dated)
    said: list[str] = []
    monkeypatch.setattr(sweep.status, "duration", lambda seconds: said.append(seconds) or f"{seconds:.0f} s")
    answer = train(tmp_path, "-m", "head=siren,none", EVERY_STEP)
    assert answer.code == 0, answer.text
    assert answer.lines[-1] == "2 runs: 2 done, 0 skipped, 0 failed, 0 missing"
    assert said
    assert min(said) >= 0
    assert_same_weights(weights(tmp_path / "smoke/base/siren"), finished_weights())
    again = train(tmp_path, "-m", "head=siren,none", EVERY_STEP)
    assert again.lines[-1] == "2 runs: 0 done, 2 skipped, 0 failed, 0 missing"
