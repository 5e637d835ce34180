"""Rows that `python -m jointsdf.study results` commits."""

from dataclasses import replace
from pathlib import Path

import pytest
from study_rows import answer_of, place_of, write_finished

from jointsdf.runs.csv import rows_from_csv
from jointsdf.runs.row import read_rows, write_row


def test_committed_rows_are_those_of_the_runs_and_stay_where_a_run_is_elsewhere(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    outputs, results = tmp_path / "out", tmp_path / "results"
    command = ("results", "main", str(outputs), "--results", str(results))
    first = [write_finished(outputs, head, "part_01") for head in ("relu", "siren")]
    write_finished(outputs, "siren", "part_01", variant="other")
    assert answer_of(caplog, *command) == [f"{results / 'main' / 'runs.csv'}: 3 runs"]
    for path in outputs.glob("main/base/relu/*/*/result.json"):
        path.unlink()
    newer = replace(first[1], steps=77)
    write_row(place_of(outputs, "siren", "part_01"), newer)
    (place_of(outputs, "none", "part_01") / "result.json").parent.mkdir(parents=True)
    (place_of(outputs, "none", "part_01") / "result.json").write_text("{")
    lines = answer_of(caplog, *command)
    assert lines[-1] == f"{results / 'main' / 'runs.csv'}: 3 runs"
    assert "not a readable result row" in lines[0]
    kept = rows_from_csv((results / "main/runs.csv").read_text())
    here = read_rows(outputs)[0]
    assert sorted(kept, key=str) == sorted([first[0], *here], key=str)
