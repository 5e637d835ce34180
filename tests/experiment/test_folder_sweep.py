"""A folder of parts is a study: one run for each file, strange names, labels beside them, a bad file named."""

import csv
import logging
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from command_line import assert_one_line_error, call, train
from run_folders import folders_with, row_of
from strange_names import STRANGE
from study_rows import table_path

import jointsdf
from jointsdf.cli import main
from jointsdf.errors import InputError
from jointsdf.experiment import sweep
from jointsdf.experiment.part_files import list_part_files
from jointsdf.experiment.settings import folder_of
from jointsdf.runs.plan import planned_runs
from jointsdf.study.__main__ import main as study

pytestmark = pytest.mark.filterwarnings("default")
BOX = trimesh.creation.box((2, 3, 4))


@pytest.fixture
def parts(tmp_path: Path) -> Path:
    """A plain box with labels beside it, one of a strange name, a file without faces, and what is no shape."""
    folder = tmp_path / "my parts [v2], ${new}"
    (folder / "older").mkdir(parents=True)
    for name in ("box.stl", "nut & bolt, (Gehäuse=1).STL", "older/box.stl"):
        BOX.export(folder / name, file_type="stl")
    (folder / "empty.obj").write_text("# nothing\n")
    np.save(folder / "box.labels.npy", np.arange(12) // 4)
    for name in ("box.mtl", "picture.png", ".hidden.stl", "buffer.bin", "a.sldprt", "b.SLDPRT"):
        (folder / name).touch()
    return folder


def test_each_file_is_a_run_and_a_bad_one_is_named(tmp_path, parts, caplog, monkeypatch) -> None:
    out = tmp_path / "out"
    answer = train(out, str(parts))
    assert answer.code == 1, answer.text
    assert "shapes in older below it are passed over" in answer.text
    assert f"passed over: {parts}/a.sldprt, {parts}/b.SLDPRT: a SolidWorks file: export it as STEP" in answer.text
    assert answer.lines[-1] == "3 runs: 2 done, 0 skipped, 1 failed, 0 missing"
    (failure,) = (line for line in answer.lines if line.startswith("failed: "))
    assert f"{parts}/empty.obj" in failure
    rows = {
        row["shape"].rpartition("-")[0]: row for row in map(row_of, map(out.joinpath, folders_with("result.json", out)))
    }
    assert rows.keys() == {"box", "nut___bolt___Gehäuse_1_"}
    assert rows["box"]["provenance"]["label_provider"] == "file:box.labels.npy"
    assert rows["box"]["num_parts"] == 3
    tried: list[str] = []
    run_one = sweep.run_one
    monkeypatch.setattr(sweep, "run_one", lambda cfg, **how: tried.append(Path(cfg.shape).name) or run_one(cfg, **how))
    again = train(out, "sweeps=folder", f"shapes={parts}/*")
    assert again.lines[-1] == "3 runs: 0 done, 2 skipped, 1 failed, 0 missing"
    assert tried == ["empty.obj", "box.stl", "nut & bolt, (Gehäuse=1).STL"], "first what is left to do"
    np.save(parts / "box.labels.npy", np.arange(12) // 2)
    changed = train(out, str(parts))
    assert "labels_sha256" in next(line for line in changed.lines if line.startswith("error: base/siren/box-"))
    assert len(folders_with("result.json", out)) == 2
    caplog.set_level(logging.INFO)
    assert study(["status", "folder", str(out)]) == 0
    assert "3 runs: 1 done, 2 failed" in caplog.text
    monkeypatch.chdir(tmp_path)  # no committed rows
    assert study(["tables", str(out)]) == 0
    with (out / "tables" / "runs.csv").open(newline="") as file:
        assert {row["shape"] for row in csv.DictReader(file)} == {row["shape"] for row in rows.values()}
    assert "empty-" in table_path(out, "main_reconstruction.tex").read_text()


def test_a_run_of_a_strange_name_measures_again_by_its_path(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    BOX.export(tmp_path / "it's (1), ${x}.stl")
    labels = tmp_path / "parts; new.npy"
    np.save(labels, np.arange(12) // 4)
    answer = train(Path("runs & more"), "it's (1), ${x}.stl", f"labels={labels}", "variant=tap=${trunk.tap}")
    assert answer.code == 0, answer.text
    (place,) = folders_with("result.json", tmp_path / "runs & more")
    assert place.startswith("smoke/tap=3/siren/it_s__1_____x_-")
    measured = call("evaluate.py", f"run=runs & more/{place}")
    assert "every score as stored" in measured.text
    assert call("evaluate.py", f"runs & more/{place}").lines[-1] == measured.lines[-1]


def test_the_library_takes_the_same_names(tmp_path) -> None:
    path = tmp_path / "it's (1), ${x}.stl"
    BOX.export(path)
    labels = tmp_path / "ä, b.npy"
    np.save(labels, np.zeros(12, int))
    with pytest.raises(InputError, match=r"it_s__1_____x_-\w{6} has only one part"):
        jointsdf.fit(path, overrides=[f"labels={labels}"])
    with pytest.raises(InputError, match="add sweeps=folder"):
        jointsdf.fit(path, overrides=[f"shapes={tmp_path}"])


def test_planned_folders_are_those_of_hydras_own_runs(tmp_path, monkeypatch) -> None:
    made: list[tuple[str, Path]] = []
    monkeypatch.setattr(sweep, "run_one", lambda cfg: made.append((cfg.shape, folder_of(cfg))))
    kinds = ("comma", "backslashes before quotes", "interpolation")
    names = sorted(str(tmp_path / "parts" / f"{STRANGE[kind]}.stl") for kind in kinds)
    (tmp_path / "parts").mkdir()
    for number, name in enumerate(names):
        Path(name).write_bytes(str(number).encode())
    others = ("variant=seed=${seed}", f"paths.outputs={tmp_path}/out")
    call("train.py", "-m", f"shape={','.join(names)}", "seed=4,5", *others)
    assert [name for name, _ in made] == [name for name in names for _ in range(2)]
    assert planned_runs(tmp_path / "out/fast") == [folder for _, folder in made]
    assert len({folder for _, folder in made}) == 2 * len(names)
    del made[:]
    CliRunner().invoke(main, ["fit", str(tmp_path / "parts"), *others])
    assert [name for name, _ in made] == names
    assert planned_runs(tmp_path / "out/folder") == [folder for _, folder in made]
    assert {folder.parts[-4] for _, folder in made} == {"seed=0"}


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["sweeps=folder"], ["sweeps=folder", "shapes=my_parts/"]),
        (["shapes={}/none"], ["none", "no such folder"]),
        (["shapes={}/*.stl"], ["*.stl", "no such folder"]),
        (["{}"], ["no file there is a shape"]),
        (["{}/none"], ["none: neither a file nor a folder"]),
    ],
)
def test_no_shapes_are_one_line(tmp_path, words, named) -> None:
    (tmp_path / "in").mkdir()
    out = f"paths.outputs={tmp_path}/out"
    answer = call("train.py", out, *(word.replace("{}", str(tmp_path / "in")) for word in words))
    assert_one_line_error(answer, *named)
    assert not (tmp_path / "out").exists()


def test_the_files_that_are_shapes(parts, caplog) -> None:
    def names(given: str) -> list[str]:
        return [path.relative_to(parts).as_posix() for path in list_part_files(given)]

    BOX.export(parts / "box_labels.ply")
    (parts / "lost.ply").symlink_to(parts / "nowhere.ply")
    (parts / "folder.stl").mkdir()
    (parts / "two\nlines.stl").touch()
    here = ["box.stl", "empty.obj", "lost.ply", "nut & bolt, (Gehäuse=1).STL"]
    assert names(str(parts)) == names(f"{parts}/*") == here
    assert "passed over" in caplog.text
    assert names(f"{parts}/b*.stl") == ["box.stl"]
    assert names(f"{parts}/**/*.stl") == ["box.stl", "older/box.stl"]
    assert names(f"{parts}/**") == [*here, "older/box.stl"]
    by_shell = [str(path) for path in sorted(parts.glob("*")) if not path.name.startswith(".")]
    assert {path.name for path in list_part_files(by_shell)} == {*here}
    assert list_part_files([str(parts / "box.stl"), str(parts)]) == [parts / name for name in here]


def test_files_that_hold_nothing_but_points_are_shapes(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    shapes = ["a.xyz", "b.pcd", "c.LAS", "d.xyzn.gz", "part.ply"]
    for name in (*shapes, "table.csv", "array.npy", "labelled.xyzc", "e.e57"):
        (tmp_path / name).touch()
    assert [path.name for path in list_part_files(str(tmp_path))] == shapes
    assert "e.e57: a point cloud in E57: export it as PLY, PCD or LAS" in caplog.text


def test_a_file_of_the_same_name_and_content_is_passed_over(tmp_path, monkeypatch) -> None:
    made: list[str] = []
    monkeypatch.setattr(sweep, "run_one", lambda cfg: made.append(cfg.shape))
    for name in ("a b.stl", "a_b.stl", "c.stl"):
        BOX.export(tmp_path / name)
    answer = call("train.py", str(tmp_path), "head=none,relu", f"paths.outputs={tmp_path}/out")
    assert made == [f"{tmp_path}/{name}.stl" for name in ("a b", "a b", "c", "c")]
    assert f"passed over: {tmp_path}/a_b.stl has name and content of {tmp_path}/a b.stl" in answer.text
    assert answer.lines[-1] == "4 runs: 0 done, 0 skipped, 0 failed, 4 missing"
