"""Seconds of each stage of a run."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from jointsdf.phases import phase

DISPLAY_NAMES = {
    "evaluate": "measure",
    "picture": "draw",
}  # stages that are displayed under another name than the row's


@dataclass
class Stopwatch:
    """Times the stages of a run and displays each as a phase.

    Attributes:
        seconds: Seconds of each finished stage, by its name in the row.
    """

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def __call__(self, stage: str, what: str) -> Iterator[None]:
        """Time the block under this name.

        Args:
            stage: Name in the row.
            what: Input of the stage, for its line in the log.
        """
        start = time.perf_counter()
        with phase(DISPLAY_NAMES.get(stage, stage), what):
            yield
        self.seconds[stage] = time.perf_counter() - start
