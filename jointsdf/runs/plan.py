"""Plan of a study: the run folders that its sweeps want. Imports no torch."""

import json
import logging
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from jointsdf.errors import shown
from jointsdf.runs.files import write_atomically
from jointsdf.runs.row_content import is_folder_name
from jointsdf.runs.stored_json import read_json

PLAN = "sweep.json"
MOST_BYTES = 1 << 26  # of half a million runs
LEVELS = 4  # of a run below its study: variant, head, shape, seed

log = logging.getLogger(__name__)


def plan(study: Path, folders: Iterable[Path]) -> None:
    """Add run folders to the plan of a study; a damaged plan is logged and made anew.

    Args:
        study: The study's folder; created where missing.
        folders: Below it.
    """
    before, problem = read_plan(study)
    if problem:
        log.warning(problem)
    runs = [folder.relative_to(study).as_posix() for folder in dict.fromkeys([*before, *folders])]
    write_atomically(study / PLAN, json.dumps({"runs": runs}, indent=1) + "\n")


def planned_runs(study: Path) -> list[Path]:
    """Run folders that the study's sweeps planned, in their order; none where no sweep was started."""
    return read_plan(study)[0]


def read_plan(study: Path) -> tuple[list[Path], str]:
    """Read the plan of a study.

    Args:
        study: The study's folder.

    Returns:
        The run folders in their order, and why the plan was passed over, one line, where it is damaged.
    """
    path = study / PLAN
    try:
        return [study / run for run in _check(read_json(path, MOST_BYTES))], ""
    except FileNotFoundError:
        return [], ""
    except ValueError as error:
        fix = f"the next sweep of {shown(study.name)} replaces it"
        return [], f"{shown(path, 4096)}: not a readable plan: {error}; {fix}"


def _check(content: Any) -> list[str]:
    """The runs, relative paths below the study.

    Raises:
        ValueError: It is no plan.
    """
    runs = content.get("runs") if isinstance(content, dict) else None
    if not isinstance(runs, list):
        raise ValueError("no list of runs in it")
    for run in runs:
        names = run.split("/") if isinstance(run, str) else []
        if len(names) != LEVELS or not all(map(is_folder_name, names)):
            raise ValueError(f"{shown(repr(run))} is no folder of a run below the study, variant/head/shape/seed")
    return runs
