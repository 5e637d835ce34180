"""Studies with a damaged row among good ones."""

import json
from dataclasses import asdict, replace
from pathlib import Path

from damaged_documents import Plant
from study_rows import make_row, place_of

from jointsdf.runs.row import ResultRow, write_row

HASH = "0123456789abcdef"


def good_row(head: str = "siren", shape: str = "abc_0001") -> ResultRow:
    row = make_row(head, shape, study="main", cd_l1=0.5, cd_l1_floor=0.25, nc=0.9, miou=0.8)
    costs = {"counts": {"faces_gt": 100}, "seconds": {"fit": 2.0, "total": 4.0}}
    return replace(row, **costs, provenance=row.provenance | {"config_hash": HASH})


def write_good(outputs: Path, head: str = "siren", shape: str = "abc_0001") -> Path:
    return write_row(place_of(outputs, head, shape), good_row(head, shape))


def plant_bad(outputs: Path, plant: Plant, shape: str = "abc_0002") -> Path:
    path = place_of(outputs, "siren", shape) / "result.json"
    path.parent.mkdir(parents=True)
    plant(path, json.loads(json.dumps(asdict(good_row(shape=shape)))))
    return path


def assert_line(line: str, path: Path) -> None:
    assert str(path) in line
    assert line.isprintable(), line
    assert len(line) < 700
