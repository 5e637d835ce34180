"""Run status on disk: progress and failures. Imports no torch."""

import json
import logging
import os
import socket
import time
import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from jointsdf.errors import first_line, shown
from jointsdf.runs.files import write_atomically
from jointsdf.runs.lock import is_locked
from jointsdf.runs.row import ROW_FILE
from jointsdf.runs.row_content import LONGEST_TIME
from jointsdf.runs.stored_json import number, read_json, whole

STATUS, TRACEBACK = "status.json", "traceback.txt"
MOST_SHOWN = 2000  # characters of a reason

log = logging.getLogger(__name__)


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
        problem: Why the status was passed over, one line; empty where it was not.
    """

    kind: Literal["done", "running", "failed", "stopped", "missing"]
    step: int = 0
    steps: int = 0
    seconds: float = 0.0
    error: str = ""
    killed_twice: bool = False
    problem: str = ""


def begin(folder: Path) -> None:
    """Mark the run as running in this process, which holds the folder's lock."""
    before, _ = _status(folder)
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
    before, _ = _status(folder)
    _write(folder, **({"state": "running"} | before | {"step": step, "steps": steps, "seconds": round(seconds, 1)}))


def end(folder: Path) -> None:
    """Remove status and traceback: the folder holds its result."""
    for name in (STATUS, TRACEBACK):
        (folder / name).unlink(missing_ok=True)


def fail(folder: Path, message: str, error: BaseException) -> None:
    """Record a failure and its traceback in the run folder; a folder that cannot be written is logged.

    Args:
        folder: Created where missing; nothing else in it is touched.
        message: One line.
        error: The exception.
    """
    try:
        write_atomically(folder / TRACEBACK, "".join(traceback.format_exception(error)))
        _write(folder, state="failed", error=message[:MOST_SHOWN])
    except OSError as failure:
        log.warning("%s: the failure cannot be recorded there (%s)", folder, first_line(failure))


def read_state(folder: Path) -> RunState:
    """State of the folder's run, from its lock, status and result; a damaged status counts as none."""
    found, problem = _status(folder)
    step, steps, seconds = found.get("step", 0), found.get("steps", 0), found.get("seconds", 0.0)
    if is_locked(folder):
        return RunState("running", step, steps, seconds, problem=problem)
    if found.get("state") == "failed":
        return RunState("failed", error=shown(found["error"], MOST_SHOWN))
    if (folder / ROW_FILE).is_file():
        return RunState("done", problem=problem)
    if found:
        return RunState("stopped", step, steps, seconds, killed_twice=found["died_at"] == step)
    return RunState("missing", problem=problem)


def duration(seconds: float) -> str:
    """Format a length of time.

    >>> [duration(seconds) for seconds in (40.0, 720.0, 11_100.0)]
    ['40 s', '12 min', '3:05 h']
    """
    minutes = round(seconds / 60)
    if seconds < 59.5:
        return f"{seconds:.0f} s"
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60}:{minutes % 60:02d} h"


def _status(folder: Path) -> tuple[dict[str, Any], str]:
    """The status, checked; empty where there is none. And why it was passed over, one line, where it is damaged."""
    path = folder / STATUS
    try:
        return _check(read_json(path)), ""
    except FileNotFoundError:
        return {}, ""
    except ValueError as error:
        return {}, f"{shown(path, 4096)}: not a readable status: {error}; the next run replaces it"


def _check(content: Any) -> dict[str, Any]:
    """The entries that are read; those of later versions are left out.

    Raises:
        ValueError: It is no status.
    """
    if not isinstance(content, dict) or content.get("state") not in ("running", "failed"):
        raise ValueError("no state of a run in it")
    if content["state"] == "failed":
        if not isinstance(content.get("error"), str):
            raise ValueError("no reason of the failure in it")
        return {"state": "failed", "error": content["error"]}
    if missing := [name for name in ("step", "steps", "seconds") if content.get(name) is None]:
        raise ValueError(f"no {missing[0]} in it")
    died_at = content.get("died_at")
    return {
        "state": "running",
        "step": whole(content["step"]),
        "steps": whole(content["steps"]),
        "seconds": number(content["seconds"], 0, LONGEST_TIME),
        "died_at": None if died_at is None else whole(died_at),
    }


def _write(folder: Path, **content: Any) -> None:
    who = {"host": socket.gethostname(), "process": os.getpid(), "time": round(time.time())}
    write_atomically(folder / STATUS, json.dumps(content | who, indent=1) + "\n")
