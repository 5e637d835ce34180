import hashlib
import json
import math
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from study_rows import ROW

from jointsdf.runs.row import config_hash, read_row, read_rows, write_row


def no_constant(token: str) -> None:
    raise AssertionError(f"{token} is not strict JSON")


def test_a_row_comes_back_as_it_was(tmp_path: Path) -> None:
    path = write_row(tmp_path / "new" / "folder", ROW)
    assert path == tmp_path / "new" / "folder" / "result.json"
    assert read_row(path) == ROW
    assert path.read_text().count("\n") > 20  # for human eyes
    assert [entry.name for entry in path.parent.iterdir()] == ["result.json"]


def test_numbers_that_are_not_finite_are_null_in_the_file_and_nan_when_read(tmp_path: Path) -> None:
    scores = {"unit": {"nan": math.nan, "plus": math.inf, "minus": -math.inf, "zero": 0.0, "whole": 3.0}}
    row = replace(ROW, scores=scores, peak_memory_mb=math.nan, seconds={"fit": math.nan})
    path = write_row(tmp_path, row)
    content = json.loads(path.read_text(), parse_constant=no_constant)
    assert content["scores"]["unit"] == {"nan": None, "plus": None, "minus": None, "zero": 0.0, "whole": 3.0}
    read = read_row(path)
    assert all(math.isnan(read.scores["unit"][name]) for name in ("nan", "plus", "minus"))
    assert read.scores["unit"]["zero"] == 0.0
    assert math.isnan(read.peak_memory_mb)
    assert math.isnan(read.seconds["fit"])


def test_numpy_scalars_and_whole_numbers_become_plain_floats(tmp_path: Path) -> None:
    path = write_row(
        tmp_path, replace(ROW, scores={"unit": {"nc": np.float64(0.5)}}, provenance={"sizes": {"n": np.int64(3)}})
    )
    content = json.loads(path.read_text())
    content["scores"]["unit"]["components"] = 1
    del content["sha256"]  # as rows of before
    path.write_text(json.dumps(content))
    row = read_row(path)
    assert row.provenance == {"sizes": {"n": 3}}
    assert row.scores == {"unit": {"nc": 0.5, "components": 1.0}}
    assert type(row.scores["unit"]["components"]) is float


def test_a_full_disk_leaves_the_old_row_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_row(tmp_path, ROW)

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        write_row(tmp_path, replace(ROW, seed=5))
    assert read_row(path) == ROW
    assert list(tmp_path.iterdir()) == [path]


def altered(**changes: object) -> str:
    content = json.loads(json.dumps({**vars(ROW), **changes}))
    return json.dumps({name: value for name, value in content.items() if value != "REMOVED"})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "Expecting value"),
        ('{"study": "fa', "Unterminated string"),
        ("[]", "no schema number"),
        ("{}", "no schema number"),
        (altered(schema="1"), "no schema number"),
        (altered(schema=0), "older than 1"),
        (altered(schema=2), "newer than 1: update jointsdf"),
        (altered(head="REMOVED"), "missing or unknown keys: head"),
        (altered(colour="red"), "missing or unknown keys: colour"),
        (altered(seed="0"), "seed: '0' is no integer from 0 to "),
        (altered(provenance=None), "provenance: what is of type NoneType is no object"),
        (altered(scores=[]), "scores: what is of type list is no object"),
        (altered(scores={"unit": 3}), "scores: unit: what is of type int is no object"),
        (altered(scores={"unit": {"nc": "good"}}), "scores: unit: nc: 'good' is no number from -1e+100 to 1e+100"),
        (altered(peak_memory_mb="much"), "peak_memory_mb: 'much' is no number from 0 to 1e+100"),
        (altered(seconds={"fit": [1]}), "seconds: fit: what is of type list is no number from 0 to 1e+12"),
        (json.dumps({**vars(ROW), "scores": {"unit": {"nc": math.nan}}}), "NaN is not JSON"),
        ("\udcff", "utf-8"),
    ],
)
def test_a_bad_file_is_one_line_with_its_name(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "result.json"
    path.write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(ValueError, match=re.escape(message)) as caught:
        read_row(path)
    assert str(caught.value).startswith(f"{path}: not a readable result row: ")
    assert "\n" not in str(caught.value)


def test_rows_are_found_at_any_depth_and_problems_are_lines(tmp_path: Path) -> None:
    write_row(tmp_path / "b" / "c", replace(ROW, seed=1))
    write_row(tmp_path / "a", ROW)
    write_row(tmp_path / "copy", ROW)
    (tmp_path / "d").mkdir()
    (tmp_path / "d" / "result.json").write_text("{")
    rows, problems = read_rows(tmp_path)
    assert rows == [ROW, replace(ROW, seed=1)]
    assert len(problems) == 2
    assert problems[0].startswith(f"{tmp_path / 'copy' / 'result.json'}: left out, the same run as ")
    assert problems[1].startswith(f"{tmp_path / 'd' / 'result.json'}: not a readable result row: ")


def test_a_missing_folder_holds_no_rows(tmp_path: Path) -> None:
    assert read_rows(tmp_path / "nothing") == ([], [])


def test_config_hash_is_the_sha256_of_canonical_json() -> None:
    config = {"seed": 0, "loss": {"weights": {"eikonal": 50.0, "dirichlet": 7000}, "on": ["manifold", "shell"]}}
    text = '{"loss":{"on":["manifold","shell"],"weights":{"dirichlet":7000,"eikonal":50.0}},"seed":0}'
    assert config_hash(config) == hashlib.sha256(text.encode()).hexdigest()[:16]
    assert config_hash(dict(reversed(config.items()))) == config_hash(config)
    assert config_hash({**config, "seed": 1}) != config_hash(config)
    assert config_hash({"on": ["a", "b"]}) != config_hash({"on": ["b", "a"]})


@pytest.mark.parametrize("module", ["jointsdf.runs.row", "jointsdf.study.tables.write", "jointsdf.study.__main__"])
def test_no_torch_is_needed(module: str) -> None:
    code = f"import sys, {module}; print([name for name in ('torch', 'lightning') if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
