"""Planned runs of a study without a result: failed, stopped half-way, or never begun."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from jointsdf.runs.plan import PLAN, planned_runs
from jointsdf.runs.row import ResultRow
from jointsdf.runs.status import read_state

SHOWN = 12  # names in a list; of more, their count


@dataclass(frozen=True)
class MissingRun:
    """A planned run without a result.

    Attributes:
        study: Its sweep.
        variant: Of the sweep.
        head: Segmentation head.
        shape: Catalogue name.
        seed: As in the folder's name, `seed0`.
        reason: Why it has none, a few words.
    """

    study: str
    variant: str
    head: str
    shape: str
    seed: str
    reason: str


def find_missing_runs(
    outputs: Path, rows: Iterable[ResultRow], heads: Collection[str] | None = None
) -> list[MissingRun]:
    """Find the planned runs below a folder that have no row.

    Args:
        outputs: Folder of the studies.
        rows: All rows, of runs there and committed ones.
        heads: Only these heads; None for all.
    """
    present = {(row.study, row.variant, row.head, row.shape, f"seed{row.seed}") for row in rows}
    missing = []
    for plan in sorted(outputs.glob(f"*/{PLAN}")):
        for folder in planned_runs(plan.parent):
            run = (plan.parent.name, *folder.relative_to(plan.parent).parts)
            if len(run) == 5 and run not in present:
                found = read_state(folder)
                reason = {"failed": f"failed: {found.error}", "done": "its result cannot be read"}
                missing.append(MissingRun(*run, reason=reason.get(found.kind, found.kind)))
    return [run for run in missing if heads is None or run.head in heads]


def name_missing(runs: Iterable[MissingRun]) -> str:
    """A sentence for a caption; empty for none."""
    names = [f"{run.head} on {run.shape} ({run.seed}, {run.reason})" for run in runs]
    return f"Wanted runs without a result: {shorten(names)}." if names else ""


def shorten(names: Sequence[str], between: str = ", ", shown: int = SHOWN) -> str:
    """The first names, and the number of the others.

    >>> shorten(["a", "b", "c"], shown=2)
    'a, b and 1 more'
    """
    rest = f" and {len(names) - shown} more" if len(names) > shown else ""
    return between.join(names[:shown]) + rest
