"""One damaged result.json never stops the others: it is named in one line, counted in captions, and passed over."""

import json
from pathlib import Path

import pytest
from damaged_documents import ROWS, Plant
from damaged_studies import HASH, assert_line, good_row, plant_bad, write_good
from hostile_configs import CONFIG, STORED
from study_rows import answer_of

from jointsdf.errors import InputError
from jointsdf.runs import folder as run_folder
from jointsdf.runs.reuse import find_reusable_row
from jointsdf.runs.row import read_row, read_rows

cases = pytest.mark.parametrize("plant", ROWS.values(), ids=[name.replace("/", "|") for name in ROWS])


def test_the_table_plants_what_a_reader_accepts_without_the_damage(tmp_path: Path) -> None:
    path = plant_bad(tmp_path, lambda path, content: path.write_text(json.dumps(content)) and None)
    assert read_row(path) == good_row(shape="abc_0002")


@cases
def test_whoever_reads_rows_names_it_and_goes_on(tmp_path: Path, plant: Plant) -> None:
    good = write_good(tmp_path)
    path = plant_bad(tmp_path, plant)
    rows, problems = read_rows(tmp_path)
    assert rows == [read_row(good)]
    (line,) = problems
    assert line.startswith(f"{path}: not a readable result row: ")
    assert_line(line, path)
    with pytest.raises(InputError) as refused:
        read_row(path)
    assert str(refused.value) == line


@cases
def test_a_run_is_not_blocked_by_it(tmp_path: Path, plant: Plant, caplog: pytest.LogCaptureFixture) -> None:
    """Neither its own, nor that of another study which might have taken its row."""
    path = plant_bad(tmp_path, plant)
    folder, identity = path.parent, CONFIG["identity"]
    (folder / "config.yaml").write_bytes((STORED / "config.yaml").read_bytes())
    assert run_folder.finished_row(folder, identity, force=False, reuse=True) is None
    wanted = tmp_path / "other/base/siren/abc_0002/seed0"
    assert find_reusable_row(HASH, wanted, tmp_path, tmp_path / "none", recipe="fast") is None
    run_folder.claim(folder, CONFIG, identity, resume="auto", force=False)
    (line,) = caplog.messages
    assert_line(line, path)
    assert line.endswith("the run is done again")
    assert [entry.name for entry in folder.iterdir()] == ["config.yaml"]


def test_the_status_of_a_study_names_each_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    write_good(tmp_path)
    paths = [plant_bad(tmp_path, plant, f"abc_{k:04}") for k, plant in enumerate(ROWS.values(), 100)]
    lines = answer_of(caplog, "status", "main", str(tmp_path))
    assert lines[0].startswith(f"{tmp_path / 'main'}: {len(paths) + 1} runs: 1 done, ")
    named = [line for line in lines if line.startswith("damaged: ")]
    for path in paths:
        if path.is_file():
            (line,) = (line for line in named if str(path) in line)
            assert_line(line, path)
    assert len(named) == sum(path.is_file() for path in paths)
