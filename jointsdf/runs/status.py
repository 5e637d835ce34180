"""Run status on disk: progress, failures, planned runs. Imports no torch."""

import json
import os
import socket
import time
import traceback
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from jointsdf.runs.files import write_atomically
from jointsdf.runs.lock import is_locked
from jointsdf.runs.row import ROW_FILE

STATUS, TRACEBACK, PLAN = "status.json", "traceback.txt", "sweep.json"


@dataclass(frozen=True)
class RunState:
    """State of a run.

    Attributes:
        kind: `stopped`: begun, and no process works on it; `missing`: not begun.
        step: Steps of the fit that are done.
        steps: Steps in all.
        seconds: Of the fit so far.
        error: Reason of the failure, one line.
        killed_twice: Whether two processes died at the same step, so that a third would as well.
    """

    kind: Literal["done", "running", "failed", "stopped", "missing"]
    step: int = 0
    steps: int = 0
    seconds: float = 0.0
    error: str = ""
    killed_twice: bool = False


def begin(folder: Path) -> None:
    """Mark the run as running in this process, which holds the folder's lock."""
    before = _status(folder)
    died_at = before["step"] if before.get("state") == "running" else None
    _write(folder, state="running", step=0, steps=0, seconds=0.0, died_at=died_at)
    (folder / TRACEBACK).unlink(missing_ok=True)


def note_progress(folder: Path, step: int, steps: int, seconds: float) -> None:
    """Record the progress of the fit.

    Args:
        folder: The run folder.
        step: Steps done.
        steps: Steps in all.
        seconds: Of the fit so far.
    """
    _write(folder, **(_status(folder) | {"step": step, "steps": steps, "seconds": round(seconds, 1)}))


def end(folder: Path) -> None:
    """Remove status and traceback: the folder holds its result."""
    for name in (STATUS, TRACEBACK):
        (folder / name).unlink(missing_ok=True)


def fail(folder: Path, message: str, error: BaseException) -> None:
    """Record a failure and its traceback in the run folder.

    Args:
        folder: Created where missing; nothing else in it is touched.
        message: One line.
        error: The exception.
    """
    write_atomically(folder / TRACEBACK, "".join(traceback.format_exception(error)))
    _write(folder, state="failed", error=message)


def read_state(folder: Path) -> RunState:
    """State of the folder's run, from its lock, status and result."""
    found = _status(folder)
    step, steps, seconds = int(found.get("step", 0)), int(found.get("steps", 0)), float(found.get("seconds", 0))
    if is_locked(folder):
        return RunState("running", step, steps, seconds)
    if found.get("state") == "failed":
        return RunState("failed", error=str(found.get("error")))
    if (folder / ROW_FILE).is_file():
        return RunState("done")
    if found:
        return RunState("stopped", step, steps, seconds, killed_twice=found.get("died_at") == step)
    return RunState("missing")


def plan(study: Path, folders: Iterable[Path]) -> None:
    """Add run folders to the plan of a study.

    Args:
        study: The study's folder; created where missing.
        folders: Below it.
    """
    wanted = dict.fromkeys([*planned_runs(study), *folders])
    runs = [folder.relative_to(study).as_posix() for folder in wanted]
    write_atomically(study / PLAN, json.dumps({"runs": runs}, indent=1) + "\n")


def planned_runs(study: Path) -> list[Path]:
    """Run folders that the study's sweeps planned, in their order; none where no sweep was started."""
    runs = _read(study / PLAN).get("runs")
    return [study / str(run) for run in runs] if isinstance(runs, list) else []


def duration(seconds: float) -> str:
    """Format a length of time.

    >>> [duration(seconds) for seconds in (40.0, 720.0, 11_100.0)]
    ['40 s', '12 min', '3:05 h']
    """
    minutes = round(seconds / 60)
    if seconds < 59.5:
        return f"{seconds:.0f} s"
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60}:{minutes % 60:02d} h"


def _status(folder: Path) -> dict[str, Any]:
    return _read(folder / STATUS)


def _read(path: Path) -> dict[str, Any]:
    """JSON object in a file; empty where it is missing or damaged, since no result depends on it."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def _write(folder: Path, **content: Any) -> None:
    who = {"host": socket.gethostname(), "process": os.getpid(), "time": round(time.time())}
    write_atomically(folder / STATUS, json.dumps(content | who, indent=1) + "\n")
