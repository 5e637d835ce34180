"""The runs that a study wants and does not have: failed, stopped half-way, or never begun."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from jointsdf.runs.row import ResultRow
from jointsdf.runs.status import PLAN, planned_runs, read_state

SHOWN = 12


@dataclass(frozen=True)
class Gap:
    """A wanted run without a result.

    Attributes:
        study: Its sweep.
        variant: Of the sweep.
        head: Segmentation head.
        shape: Catalogue name.
        seed: As in the folder's name, `seed0`.
        reason: Why there is no result, a few words.
    """

    study: str
    variant: str
    head: str
    shape: str
    seed: str
    reason: str


def find_gaps(outputs: Path, rows: Iterable[ResultRow], heads: Collection[str] | None = None) -> list[Gap]:
    """Every run that the sweeps below a folder want and that has no row.

    Args:
        outputs: Folder of the studies.
        rows: The rows there are, wherever they lie.
        heads: Those that count; None for all.
    """
    there = {(row.study, row.variant, row.head, row.shape, f"seed{row.seed}") for row in rows}
    gaps = []
    for plan in sorted(outputs.glob(f"*/{PLAN}")):
        for folder in planned_runs(plan.parent):
            run = (plan.parent.name, *folder.relative_to(plan.parent).parts)
            if len(run) == 5 and run not in there:
                found = read_state(folder)
                reason = {"failed": f"failed: {found.error}", "done": "its result cannot be read"}
                gaps.append(Gap(*run, reason=reason.get(found.kind, found.kind)))
    return [gap for gap in gaps if heads is None or gap.head in heads]


def listed(gaps: Iterable[Gap]) -> str:
    """A sentence for a caption; empty for none."""
    names = [f"{gap.head} on {gap.shape} ({gap.seed}, {gap.reason})" for gap in gaps]
    return f"Wanted runs without a result: {shortened(names)}." if names else ""


def shortened(names: Sequence[str], between: str = ", ", shown: int = SHOWN) -> str:
    """The first names, and how many more there are."""
    rest = f" and {len(names) - shown} more" if len(names) > shown else ""
    return between.join(names[:shown]) + rest
