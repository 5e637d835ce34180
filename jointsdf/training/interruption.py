"""Ctrl-C and SIGTERM during a fit: the first one stops it between two steps, a second one at once."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any


class StopRequests:
    """Handlers of the two signals during a fit.

    Attributes:
        signal: The signal that requested a stop; None before.
    """

    def __init__(self) -> None:
        self.signal: int | None = None

    @contextmanager
    def handled(self) -> Iterator[None]:
        """Note a first signal within the block, and end the process at a second one.

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
        """Handle both signals and return their former handlers; none in a thread, where Python delivers no signals."""
        if threading.current_thread() is not threading.main_thread():
            return {}
        return {number: signal.signal(number, self._note) for number in (signal.SIGINT, signal.SIGTERM)}

    def raise_if_requested(self) -> None:
        """End the fit if a signal came.

        Raises:
            SystemExit: A signal came.
        """
        if self.signal is not None:
            raise SystemExit

    def _note(self, number: int, _: FrameType | None) -> None:
        again, self.signal = self.signal is not None, number
        if again:
            raise SystemExit
