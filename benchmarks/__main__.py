"""`python -m benchmarks [NAME ...] [--write]`: a table of ratios, its summary last. Names: see `BENCHMARKS`.

`python -m benchmarks peers` makes result rows instead: see `peers/command.py`.
"""

import argparse
import logging
import shlex
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

from benchmarks import (
    extraction,
    fit,
    grids,
    limits,
    measures,
    overhead,
    parts,
    quality,
    queries,
    representations,
    signs,
    simplification,
    step,
    tracing,
)
from benchmarks.peers.command import main as peers
from benchmarks.table import Row, append, table

RESULTS = Path(__file__).with_name("results.csv")
BENCHMARKS: dict[str, Callable[[], list[Row]]] = {
    "step": step.rows,
    "fit": fit.rows,
    "extraction": extraction.rows,
    "octree": extraction.octree_rows,
    "measures": measures.rows,
    "overhead": overhead.rows,
    "limits": limits.rows,
    "parts": parts.rows,
    "quality": quality.rows,
    "signs": signs.rows,
    "tracing": tracing.rows,
    "grids": grids.rows,
    "representations": representations.rows,
    "queries": queries.rows,
    "simplification": simplification.rows,
}


def main(arguments: Sequence[str]) -> None:
    """Run what is named, or everything, and print the table; or what `peers` does."""
    if arguments[:1] == ["peers"]:
        sys.exit(peers(arguments[1:]))
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("names", nargs="*", choices=[*BENCHMARKS, []], help="all of them where none is named")
    parser.add_argument("--write", action="store_true", help=f"append the rows to {RESULTS.name}")
    chosen = parser.parse_args(arguments)
    logging.getLogger("lightning.pytorch").setLevel(logging.ERROR)
    rows = [row for name in chosen.names or BENCHMARKS for row in BENCHMARKS[name]()]
    if chosen.write:
        write(RESULTS, rows, shlex.join(["python", "-m", "benchmarks", *arguments]))
    sys.stdout.write("\n".join(table(rows)) + "\n")


def write(path: Path, rows: Sequence[Row], command: str) -> None:
    """Append rows with what made them."""
    append(path, [{**asdict(row), "met": row.met} for row in rows], command)


if __name__ == "__main__":
    main(sys.argv[1:])
