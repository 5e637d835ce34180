"""Log lines of the command line: facts, warnings and errors, one line each, told apart at a glance."""

import errno
import logging
import signal
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from rich.text import Text

from jointsdf.errors import InputError
from jointsdf.phases import console

log = logging.getLogger("jointsdf")


class Lines(logging.Handler):
    """A line of the log on stderr, above a progress bar where there is one; warnings say that they are some."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write it: facts plainly, a warning in yellow, an error in red."""
        message = self.format(record)
        warns = record.levelno == logging.WARNING
        style = "red" if record.levelno > logging.WARNING else "yellow" if warns else ""
        console.print(Text(f"warning: {message}" if warns else message, style), soft_wrap=True)


LIGHTNING = ("lightning.pytorch", "lightning.fabric", "lightning")
OTHERS = ("hydra", "hydra_plugins", "trimesh", "matplotlib", "PIL", "py.warnings", "tensorboard")


def quiet_libraries() -> None:
    """Log our own lines plainly, and of the libraries' only the errors, from here on: for a command."""
    logging.basicConfig(level=logging.INFO, format="%(message)s", handlers=[Lines()])
    logging.captureWarnings(True)
    for name in LIGHTNING:
        library = logging.getLogger(name)
        library.handlers.clear()
        library.propagate = True
    for name in (*LIGHTNING, *OTHERS):
        logging.getLogger(name).setLevel(logging.ERROR)
    logging.getLogger("jointsdf.extraction.extractor").setLevel(logging.WARNING)  # it speaks for every preview
    warnings.filterwarnings("ignore", module="lightning")


@contextmanager
def library_logs_quiet() -> Iterator[None]:
    """Within the block the libraries log only their errors, and Lightning warns of nothing: for a function."""
    before = {logger: logger.level for logger in map(logging.getLogger, (*LIGHTNING, *OTHERS))}
    extractor = logging.getLogger("jointsdf.extraction.extractor")  # it speaks for every preview
    before[extractor] = extractor.level
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="lightning")
        for logger in before:
            logger.setLevel(logging.WARNING if logger is extractor else logging.ERROR)
        try:
            yield
        finally:
            for logger, level in before.items():
                logger.setLevel(level)


@contextmanager
def user_errors(failed: list[str]) -> Iterator[None]:
    """Turn what the user can mend into one line, and note it in `failed`; anything else is a bug and is raised.

    Ctrl-C and SIGTERM end the process with one line and the exit code that the shell gives them.
    """
    previous = signal.signal(signal.SIGTERM, _terminate)
    try:
        yield
    except KeyboardInterrupt:
        log.warning("stopped; the same command goes on from the last checkpoint")
        raise SystemExit(128 + signal.SIGINT) from None
    except Exception as error:
        message = one_line(error)
        if message is None:
            raise
        log.error("error: %s", message)
        failed.append(message)
    finally:
        signal.signal(signal.SIGTERM, previous)


def one_line(error: BaseException) -> str | None:
    """One-line message of an error that the user can mend; None for a bug."""
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


def _terminate(number: int, _: FrameType | None) -> None:
    log.warning("stopped; the same command goes on from the last checkpoint")
    raise SystemExit(128 + number)
