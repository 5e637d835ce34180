"""Log lines of commands and of the library's functions, and exit codes of a command's errors."""

import errno
import logging
import signal
import sys
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from types import FrameType

from rich.text import Text

from jointsdf.errors import InputError
from jointsdf.phases import console, no_progress

RESUMES = "stopped; the same command goes on from the last checkpoint"

log = logging.getLogger("jointsdf")


class Lines(logging.Handler):
    """Handler that prints log lines on stderr, above a progress bar if there is one."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print a record: information plainly, a warning in yellow and marked as one, an error in red."""
        message = self.format(record)
        warns = record.levelno == logging.WARNING
        style = "red" if record.levelno > logging.WARNING else "yellow" if warns else ""
        console.print(Text(f"warning: {message}" if warns else message, style), soft_wrap=True)


LIGHTNING = ("lightning.pytorch", "lightning.fabric", "lightning")
LIBRARIES = (*LIGHTNING, "hydra", "hydra_plugins", "trimesh", "matplotlib", "PIL", "py.warnings", "tensorboard")
LEVELS = dict.fromkeys(LIBRARIES, logging.ERROR)
LEVELS["jointsdf.extraction.extractor"] = logging.WARNING  # its other lines would come with every preview


def configure_logging() -> None:
    """Show our own lines plainly and the libraries' errors only, for the rest of the process: for a command."""
    logging.basicConfig(level=logging.INFO, format="%(message)s", handlers=[Lines()])
    logging.captureWarnings(True)
    for name in LIGHTNING:
        library = logging.getLogger(name)
        library.handlers.clear()
        library.propagate = True
    _set_levels(LEVELS)
    warnings.filterwarnings("ignore", module="lightning")


@contextmanager
def silence_libraries() -> Iterator[None]:
    """Show the libraries' errors only, within the block: for a function of the library."""
    with warnings.catch_warnings(), log_levels(LEVELS):
        warnings.filterwarnings("ignore", module="lightning")
        yield


@contextmanager
def log_to_stderr(quiet: bool) -> Iterator[None]:
    """Show the package's log lines on stderr within the block, unless the program has handlers.

    Args:
        quiet: Whether to show neither log lines nor progress.
    """
    ours = logging.getLogger("jointsdf")
    level, handler = ours.level, Lines()
    adds_handler = not quiet and not ours.hasHandlers()
    with silence_libraries(), no_progress() if quiet else nullcontext():
        if adds_handler:
            ours.addHandler(handler)
        ours.setLevel(logging.CRITICAL if quiet else min(level or logging.INFO, logging.INFO))
        try:
            yield
        finally:
            ours.removeHandler(handler)
            ours.setLevel(level)


class _Warnings(logging.Handler):
    """Handler that keeps the warnings."""

    def __init__(self, into: list[str]) -> None:
        super().__init__(logging.WARNING)
        self.into = into

    def emit(self, record: logging.LogRecord) -> None:
        """Keep a warning as one line."""
        if record.levelno == logging.WARNING:
            self.into.append(" ".join(self.format(record).split()))


@contextmanager
def warnings_kept(into: list[str]) -> Iterator[None]:
    """Add what the package warns of within the block to a list, a line each."""
    ours, handler = logging.getLogger("jointsdf"), _Warnings(into)
    ours.addHandler(handler)
    try:
        yield
    finally:
        ours.removeHandler(handler)


@contextmanager
def log_levels(levels: Mapping[str, int]) -> Iterator[None]:
    """Set levels of loggers by name within the block."""
    before = {name: logging.getLogger(name).level for name in levels}
    _set_levels(levels)
    try:
        yield
    finally:
        _set_levels(before)


def _set_levels(levels: Mapping[str, int]) -> None:
    for name, level in levels.items():
        logging.getLogger(name).setLevel(level)


@contextmanager
def user_errors(failed: list[str], *, stopped: str = RESUMES) -> Iterator[None]:
    """Log an error that the user can correct as one line, and add it to `failed`; any other error is a bug and raised.

    Ctrl-C and SIGTERM end the process with one line and the shell's exit code for them.

    Args:
        failed: Messages of the errors so far.
        stopped: The line after Ctrl-C or SIGTERM.

    Raises:
        SystemExit: Ctrl-C or SIGTERM.
    """

    def terminate(number: int, _: FrameType | None) -> None:
        log.warning(stopped)
        raise SystemExit(128 + number)

    previous = signal.signal(signal.SIGTERM, terminate)
    try:
        yield
    except KeyboardInterrupt:
        log.warning(stopped)
        raise SystemExit(128 + signal.SIGINT) from None
    except Exception as error:
        message = one_line(error)
        if message is None:
            raise
        log.error("error: %s", message)
        failed.append(message)
    finally:
        signal.signal(signal.SIGTERM, previous)


def program_name(module: str) -> str:
    """The command as the user typed it, for its help: `jointsdf study`, or `python -m jointsdf.study`."""
    return sys.argv[0] if sys.argv[0].startswith("jointsdf ") else f"python -m {module}"


def one_line(error: BaseException) -> str | None:
    """One-line message of an error that the user can correct; None for a bug.

    >>> one_line(InputError("seed=-1: give an integer, at least 0")), one_line(KeyError("seed"))
    ('seed=-1: give an integer, at least 0', None)
    """
    cause: BaseException | None = error
    while cause is not None and not isinstance(cause, InputError | OSError | MemoryError):
        cause = cause.__cause__  # libraries wrap what a component raises
    if cause is None:
        return None
    message = " ".join(str(cause).split())
    if isinstance(cause, MemoryError):
        return f"out of memory ({message}): lower extraction.resolution or the points in data"
    if not isinstance(cause, OSError):
        return message
    if cause.errno in (errno.ENOSPC, errno.EDQUOT):
        return f"{message}: the disk is full; free some space, or give paths.outputs=<another folder>, and run it again"
    return f"{message}: give a path that can be read and written, e.g. paths.outputs=<another folder>"
