"""The page of a study: shapes by heads, plots and a table, from rows alone; 3D pages where the run folders are."""

from collections.abc import Collection, Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from jointsdf.errors import InputError, shown
from jointsdf.phases import phase, tell
from jointsdf.runs.files import write_atomically
from jointsdf.runs.row import ResultRow
from jointsdf.study.figures.style import head_style
from jointsdf.study.missing_runs import shorten
from jointsdf.study.page.rows import Records, column_name, records
from jointsdf.study.page.shape_pages import LIBRARY, ShapePage, write_shape_page
from jointsdf.viewing.page.document import ASSETS, library_script, render_page

OWN = resources.files("jointsdf.study.page").joinpath("assets")
SHARED_MODULES = ("data.js", "colours.js")  # of the page of runs
PAGES, INDEX = "pages", "index.html"


def write_study_page(
    study: str, rows: Sequence[ResultRow], outputs: Path, folder: Path, trust: Collection[str] = ()
) -> Path:
    """Write `index.html`, and a 3D page with thumbnails of each shape whose run folders are there.

    Args:
        study: Its name.
        rows: Of any study, from `load_rows`.
        outputs: Folder of the studies.
        folder: Of the pages; created where missing.
        trust: Modules whose classes the run folders' configs may name.

    Returns:
        The page.

    Raises:
        InputError: No row is of the study.
        OSError: The folder cannot be written.
    """
    own = [row for row in rows if row.study == study]
    if not own:
        known = ", ".join(sorted({shown(row.study) for row in rows}))
        raise InputError(f"--study {shown(study)}: no row of it; there are rows of {known}")
    found = records(own)
    pages = _shape_pages(found, own, outputs, folder, trust)
    data, page = _data(found, pages), _about(study, found, own, pages)
    css = [OWN.joinpath("study.css")]
    modules = [*(ASSETS.joinpath(name) for name in SHARED_MODULES)]
    modules += [path for path in OWN.iterdir() if path.name.endswith(".js")]
    text = render_page(OWN.joinpath("study.html"), modules=modules, css=css, data=data, page=page)
    write_atomically(folder / INDEX, text)
    return folder / INDEX


def _shape_pages(
    found: Records, rows: Sequence[ResultRow], outputs: Path, folder: Path, trust: Collection[str]
) -> dict[str, ShapePage]:
    """The pages of the shapes, each with the first seed of every column."""
    variants = len({row.variant for row in rows}) > 1
    chosen: dict[str, dict[str, ResultRow]] = {shape: {} for shape in found.shapes}
    for row in sorted(rows, key=lambda row: -row.seed):
        chosen[row.shape][column_name(row.head, row.variant, variants=variants)] = row
    pages = {}
    with phase("pages", f"{len(found.shapes)} shapes"):
        for place, (shape, runs) in enumerate(chosen.items()):
            tell(place, len(chosen), shape)
            ordered = {column: runs[column] for column in found.columns if column in runs}
            pages[shape] = write_shape_page(folder, outputs, shape, ordered, trust)
    if any(page.page for page in pages.values()):
        write_atomically(folder / LIBRARY, library_script())
    return pages


def _data(found: Records, pages: Mapping[str, ShapePage]) -> dict[str, Any]:
    """What the scripts read."""
    drawn: set[tuple[str, str]] = set()
    runs = []
    for run in found.runs:
        place = run["shape"], run["column"]
        picture = None if place in drawn else pages[run["shape"]].fits.get(run["column"])
        drawn.add(place)
        runs.append(run | {"picture": picture})
    truths = {shape: page.truth for shape, page in pages.items() if page.truth}
    return {
        "runs": runs,
        "measures": [measure._asdict() for measure in found.measures],
        "columns": found.columns,
        "shapes": found.shapes,
        "colours": {name: head_style(name, found.columns)["color"] for name in found.columns},
        "pages": {shape: page.page for shape, page in pages.items() if page.page},
        "truths": truths or None,
    }


def _about(study: str, found: Records, rows: Sequence[ResultRow], pages: Mapping[str, ShapePage]) -> dict[str, Any]:
    """Texts of the page."""
    with_3d = sum(page.page is not None for page in pages.values())
    recipes = ", ".join(sorted({row.recipe for row in rows}))
    machines = ", ".join(sorted({str(row.provenance.get("machine", "unknown")) for row in rows}))
    commits = sorted({str(row.provenance.get("commit", "unknown"))[:10] for row in rows})
    shown_in_3d = (
        f"{with_3d} of {len(pages)} shapes open in 3D" if with_3d else "no run folder is here, so nothing opens in 3D"
    )
    return {
        "title": study,
        "lead": f"{len(rows)} runs: {len(found.shapes)} shapes by {len(found.columns)} columns. Recipe {recipes}.",
        "notes": [f"Machine: {machines}. Code: {shorten(commits)}."],
        "grid_note": f"Mean over seeds; blank where there is no number. A cell opens its shape: {shown_in_3d}.",
        "measures": [measure._asdict() for measure in found.measures],
    }
