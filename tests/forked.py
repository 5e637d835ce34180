"""Processes that begin with everything imported: a server imports it once, and each process is forked off it."""

import multiprocessing
import os
import resource
import signal
import time
from collections.abc import Callable
from functools import cache
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import numpy as np
import torch
from command_line import train

from jointsdf.model.field import JointField
from jointsdf.values import UNMOVED


@cache
def server() -> Any:
    """The context, its server started; without threads, which no fork survives."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["forked", "jointsdf.experiment.run", "jointsdf.experiment.sweep_plan"])
    return context


def start(function: Callable[..., object], *arguments: object) -> BaseProcess:
    """Call a function of a module in `tests/` in a process of its own."""
    process: BaseProcess = server().Process(target=function, args=arguments)
    process.start()
    return process


def train_and_write(outputs: Path, answer: Path, *overrides: str) -> None:
    """A quick run of train.py whose exit code and output go to a file."""
    os.environ["OMP_NUM_THREADS"] = "1"
    torch.set_num_threads(1)  # as in this process: a choice of matrix products holds for one number of threads
    found = train(outputs, *overrides)
    answer.write_text(f"{found.code}\n{found.text}")


def kill(process: BaseProcess) -> None:
    """SIGKILL, and wait until it is gone."""
    assert process.pid is not None
    os.kill(process.pid, signal.SIGKILL)
    process.join()


def wait_until(happened: Callable[[], object], process: BaseProcess, seconds: float = 300) -> None:
    """Wait for what a process does."""
    until = time.monotonic() + seconds
    while not happened() and process.is_alive() and time.monotonic() < until:
        time.sleep(0.01)
    assert happened(), "it ended before" if not process.is_alive() else "too slow"


def peak_of_query(sender: Connection, points: int) -> None:
    """Send by how many bytes a query of so many points raises this process's peak memory."""
    trunk, head = {"width": 8, "depth": 2, "tap": 1}, {"name": "none"}
    made = JointField(trunk, head, np.arange(0), UNMOVED).eval()
    where = np.random.default_rng(0).uniform(-1, 1, (points, 3))
    torch.set_num_threads(1)
    made.query(where[:70_000], what=("sdf", "gradient"))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    made.query(where, what=("sdf", "gradient"))
    sender.send(1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before))
