"""Ctrl-C and SIGTERM during a fit: the run ends between two steps, and a second request ends it at once."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any


class StopRequests:
    """Takes the two signals over while a fit lasts.

    Attributes:
        signal: The signal that asked for the end; None as long as none has.
    """

    def __init__(self) -> None:
        self.signal: int | None = None

    @contextmanager
    def handled(self) -> Iterator[None]:
        """Within the block a first signal is noted, and a second one ends the process.

        Raises:
            SystemExit: A signal came, with the exit code that a shell gives it.
        """
        previous = self.take_over()
        try:
            yield
            if self.signal is not None:  # too late for a step, before the handlers go back
                raise SystemExit
        except SystemExit:
            raise SystemExit(128 + (self.signal or signal.SIGTERM)) from None
        finally:
            for number, handler in previous.items():
                signal.signal(number, handler)

    def take_over(self) -> dict[signal.Signals, Any]:
        """Handle both signals; returns their handlers so far, none in a thread, which gets no signals."""
        if threading.current_thread() is not threading.main_thread():
            return {}
        return {number: signal.signal(number, self._note) for number in (signal.SIGINT, signal.SIGTERM)}

    def raise_if_asked(self) -> None:
        """End the fit where a signal came.

        Raises:
            SystemExit: One did.
        """
        if self.signal is not None:
            raise SystemExit

    def _note(self, number: int, _: FrameType | None) -> None:
        again, self.signal = self.signal is not None, number
        if again:
            raise SystemExit
