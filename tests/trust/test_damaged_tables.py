"""Tables, results, figures and status are made without damaged rows and files of rows."""

import logging
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from damaged_documents import ROWS
from damaged_studies import assert_line, good_row, plant_bad, write_good
from study_rows import answer_of, place_of, read_table, read_tex

from jointsdf.errors import InputError
from jointsdf.runs.csv import rows_from_csv, rows_to_csv
from jointsdf.runs.records import flatten_rows
from jointsdf.runs.row import read_rows, write_row
from jointsdf.study.__main__ import main as study
from jointsdf.study.figures import __main__ as figures_module
from jointsdf.study.figures.loss_curves import loss_curves


@pytest.fixture
def many(tmp_path: Path) -> tuple[Path, list[Path]]:
    """Two heads on one shape, and a damaged row of every kind."""
    for head in ("relu", "siren"):
        write_good(tmp_path, head)
    return tmp_path, [plant_bad(tmp_path, plant, f"abc_{k:04}") for k, plant in enumerate(ROWS.values(), 100)]


def test_tables_and_results_are_as_without_them(
    many: tuple[Path, list[Path]], caplog: pytest.LogCaptureFixture, tmp_path_factory: pytest.TempPathFactory
) -> None:
    outputs, paths = many
    alone = tmp_path_factory.mktemp("alone")
    for head in ("relu", "siren"):
        write_good(alone, head)
    for place in (alone, outputs):
        caplog.clear()
        assert study(["tables", str(place), "--results", str(place / "none")]) == 0
    for path in paths:
        (line,) = (line for line in caplog.messages if f"{path}: " in line)
        assert_line(line, path)
    for name in ("runs", "main_reconstruction", "paired_heads"):
        assert read_table(outputs, name).equals(read_table(alone, name))
    text = " ".join(read_tex(outputs, "main_reconstruction").split())
    assert f"Files that cannot be read or repeat a run, and are left out: {len(paths)}." in text
    assert "cannot be read" not in read_tex(alone, "main_reconstruction")
    caplog.clear()
    lines = answer_of(caplog, "results", "main", str(outputs), "--results", str(outputs / "results"))
    assert len(lines) == len(paths) + 1
    assert lines[-1].endswith("runs.csv: 2 runs")


