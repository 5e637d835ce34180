"""Sources of part labels, and the benchmark's numbers of parts."""

import csv
from importlib import resources
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import trimesh
from mesh_files import SIDES, exported, load, put

from jointsdf.errors import InputError
from jointsdf.geometry.mesh import face_areas
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


def drilled_plate(folder: Path, radius: float, thickness: float = 4.0) -> Path:
    """A plate of 100 x 60 with a hole at each corner."""
    plate = trimesh.creation.box((100, 60, thickness))
    for x, y in product((-40, 40), (-24, 24)):
        place = trimesh.transformations.translation_matrix((x, y, 0))
        hole = trimesh.creation.cylinder(radius, 3 * thickness, sections=32, transform=place)
        plate = trimesh.boolean.difference([plate, hole], engine="manifold")
    return put(folder, "plate.ply", plate.export(file_type="ply"))


def test_parts_that_divide_next_to_nothing_are_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = drilled_plate(tmp_path, radius=2.0)
    shape = load(path, num_parts=5)
    area = face_areas(shape.mesh)
    shares = np.bincount(shape.mesh.labels, area) / area.sum()
    assert shares.max() > 0.98
    assert (shares[1:] < 0.004).all()
    [record] = caplog.records
    said = (
        f"{path}: its 5 parts by geometry leave {100 * shares.max():.1f}% of the area in one, and 4 have less than 1%"
    )
    assert record.getMessage().startswith(f"{said}; num_parts=5 is natural; from num_parts=")
    first = int(record.getMessage().split("from num_parts=")[1].split()[0])
    for count, is_divided in ((first - 1, False), (first, True)):
        labels = load(path, num_parts=count).mesh.labels
        assert (np.bincount(labels, area).max() <= 0.9 * area.sum()) == is_divided
    caplog.clear()
    load(path, num_parts=first)
    assert not caplog.records
    assert load(path).label_provider == "geometric:k=5"
    assert "num_parts=5 is natural" in caplog.text


def test_parts_of_some_area_are_not_remarked(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    load(drilled_plate(tmp_path, radius=3.0, thickness=10.0), num_parts=5)  # 95%, and four of 1.2%
    load(put(tmp_path, "a.ply", exported("ply")), num_parts=2)
    assert not caplog.records


@pytest.mark.parametrize(
    ("given", "stored"),
    [
        ("auto", "auto"),
        ("a.ply", "{here}/a.ply"),
        ("./a.ply:colour", "{here}/a.ply:colour"),
        ("absent.ply:colour", "absent.ply:colour"),
    ],
)
def test_stored_labels_are_those_of_any_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, given: str, stored: str
) -> None:
    monkeypatch.chdir(tmp_path)
    put(tmp_path, "a.ply", "")
    put(tmp_path, "auto", "")
    assert providers.absolute(given) == stored.format(here=tmp_path.resolve())


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
