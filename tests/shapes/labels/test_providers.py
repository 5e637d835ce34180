"""Sources of part labels, and the benchmark's numbers of parts."""

import csv
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
import trimesh
from mesh_files import SIDES, exported, load, put

from jointsdf.errors import InputError
from jointsdf.shapes import abc
from jointsdf.shapes.labels import providers


def test_providers_beside_a_mesh(tmp_path: Path) -> None:
    path = put(tmp_path, "a.ply", exported("ply"))
    with pytest.raises(InputError, match=r"no part labels: give labels=<file.npy>, or head=none"):
        load(path, labels="none", segmented=True)
    assert load(path).label_provider == load(path, labels="geometric").label_provider == "geometric:k=6"
    assert load(path, labels="brep").mesh.labels.tolist() == [-1] * 12
    with pytest.raises(InputError, match=r"patches.npy not found"):
        load(path, labels="brep", segmented=True)
    np.save(tmp_path / "patches.npy", np.arange(12) * 100)
    patches = load(path, labels="brep", segmented=True)
    assert (patches.label_provider, patches.mesh.labels.tolist()) == ("brep", (np.arange(12) * 100).tolist())
    np.save(tmp_path / "labels.npy", SIDES)
    assert load(path).label_provider == "file:labels.npy"
    assert load(path, labels="brep").label_provider == "brep"
    assert load(path, labels="none").label_provider == "none"
    np.save(tmp_path / "mine.npy", np.full(12, 4))
    with pytest.raises(InputError, match="only one part"):
        load(path, labels=str(tmp_path / "mine.npy"), segmented=True)
    assert load(path, labels=str(tmp_path / "mine.npy")).label_provider == "file:mine.npy"


def test_given_labels_are_never_merged(tmp_path: Path) -> None:
    sphere = trimesh.creation.icosphere(subdivisions=1)
    path = put(tmp_path, "a.ply", sphere.export(file_type="ply"))
    np.save(tmp_path / "patches.npy", np.arange(80))
    assert len(load(path, labels="brep", segmented=True).mesh.part_ids) == 80


@pytest.mark.parametrize(
    ("labels", "message"),
    [
        ("no/such.npy", "labels file not found: no/such.npy"),
        ("brp", "one of auto, geometric, partfield, brep, none"),
        ("x.npy", "not found"),
    ],
)
@pytest.mark.parametrize("shape", ["part_02", "file"])
def test_unknown_labels_are_named(tmp_path: Path, shape: str, labels: str, message: str) -> None:
    path = put(tmp_path, "a.ply", exported("ply"))
    with pytest.raises(InputError, match=message):
        load(path if shape == "file" else shape, labels=labels)


def test_built_in_takes_other_labels_by_file(tmp_path: Path) -> None:
    count = len(load("part_04").mesh.faces)
    np.save(tmp_path / "mine.npy", np.arange(count) % 2)
    assert load("part_04", labels=str(tmp_path / "mine.npy")).label_provider == "file:mine.npy"
    assert load("part_04", labels="none").mesh.part_ids.tolist() == []
    with pytest.raises(InputError, match="has its own labels"):
        load("part_04", labels="brep")
    split = load("part_04", labels="geometric", num_parts=5)
    assert (split.label_provider, split.mesh.part_ids.tolist()) == ("geometric:k=5", list(range(5)))
    assert len(load("part_04", labels="geometric").mesh.part_ids) >= 2


def test_more_parts_than_there_are_pieces_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"num_parts=1000000: this mesh can be cut into 1 to \d+ parts") as caught:
        load(put(tmp_path, "a.ply", exported("ply")), num_parts=10**6)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("labels", ["mine.npy", "auto", "brep", "none", "part_01"])
def test_a_number_of_parts_is_refused_where_there_is_no_choice(tmp_path: Path, labels: str) -> None:
    path: Path | str = put(tmp_path, "a.ply", exported("ply"))
    for name in ("labels.npy", "patches.npy", "mine.npy"):
        np.save(tmp_path / name, SIDES)
    if labels == "part_01":
        path, labels = "part_01", "auto"
    given = str(tmp_path / labels) if labels.endswith("npy") else labels
    with pytest.raises(InputError, match=r"num_parts=3: .*; leave num_parts out, or give labels=geometric"):
        load(path, labels=given, num_parts=3)


def test_the_benchmark_has_a_number_for_each_catalogue_shape() -> None:
    assert list(providers.benchmark()) == list(abc.catalogue())
    assert all(2 <= count <= 18 for count in providers.benchmark().values())


def test_benchmark_table_names_every_catalogue_shape_once() -> None:
    text = resources.files("jointsdf.shapes").joinpath("benchmark.csv").read_text(encoding="utf-8")
    rows = list(csv.DictReader(text.splitlines()))
    assert [row["shape"] for row in rows] == list(abc.catalogue())
    counts = [int(row["num_parts"]) for row in rows]
    assert min(counts) >= 2
    assert max(counts) == 18
    assert len(set(counts)) >= 10, "spread over the whole range"
