"""Answer files hold the table, whatever its pieces, and are not there before they are whole."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from plyfile import PlyData

from jointsdf.asking.answer_files import FORMATS, open_answers
from jointsdf.errors import InputError

KIND = np.dtype([("points", "<f8", (3,)), ("sdf", "<f4"), ("part", "<i4"), ("curvatures", "<f4", (2,))])
NAMES = ["x", "y", "z", "sdf", "part", "k1", "k2"]


def table(count: int) -> np.ndarray:
    made = np.zeros(count, dtype=KIND)
    generator = np.random.default_rng(0)
    for name in ("points", "sdf", "curvatures"):
        made[name] = generator.standard_normal(made[name].shape) * 1e-3
    made["part"], made["curvatures"][:1] = generator.integers(-1, 2**31 - 1, count), np.nan
    return made


def flat(rows: np.ndarray) -> np.ndarray:
    return np.column_stack([rows["points"], rows["sdf"], rows["part"], rows["curvatures"]])


@pytest.mark.parametrize("pieces", [1, 7])
@pytest.mark.parametrize("suffix", FORMATS)
def test_a_file_holds_every_digit(tmp_path: Path, suffix: str, pieces: int) -> None:
    path, rows = tmp_path / "new folder" / f"a.{suffix}", table(1234)
    with open_answers(path, KIND, NAMES) as written:
        for piece in np.array_split(rows, pieces):
            written.write(piece)
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]
    if suffix == "npy":
        found = np.load(path)
        assert found.dtype == KIND
        for name in KIND.names or ():
            np.testing.assert_array_equal(found[name], rows[name])
    elif suffix == "npz":
        with np.load(path) as found:
            assert found.files == list(KIND.names or ())
            for name in found.files:
                np.testing.assert_array_equal(found[name], rows[name])
    elif suffix == "ply":
        vertices = PlyData.read(path)["vertex"]
        assert [column.name for column in vertices.properties] == NAMES
        np.testing.assert_array_equal(np.column_stack([vertices[name] for name in NAMES]), flat(rows))
    else:
        found = pd.read_csv(path)
        assert list(found.columns) == NAMES
        np.testing.assert_array_equal(found["x"], rows["points"][:, 0])
        np.testing.assert_array_equal(found["sdf"].astype(np.float32), rows["sdf"])
        np.testing.assert_array_equal(found["part"], rows["part"])


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_failure_leaves_nothing_and_the_old_file(tmp_path: Path, suffix: str) -> None:
    def fail(path: Path) -> None:
        with open_answers(path, KIND, NAMES) as written:
            written.write(table(3))
            raise KeyboardInterrupt

    old = tmp_path / f"old.{suffix}"
    old.write_bytes(b"old")
    for path in (old, tmp_path / f"new.{suffix}"):
        with pytest.raises(KeyboardInterrupt):
            fail(path)
    assert list(tmp_path.iterdir()) == [old]
    assert old.read_bytes() == b"old"


def test_no_rows_are_an_empty_table_and_another_ending_is_refused(tmp_path: Path) -> None:
    with open_answers(tmp_path / "a.npy", KIND, NAMES):
        pass
    assert np.load(tmp_path / "a.npy").shape == (0,)
    with (
        pytest.raises(InputError, match="give a name that ends in csv, npy, npz, ply"),
        open_answers(tmp_path / "a.xls", KIND, NAMES),
    ):
        pass
