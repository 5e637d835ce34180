"""`python -m benchmarks [NAME ...] [--write]`: a table of ratios, its summary last. Names: see `BENCHMARKS`."""

import argparse
import csv
import logging
import shlex
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

from benchmarks import extraction, fit, grids, limits, measures, overhead, quality, signs, step, tracing
from benchmarks.table import Row, table
from jointsdf.runs.provenance import code_state, provenance
from jointsdf.training.product_choice import machine_kind

RESULTS = Path(__file__).with_name("results.csv")
BENCHMARKS: dict[str, Callable[[], list[Row]]] = {
    "step": step.rows,
    "fit": fit.rows,
    "extraction": extraction.rows,
    "octree": extraction.octree_rows,
    "measures": measures.rows,
    "overhead": overhead.rows,
    "limits": limits.rows,
    "quality": quality.rows,
    "signs": signs.rows,
    "tracing": tracing.rows,
    "grids": grids.rows,
}


def main(arguments: Sequence[str]) -> None:
    """Run what is named, or everything, and print the table."""
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
    """Append rows with what made them: command, commit, machine, date and the machine's kind."""
    known = provenance(code_state(), config_hash="")
    made = {"command": command, **{key: known[key] for key in ("commit", "dirty", "machine", "date")}}
    made["kind"] = machine_kind()
    new = not path.exists()
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [*asdict(rows[0]), "met", *made])
        if new:
            writer.writeheader()
        writer.writerows({**asdict(row), "met": row.met, **made} for row in rows)


if __name__ == "__main__":
    main(sys.argv[1:])
