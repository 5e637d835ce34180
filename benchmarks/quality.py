"""Time to quality on three built-in parts: `fast` and `points` whole, `paper` by a prefix scaled to its 10,000 steps.

Ours: seconds of the whole run (fit, extraction, measures). Theirs: seconds of the `paper` fit, extrapolated from its
first steps. Quality is cd_l1 over its floor, 1 being perfect; the prefix of `paper` is not fitted and has none.
"""

import tempfile
from collections.abc import Sequence

from benchmarks.scene import composed
from benchmarks.table import Row
from jointsdf.experiment import run
from jointsdf.results import ResultRow

SHAPES = ("part_01", "part_12", "part_23")
QUALITY, PAPER_STEPS = 1.05, 10_000


def rows(shapes: Sequence[str] = SHAPES, prefix: int = 5, overrides: Sequence[str] = ()) -> list[Row]:
    """Seconds and quality of every recipe and shape.

    Args:
        shapes: Built-in parts.
        prefix: Steps of `paper` that are timed.
        overrides: Of the config of `fast` and `points`, to make them smaller.
    """
    short = [f"trainer.max_steps={prefix}", "extraction.resolution=32", *overrides]
    found = []
    for shape in shapes:
        paper = finished("paper", shape, short).seconds["fit"] * PAPER_STEPS / prefix
        for recipe in ("fast", "points"):
            row = finished(recipe, shape, overrides)
            seconds, scores = row.seconds["total"], row.scores["unit"]
            cd, floor = scores["cd_l1"], scores["cd_l1_floor"]
            target = QUALITY if recipe == "fast" and not overrides else None
            found += [
                Row(f"{recipe}, {shape}", f"paper's fit, from {prefix} steps", seconds, paper, "s", paper / seconds),
                Row(f"{recipe}, {shape}: cd_l1", "its floor", cd, floor, "x 1e-2", cd / floor, target, at_least=False),
            ]
    return found


def finished(recipe: str, shape: str, overrides: Sequence[str]) -> ResultRow:
    """A run, nothing of which is kept."""
    with tempfile.TemporaryDirectory() as outputs:
        return run(composed(f"recipe={recipe}", f"shape={shape}", f"paths.outputs={outputs}", *overrides))
