"""Time to quality on three built-in parts: `fast` and `points` whole, `paper` by a prefix scaled to its 10,000 steps.

Ours: seconds of the whole run (fit, extraction, measures). Theirs: seconds of the `paper` fit, extrapolated from its
first steps. Quality stands beside what is perfect: cd_l1 over its floor, miou_exact over its ceiling, surface_p99 in
shares of the longest side; the prefix of `paper` is not fitted and has none.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import replace

from benchmarks.scene import composed
from benchmarks.table import Row
from jointsdf.experiment.run import run
from jointsdf.runs.row import ResultRow

SHAPES = ("part_01", "part_12", "part_23")
PAPER_STEPS = 10_000
GIB, SECONDS = 6.0, 90.0  # allowed: memory of `paper`, a whole run of `fast`


def rows(shapes: Sequence[str] = SHAPES, prefix: int = 3, overrides: Sequence[str] = ()) -> list[Row]:
    """Seconds and quality of every recipe and shape.

    Args:
        shapes: Built-in parts.
        prefix: Steps of `paper` that are timed.
        overrides: Of the configs, to make the runs smaller; then nothing is claimed.
    """
    short = [f"trainer.max_steps={prefix}", "extraction.resolution=32", *overrides]
    found = []
    for shape in shapes:
        paper = finished("paper", shape, short)
        memory, seconds = paper.peak_memory_mb / 1024, paper.seconds["fit"] * PAPER_STEPS / prefix
        name = f"paper, {shape}: peak memory"
        found.append(Row(name, "allowed memory", memory, GIB, "GiB", memory / GIB, 1.0, at_least=False))
        for recipe in ("fast", "points"):
            row = finished(recipe, shape, overrides)
            taken, what = row.seconds["total"], f"{recipe}, {shape}"
            found.append(Row(what, f"paper's fit, from {prefix} steps", taken, seconds, "s", seconds / taken))
            if recipe == "fast":
                found.append(Row(what, "allowed seconds", taken, SECONDS, "s", taken / SECONDS, 1.0, at_least=False))
            found += quality(what, row, claimed=recipe == "fast")
    return [replace(row, target=None) for row in found] if overrides else found


def quality(what: str, row: ResultRow, *, claimed: bool) -> list[Row]:
    """Surface and labels of a run, beside what is perfect."""
    scores = row.scores["unit"]
    cd, floor, p99, pieces = (scores[name] for name in ("cd_l1", "cd_l1_floor", "surface_p99", "components"))
    miou, ceiling, whole = scores["miou_exact"], scores["miou_exact_ceiling"], scores["components_gt"]
    found = [
        Row(f"{what}: cd_l1", "its floor", cd, floor, "x 1e-2", cd / floor, 1.05, at_least=False),
        Row(f"{what}: surface_p99", "longest side", p99, 1.0, "", p99, 0.005, at_least=False),
        Row(f"{what}: miou_exact", "its ceiling", miou, ceiling, "", miou / ceiling, 0.95),
        Row(f"{what}: pieces", "of the truth", pieces, whole, "", pieces / whole, 1.0, at_least=False),
    ]
    return found if claimed else [replace(item, target=None) for item in found]


def finished(recipe: str, shape: str, overrides: Sequence[str]) -> ResultRow:
    """A run, nothing of which is kept."""
    with tempfile.TemporaryDirectory() as outputs:
        return run(composed(f"recipe={recipe}", f"shape={shape}", f"paths.outputs={outputs}", *overrides))
