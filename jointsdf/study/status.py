"""Status of a study as text: per variant a grid of heads by shapes, failures with their reasons, time left."""

import math
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from statistics import fmean

from jointsdf.errors import DamagedFile
from jointsdf.runs.plan import read_plan
from jointsdf.runs.row import ROW_FILE, read_row
from jointsdf.runs.status import TRACEBACK, RunState, duration, read_state

COUNTED = ("done", "running", "failed", "damaged", "stopped", "missing")


def format_status(study: Path) -> str:
    """Status of the study's runs, as text for a terminal.

    Args:
        study: Its folder, `<outputs>/<study>`.

    Raises:
        ValueError: There are no runs in it. One line, with the fix.
    """
    planned, damaged = read_plan(study)
    folders = dict.fromkeys([*planned, *sorted(study.glob("*/*/*/seed*"))])
    if not folders:
        said = damaged or f"{study}: no runs there"
        raise ValueError(f"{said}; `python train.py sweeps={study.name}` starts a stored sweep")
    states = {folder: read_state(folder) for folder in folders}
    cells = {folder: _cell(found) for folder, found in states.items()}
    kinds: Counter[str] = Counter(found.kind for found in states.values())
    seconds: list[float] = []
    problems = [f"damaged: {line}" for line in (damaged, *(found.problem for found in states.values())) if line]
    for folder, found in states.items():
        if found.kind == "failed":
            problems.append(f"failed: {folder}: {found.error} ({TRACEBACK} there)")
        if found.kind == "done":
            try:
                seconds.append(read_row(folder / ROW_FILE).seconds.get("total", math.nan))
            except DamagedFile as error:
                cells[folder] = "damaged"
                kinds.update(done=-1, damaged=1)
                problems.append(f"damaged: {error}")
    seconds = [total for total in seconds if math.isfinite(total)]
    counts = ", ".join(f"{kinds[kind]} {kind}" for kind in COUNTED if kinds[kind])
    left = len(folders) - kinds["done"] - kinds["failed"]
    if seconds and left:
        counts += f"; about {duration(fmean(seconds) * left)} left, one after the other"
    return "\n".join([f"{study}: {len(folders)} runs: {counts}", *_grids(cells), *problems])


def _cell(found: RunState) -> str:
    """A run's state in a few characters."""
    share = f"{100 * found.step // found.steps}%" if found.steps else ""
    if found.kind == "missing":
        return "-"
    if found.kind != "running":
        return f"{found.kind} {share}".strip()
    if not found.steps:
        return "starting"
    if found.step >= found.steps:
        return "measuring"
    rest = duration(found.seconds / found.step * (found.steps - found.step)) if found.step else "?"
    return f"{share}, {rest}"


def _grids(cells: dict[Path, str]) -> Iterable[str]:
    """A block of lines per variant: a line per shape, a column per head, or per head and seed where seeds differ."""
    seeds = {folder.name for folder in cells}
    for variant in dict.fromkeys(folder.parts[-4] for folder in cells):
        grid: dict[str, dict[str, str]] = {}
        for folder, cell in cells.items():
            _, head, shape, seed = folder.parts[-4:]
            if folder.parts[-4] == variant:
                grid.setdefault(shape, {})[head if len(seeds) == 1 else f"{head} {seed}"] = cell
        columns = list(dict.fromkeys(column for line in grid.values() for column in line))
        lines = [
            [variant, *columns],
            *([shape, *(line.get(column, "") for column in columns)] for shape, line in grid.items()),
        ]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        yield ""
        yield from ("  ".join(map(str.ljust, line, widths)).rstrip() for line in lines)
