"""Write every table as CSV and LaTeX, and the document that includes them all.

Heads are compared on the shapes that all of them have, seeds are averaged first; the caption lists what is left out.
"""

from collections.abc import Callable, Collection, Sequence
from functools import partial
from pathlib import Path

from jointsdf.runs.csv import FILE, rows_to_csv
from jointsdf.runs.files import write_atomically
from jointsdf.runs.records import HOLDOUT
from jointsdf.runs.row import ResultRow
from jointsdf.study.collect import collect
from jointsdf.study.document import DOCUMENT, build_document
from jointsdf.study.families import groups_with_own_tables, join_variants
from jointsdf.study.groups import SUFFIX, Group, group_runs
from jointsdf.study.missing_runs import find_missing_runs
from jointsdf.study.tables import correlations, paired_tests
from jointsdf.study.tables import main as main_tables
from jointsdf.study.tables.against_paper import against_paper
from jointsdf.study.tables.table import Table
from jointsdf.study.tables.worst_cases import worst

FOLDER = "tables"
ENDINGS = (".csv", ".tex")
PAPER = "paper"
FIGURES = "figures"
VARIANTS = "variants"
HELD_OUT = "held_out"  # table of the groups of the protocol `HOLDOUT`
OF_ANY = ("seeds", "cost")  # tables of every group
Builder = Callable[[Group, str], Table | None]


def builders(paper: Path) -> dict[str, Builder]:
    """Name of a table -> its builder, in the order of the document.

    Args:
        paper: Folder of the paper's numbers.
    """
    return {
        HELD_OUT: main_tables.held_out,
        "main_reconstruction": main_tables.main_reconstruction,
        "main_segmentation": main_tables.main_segmentation,
        "distance": main_tables.distance,
        "edges": main_tables.edges,
        "worst": worst,
        "against_paper": partial(against_paper, paper=paper),
        "paired_reconstruction": paired_tests.paired_reconstruction,
        "paired_heads": paired_tests.paired_heads,
        "per_part_iou": main_tables.per_part_iou,
        "correlation": correlations.correlation,
        "correlation_exact": correlations.correlation_exact,
        "quartiles": correlations.quartiles,
        "quartiles_exact": correlations.quartiles_exact,
        "part_count": main_tables.part_count,
        "seeds": main_tables.seeds,
        "cost": main_tables.cost,
    }


def fits(table: str, group: Group) -> bool:
    """Whether a table is of a group's kind of scores: those by held-out points have one of their own."""
    return table in OF_ANY or (table == HELD_OUT) == (group.key["protocol"] == HOLDOUT)


def write_tables(
    rows: Sequence[ResultRow], outputs: Path, results: Path, heads: Collection[str] | None = None, passed_over: int = 0
) -> list[Path]:
    """Write `tables/` below a folder: `runs.csv`, `report.tex` and a folder of tables for each study; delete old ones.

    Args:
        rows: At least one.
        outputs: Folder of `tables/`; the document includes the figures already in `figures/`.
        results: Folder of the committed results, for the paper's numbers.
        heads: The heads that the rows were selected by; None for all.
        passed_over: Number of files that `load_rows` passed over.

    Returns:
        The files written, `runs.csv` first.

    Raises:
        OSError: The folder cannot be written.
    """
    folder = outputs / FOLDER
    written = [folder / FILE]
    write_atomically(written[0], rows_to_csv(rows))
    groups = group_runs(collect(rows), find_missing_runs(outputs, rows, heads), passed_over)
    builds = builders(results / PAPER)
    related = join_variants(groups)
    alone = groups_with_own_tables(groups, related)
    for group in alone:
        for name, build in builds.items():
            if fits(name, group) and (table := build(group, group.label(name))):
                written += _write(table, folder / group.folder / (name + group.suffix))
    for family in related:
        name = VARIANTS + family.group.suffix
        written += _write(paired_tests.variants(family, name), folder / family.group.folder / name)
    remove_old(folder, (*builds, VARIANTS), ENDINGS, written)
    tables = [path.relative_to(folder) for path in written if path.suffix == ".tex"]
    drawn = outputs / FIGURES
    figures = [Path("..", FIGURES, path.relative_to(drawn)) for path in sorted(drawn.glob("*/*.tex"))]
    kinds = [*builds, VARIANTS, *dict.fromkeys(path.stem.partition(SUFFIX)[0] for path in figures)]
    write_atomically(
        folder / DOCUMENT, build_document([*alone, *(family.group for family in related)], tables + figures, kinds)
    )
    return [*written, folder / DOCUMENT]


def remove_old(folder: Path, names: Collection[str], endings: Collection[str], written: Collection[Path]) -> None:
    """Delete the files of groups that are gone, of this layout and the one before, and study folders without any.

    Args:
        folder: Of tables or figures.
        names: Of tables or figures, without the suffix of a group.
        endings: Of their files.
        written: The files to keep.
    """
    places = [folder, *(path for path in folder.glob("*") if path.is_dir() and not path.is_symlink())]
    for place in places:
        old = {place / (name + ending) for name in names for ending in endings}
        for path in old.union(*(place.glob(f"{name}{SUFFIX}*") for name in names)) - set(written):
            path.unlink(missing_ok=True)
        if place != folder and not any(place.iterdir()):
            place.rmdir()


def _write(table: Table, stem: Path) -> list[Path]:
    csv, tex = (stem.with_name(stem.name + ending) for ending in ENDINGS)
    write_atomically(csv, table.numbers.to_csv(index=False, lineterminator="\n"), durable=False)
    write_atomically(tex, table.latex, durable=False)
    return [csv, tex]
