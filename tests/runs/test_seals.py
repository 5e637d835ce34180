"""Checksums of a row and of the files beside it."""

import hashlib
import json
from pathlib import Path

import pytest
from study_rows import ROW

from jointsdf.errors import DamagedFile
from jointsdf.runs.row import read_row, read_rows, write_row
from jointsdf.runs.seals import FILES, changed_files


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for number, name in enumerate(FILES):
        (tmp_path / name).write_bytes(bytes([number]) * (3 << 19))
    write_row(tmp_path, ROW)
    return tmp_path


def edit(folder: Path, old: str, new: str) -> None:
    path = folder / "result.json"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))


def test_the_checksums_are_sha_256_of_the_files_and_of_canonical_json(folder: Path) -> None:
    content = json.loads((folder / "result.json").read_text())
    assert content["files_sha256"] == {n: hashlib.sha256((folder / n).read_bytes()).hexdigest() for n in FILES}
    given = content.pop("sha256")
    canonical = json.dumps(content, sort_keys=True, separators=(",", ":"))
    assert given == hashlib.sha256(canonical.encode()).hexdigest()
    assert read_row(folder / "result.json") == ROW


@pytest.mark.parametrize("key", ["cd_l1", "iou_0"])
def test_an_edited_score_is_found_and_the_row_passed_over(folder: Path, key: str) -> None:
    edit(folder, f'"{key}": ', f'"{key}": 1')
    with pytest.raises(DamagedFile, match="changed after it was written") as caught:
        read_row(folder / "result.json")
    rows, problems = read_rows(folder)
    assert (rows, problems) == ([], [str(caught.value)])


@pytest.mark.parametrize("old", ['"seed": 0', '"schema": 1', f'"shape": "{ROW.shape}"', FILES[0], '"files_sha256": {'])
def test_any_other_edit_is_found(folder: Path, old: str) -> None:
    new = {"0": "1", "1": "2"}.get(old[-1])
    edit(folder, old, old[:-1] + new if new else old[:-1] + "x" + old[-1])
    with pytest.raises(DamagedFile):
        read_row(folder / "result.json")


def test_a_row_of_before_and_one_in_another_layout_are_read(folder: Path) -> None:
    path = folder / "result.json"
    content = json.loads(path.read_text())
    path.write_text(json.dumps(dict(reversed(content.items()))))
    assert read_row(path) == ROW
    path.write_text(json.dumps({key: value for key, value in content.items() if "sha256" not in key}))
    assert read_row(path) == ROW
    assert changed_files(path) == []


@pytest.mark.parametrize("name", FILES)
def test_a_flipped_bit_in_a_file_is_named_and_a_deleted_file_is_none(folder: Path, name: str) -> None:
    data = bytearray((folder / name).read_bytes())
    data[-1] ^= 1
    (folder / name).write_bytes(data)
    assert changed_files(folder / "result.json") == [name]
    (folder / name).unlink()
    assert changed_files(folder / "result.json") == []
