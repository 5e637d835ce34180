"""Command line of the export: `jointsdf export RUN --to onnx`, or `python -m jointsdf.export`."""

import argparse
import logging
import sys
from collections.abc import Sequence

from jointsdf.cli_logging import configure_logging, program_name, user_errors

log = logging.getLogger("jointsdf.export")


def main(arguments: Sequence[str] | None = None) -> int:
    """Export one field; returns the exit code, 2 for an error that the user can correct."""
    parser = argparse.ArgumentParser(
        prog=program_name("jointsdf.export"), description="Write a fitted field for other programs: see docs/export.md."
    )
    parser.add_argument("run", metavar="RUN", help="folder of a finished run, or a field.ckpt")
    parser.add_argument("--to", required=True, metavar="KIND", help="onnx, npz (numpy arrays) or field (field.ckpt)")
    parser.add_argument("--half", action="store_true", help="large matrices in float16; the error is measured")
    parser.add_argument("--out", metavar="FILE", help="the file to write (RUN/field.onnx, RUN/field_half.npz, ..)")
    options = parser.parse_args(arguments)
    configure_logging()
    failed: list[str] = []
    with user_errors(failed):
        from jointsdf.export import export_field  # torch, only after the command line is read

        export_field(options.run, options.to, half=options.half, out=options.out)
    return 2 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
