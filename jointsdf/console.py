"""What a user sees on the terminal: one log format, one line per error."""

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from jointsdf.values import InputError

log = logging.getLogger("jointsdf")


def quiet_libraries() -> None:
    """Log our own lines plainly, and of Lightning's only the warnings that concern a user."""
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    logging.captureWarnings(True)
    for name in ("lightning.pytorch", "lightning.fabric", "lightning"):
        library = logging.getLogger(name)
        library.handlers.clear()
        library.propagate = True
        library.setLevel(logging.ERROR)
    for unasked in ("trimesh", "matplotlib", "PIL", "py.warnings"):
        logging.getLogger(unasked).setLevel(logging.ERROR)
    warnings.filterwarnings("ignore", module="lightning")


@contextmanager
def user_errors(failed: list[str]) -> Iterator[None]:
    """Turn what the user can mend into one line, and note it in `failed`; anything else is a bug and is raised."""
    try:
        yield
    except Exception as error:
        cause: BaseException | None = error
        while cause is not None and not isinstance(cause, InputError | OSError):
            cause = cause.__cause__  # Hydra wraps what a component's constructor raises
        if cause is None:
            raise
        message = " ".join(str(cause).split())
        log.error("error: %s", message)
        failed.append(message)