def test_figures_are_drawn_without_them(
    many: tuple[Path, list[Path]], caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    outputs, paths = many
    monkeypatch.setattr(figures_module, "PLOTS", {})
    monkeypatch.setattr(figures_module, "FROM_RUN_FOLDERS", {"curves": lambda group, out, _: loss_curves(group, out)})
    assert figures_module.main([str(outputs), "--results", str(outputs / "none")]) == 0
    assert sum(any(f"{path}: " in line for path in paths) for line in caplog.messages) == len(paths)


CELLS = {
    "an integer of 400 digits": (",100,1,", f",{10**400},1,"),
    "an integer of 9,000 digits": (",100,1,", f",{'9' * 9000},1,"),
    "infinity": (",0.9,", ",inf,"),
    "a number beyond float64": (",0.9,", ",1e400,"),
    "a cell of deep lists": (",brep,", f',"{"[" * 100_000}{"]" * 100_000}",'),
    "a cell of a megabyte": (",brep,", f",{'x' * 1_000_000},"),
    "a path as study": ("main,base", "../main,base"),
    "a negative seed": (",abc_0001,0,", ",abc_0001,-1,"),
    "a metric named seed": (",nc,", ",seed,"),
    "a byte order mark": ("study,", "\ufeffstudy,"),
    "half of it": ("machine", ""),
}


@pytest.mark.parametrize("case", [*CELLS, "no UTF-8", "a directory", "a pipe", "a link to a device", "empty"])
def test_a_damaged_file_of_committed_rows_is_named_and_passed_over(
    tmp_path: Path, case: str, caplog: pytest.LogCaptureFixture
) -> None:
    write_good(tmp_path)
    results = tmp_path / "results"
    (results / "good").mkdir(parents=True)
    (results / "good/runs.csv").write_text(rows_to_csv([replace(good_row("relu"), study="good")]))
    path = results / "bad/runs.csv"
    path.parent.mkdir()
    text = rows_to_csv([good_row("hybrid")])
    plants: dict[str, Callable[[], object]] = {
        "no UTF-8": lambda: path.write_bytes(b"\xff" + text.encode()),
        "empty": lambda: path.write_text(""),
        "a directory": path.mkdir,
        "a pipe": lambda: ROWS["a pipe"](path, {}),
        "a link to a device": lambda: path.symlink_to("/dev/zero"),
    }
    if case in CELLS:
        assert CELLS[case][0] in text
        text = text[: len(text) // 2] if case == "half of it" else text.replace(*CELLS[case])
        path.write_text(text)
    else:
        plants[case]()
    assert study(["tables", str(tmp_path), "--results", str(results), "--all"]) == 0
    (line,) = (line for line in caplog.messages if str(path) in line)
    assert_line(line, path)
    assert set(read_table(tmp_path, "runs")["study"]) == {"main", "good"}
    assert "Files that cannot be read or repeat a run, and are left out: 1." in " ".join(
        read_tex(tmp_path, "main/main_reconstruction").split()
    )


def test_names_that_two_rows_use_for_different_things_stop_no_table(tmp_path: Path) -> None:
    """Also if a metric of one row is a count or a fact of another."""
    metrics = {"faces_gt": 0.5, "commit": 0.25, "versions.torch": 0.125}
    rows = [good_row(), replace(good_row("relu"), scores={"unit": {"nc": 0.5, **metrics}})]
    rows[0].provenance.update(commit="abc", faces_pred="a fact")
    rows[1].counts.update(faces_pred=7)
    for row in rows:
        write_row(place_of(tmp_path, row.head, row.shape), row)
    assert read_rows(tmp_path) == (sorted(rows, key=lambda row: row.head), [])
    assert study(["tables", str(tmp_path), "--results", str(tmp_path / "none")]) == 0
    back = rows_from_csv((tmp_path / "tables/runs.csv").read_text())
    assert sorted(back, key=lambda row: row.head) == sorted(rows, key=lambda row: row.head)
    columns = flatten_rows(rows)
    assert (columns["commit"], columns["provenance.commit"]) == ([0.25, None], [None, "abc"])


def test_long_names_make_files_of_different_names(tmp_path: Path) -> None:
    for place in "123":
        for head in ("relu", "siren"):
            row = replace(good_row(head), study="x" * 254 + place, variant="y" * 255)
            write_row(tmp_path / place / head, row)
    assert study(["tables", str(tmp_path), "--results", str(tmp_path / "none")]) == 0
    assert len(list((tmp_path / "tables").rglob("main_reconstruction*.csv"))) == 3


@pytest.mark.parametrize("name", ["seed", "cd_l1_over_floor", "two\nlines", ""])
def test_what_cannot_be_read_is_not_written(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="scores"):
        write_row(tmp_path, replace(good_row(), scores={"unit": {name: 0.5}}))
    assert not (tmp_path / "result.json").exists()


def test_numbers_at_the_bounds_are_read_and_averaged(tmp_path: Path) -> None:
    extremes = {"cd_l1": 1e100, "nc": -1e100, "f1": 1e-300, "f1_floor": 1e-320, "miou": 1e100, "miou_floor": 1e-300}
    for head, sign in (("relu", 1.0), ("siren", -1.0)):
        for k in range(1, 5):
            scores = {name: sign * value for name, value in extremes.items()}
            row = replace(good_row(head, f"abc_{k:04}"), scores={"unit": scores}, seconds={"fit": 1e12, "total": 1e12})
            write_row(place_of(tmp_path, head, row.shape), row)
    assert study(["tables", str(tmp_path), "--results", str(tmp_path / "none")]) == 0
    assert study(["status", "main", str(tmp_path)]) == 0


def test_a_study_whose_seconds_are_unknown_has_a_status(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    write_row(place_of(tmp_path, "siren", "abc_0001"), replace(good_row(), seconds={"total": math.nan}))
    write_row(place_of(tmp_path, "siren", "abc_0002"), replace(good_row(shape="abc_0002"), seconds={}))
    place_of(tmp_path, "siren", "abc_0003").mkdir(parents=True)
    with caplog.at_level(logging.INFO):
        assert answer_of(caplog, "status", "main", str(tmp_path))[0].endswith("3 runs: 2 done, 1 missing")
