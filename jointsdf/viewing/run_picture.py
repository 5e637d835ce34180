"""Commands that draw a picture of a finished run: `python -m jointsdf.viewing.<name> RUN_FOLDER picture.png`."""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

from jointsdf.cli_logging import configure_logging, user_errors
from jointsdf.runs.trusted_targets import TRUST_HELP, trusted_names

Draw = Callable[[Path, Path, str | None, Sequence[str]], None]  # folder, picture, where, trusted modules


def run_picture(
    arguments: Sequence[str] | None, draw: Draw, *, name: str, description: str, at: tuple[str, str]
) -> int:
    """Main function of such a command.

    Args:
        arguments: Of the command; None for those of the process.
        draw: Writes the picture.
        name: Of the module.
        description: One line of help.
        at: Placeholder and help of `--at`, where the picture looks.

    Returns:
        The exit code, 2 for an error that the user can correct.
    """
    parser = argparse.ArgumentParser(prog=f"python -m jointsdf.viewing.{name}", description=description)
    parser.add_argument("folder", type=Path, help="folder of a finished run")
    parser.add_argument("picture", type=Path, help="PNG to write")
    parser.add_argument("--at", metavar=at[0], help=at[1])
    parser.add_argument("--trust", metavar="MODULE", action="append", help=TRUST_HELP)
    options = parser.parse_args(arguments)
    configure_logging()
    failed: list[str] = []
    with user_errors(failed):
        draw(options.folder, options.picture, options.at, trusted_names(options.trust))
    return 2 if failed else 0
