"""A run is taken from another study where its fingerprint is the same, from a folder here before a committed file."""

from dataclasses import replace
from pathlib import Path

import pytest
from study_rows import ROW

from jointsdf.runs.csv import rows_to_csv
from jointsdf.runs.folder import REUSED
from jointsdf.runs.reuse import find_reusable_row
from jointsdf.runs.row import write_row

HASH = "0123456789abcdef"
PLACE = "siren/part_01/seed0"
FINISHED = replace(ROW, study="paired", provenance=ROW.provenance | {"config_hash": HASH})


@pytest.fixture
def results(tmp_path: Path) -> Path:
    """Committed rows of the study `paired`."""
    path = tmp_path / "results" / "paired" / "runs.csv"
    path.parent.mkdir(parents=True)
    path.write_text(rows_to_csv([FINISHED]))
    return tmp_path / "results"


def test_a_run_here_is_taken_before_a_committed_one(tmp_path: Path, results: Path) -> None:
    outputs = tmp_path / "outputs"
    wanted = outputs / "main" / "base" / PLACE
    found = find_reusable_row(HASH, wanted, outputs, results, recipe="fast")
    source = (results / "paired" / "runs.csv").as_posix()
    assert found == replace(FINISHED, study="main", recipe="fast", provenance={REUSED: source} | FINISHED.provenance)
    write_row(outputs / "paired" / "half" / PLACE, replace(FINISHED, variant="half"))
    found = find_reusable_row(HASH, wanted, outputs, results, recipe="mine")
    assert found == replace(
        FINISHED, study="main", recipe="mine", provenance={REUSED: f"paired/half/{PLACE}"} | FINISHED.provenance
    )


@pytest.mark.parametrize(
    ("fingerprint_hash", "place"),
    [("f" * 16, PLACE), (HASH, "relu/part_01/seed0"), (HASH, "siren/part_02/seed0"), (HASH, "siren/part_01/seed1")],
)
def test_another_fingerprint_or_place_is_not_taken(
    tmp_path: Path, results: Path, fingerprint_hash: str, place: str
) -> None:
    outputs = tmp_path / "outputs"
    assert (
        find_reusable_row(fingerprint_hash, outputs / "main" / "base" / place, outputs, results, recipe="fast") is None
    )


def test_a_damaged_row_is_skipped(tmp_path: Path) -> None:
    outputs = tmp_path / "outputs"
    damaged = outputs / "a" / "base" / PLACE
    damaged.mkdir(parents=True)
    (damaged / "result.json").write_text("{")
    write_row(outputs / "b" / "base" / PLACE, FINISHED)
    found = find_reusable_row(HASH, outputs / "main" / "base" / PLACE, outputs, tmp_path / "nowhere", recipe="fast")
    assert found is not None
    assert found.provenance[REUSED] == f"b/base/{PLACE}"
