"""Finished runs as a page shows them, read from their folders."""

import logging
from collections.abc import Collection, Sequence
from pathlib import Path

from jointsdf.errors import InputError, shown
from jointsdf.model.field import JointField
from jointsdf.runs.folder import FIELD, read_result
from jointsdf.runs.row import ResultRow
from jointsdf.shapes.stored import shape_identity, stored_truth
from jointsdf.threads import large_pieces
from jointsdf.values import Subject
from jointsdf.viewing.page.run_page import REPORT, write_run_page
from jointsdf.viewing.page.scene import Fit
from jointsdf.viewing.part_mesh import stored_mesh

WARNINGS = "warnings.txt"  # of a run folder: what the run warned of, a line each; missing where it did not
MOST_WARNINGS = 100_000  # characters that are read
SEVERAL = Path("view.html")

log = logging.getLogger(__name__)


@large_pieces()
def view_runs(folders: Sequence[Path], page: Path | None = None, trust: Collection[str] = ()) -> Path:
    """Write the page of finished runs of one shape.

    Args:
        folders: Their run folders, at least one.
        page: HTML file to write; None for `report.html` in the folder of a single run, else `view.html` here.
        trust: Modules whose classes the folders' configs may name.

    Returns:
        The page.

    Raises:
        InputError: A folder holds no finished run, its ground truth is no longer there, or the runs are of two shapes.
    """
    shape, fits = load_runs(folders, trust)
    path = page or (folders[0] / REPORT if len(folders) == 1 else SEVERAL)
    write_run_page(path, shape, fits, warnings=[line for folder in folders for line in stored_warnings(folder)])
    return path


def load_runs(folders: Sequence[Path], trust: Collection[str] = ()) -> tuple[Subject, list[tuple[Fit, ResultRow]]]:
    """Load the shape of finished runs, their fits and rows; arguments and errors as of `view_runs`."""
    rows = [read_result(folder) for folder in folders]
    found: list[tuple[Subject, Fit]] = []
    for folder, row, name in zip(folders, rows, fit_names(rows), strict=True):
        shape = stored_truth(folder, trust)[1]
        if found and shape_identity(shape) != shape_identity(found[0][0]):
            other, own = found[0][0].name, shape.name
            fix = "give runs of one shape, with the same labels"
            raise InputError(f"{folder}: a run of {shown(own)}, and {folders[0]} one of {shown(other)}: {fix}")
        mesh = stored_mesh(folder, is_empty=row.status == "empty_mesh")
        found.append((shape, Fit(name, mesh, JointField.load(folder / FIELD))))
    return found[0][0], [(fit, row) for (_, fit), row in zip(found, rows, strict=True)]


def fit_names(rows: Sequence[ResultRow]) -> list[str]:
    """Names that tell runs apart: the head, and of what else differs between them its value."""
    others = [name for name in ("recipe", "study", "variant", "seed") if len({getattr(row, name) for row in rows}) > 1]
    names = [" ".join([row.head, *(_with_name(name, getattr(row, name)) for name in others)]) for row in rows]
    return [name if names.count(name) == 1 else f"{name} ({place + 1})" for place, name in enumerate(names)]


def _with_name(name: str, value: object) -> str:
    return f"seed {value}" if name == "seed" else str(value)


def stored_warnings(folder: Path) -> list[str]:
    """What a run warned of."""
    path = folder / WARNINGS
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", errors="replace") as file:
        return [line for line in file.read(MOST_WARNINGS).splitlines() if line]
