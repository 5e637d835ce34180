"""Classical peers: labels carried over, Poisson's clean-up, orientation, and rows that tables show beside runs'."""

import itertools
import logging
import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import trimesh

from benchmarks.__main__ import main
from benchmarks.peers import label_transfer, libraries, orientations, poisson, rows
from benchmarks.peers.command import configs, line
from benchmarks.peers.graph_cut import Energy, cut_labels
from benchmarks.peers.rows import PEERS, peer_rows
from jointsdf.data.point_cloud import Cloud
from jointsdf.errors import InputError
from jointsdf.geometry.topology import signed_volume, topology
from jointsdf.runs.row import read_rows
from jointsdf.study.collect import collect
from jointsdf.study.groups import group_runs
from jointsdf.values import UNLABELLED, LabelledMesh

SMALL = ("data.cloud_size=2000", "evaluation.protocols.unit.points=1000", "~evaluation.protocols.flatcad")


def needs(load: Callable[[], ModuleType]) -> pytest.MarkDecorator:
    """Skip where a library of the extra is not there, saying which."""
    try:
        load()
    except InputError as error:
        return pytest.mark.skipif(True, reason=str(error))
    return pytest.mark.skipif(False, reason="")


needs_open3d, needs_meshlab, needs_maxflow = map(needs, (libraries.open3d, libraries.pymeshlab, libraries.maxflow))


def sheet(cells: int = 20) -> LabelledMesh:
    """A square of side 2 in the plane z = 0, two triangles a cell."""
    x, y = np.meshgrid(np.linspace(-1, 1, cells + 1), np.linspace(-1, 1, cells + 1), indexing="ij")
    corner = np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)
    halves = [np.stack([corner, corner + cells + 1, corner + cells + 2], -1)]
    halves.append(np.stack([corner, corner + cells + 2, corner + 1], -1))
    faces = np.concatenate(halves).reshape(-1, 3)
    vertices = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], -1)
    return LabelledMesh(vertices, faces, np.full(len(faces), UNLABELLED))


def sides(points: np.ndarray) -> np.ndarray:
    return (points[:, 0] > 0).astype(np.int64)


def scattered(count: int, share_wrong: float) -> tuple[np.ndarray, np.ndarray]:
    generator = np.random.default_rng(0)
    points = generator.uniform(-1, 1, (count, 3)) * [1, 1, 0]
    wrong = generator.random(count) < share_wrong
    return points, np.where(wrong, 1 - sides(points), sides(points))


def errors(transfer: Callable[..., np.ndarray], share_wrong: float) -> float:
    mesh = sheet()
    truth = sides(mesh.vertices[mesh.faces].mean(axis=1))
    return float((transfer(mesh, *scattered(6000, share_wrong)) != truth).mean())


def test_the_nearest_point_labels_a_face_and_unlabelled_points_do_not() -> None:
    mesh = sheet(1)
    points = np.array([[0.3, -0.3, 0], [-0.3, 0.3, 0], [1 / 3, -1 / 3, 0], [-1 / 3, 1 / 3, 0]])
    labels = np.array([4, 2, UNLABELLED, UNLABELLED])
    assert label_transfer.nearest_labels(mesh, points, labels).tolist() == [4, 2]


def test_most_of_fifteen_points_win_and_the_nearest_decides_a_tie() -> None:
    mesh = sheet(1)
    angles = np.linspace(0, 6, 15)
    ring = np.stack([np.cos(angles), np.sin(angles), 0 * angles], -1)
    points = np.array([1 / 3, -1 / 3, 0]) + np.linspace(0.01, 0.2, 15)[:, None] * ring
    seven_each = np.array([5, *[3] * 7, *[5] * 6, 7])
    assert label_transfer.voted_labels(mesh, points, seven_each)[0] == 5
    assert label_transfer.voted_labels(mesh, points, np.array([5] * 6 + [3] * 9))[0] == 3
    assert label_transfer.votes_of(mesh, points, seven_each, 15)[0].tolist() == [0, 0, 0, 7, 0, 7, 0, 1]


def test_voting_bears_wrong_labels_and_the_nearest_point_does_not() -> None:
    assert errors(label_transfer.nearest_labels, 0.0) < 0.01
    assert errors(label_transfer.nearest_labels, 0.2) > 0.15
    assert errors(label_transfer.voted_labels, 0.2) < 0.03


@needs_maxflow
def test_a_cut_finds_the_straight_border_that_votes_miss() -> None:
    assert errors(label_transfer.smooth_labels, 0.0) == 0
    assert errors(label_transfer.smooth_labels, 0.2) < 0.5 * errors(label_transfer.voted_labels, 0.2)


def energy_of(seed: int, labels: int, faces: int = 9) -> tuple[Energy, tuple[np.ndarray, ...]]:
    """A random energy on a strip of faces with two further neighbours."""
    generator = np.random.default_rng(seed)
    votes = generator.integers(0, 4, (faces, labels))
    votes[np.arange(faces), generator.integers(labels, size=faces)] += 1
    pairs = np.array([*((k, k + 1) for k in range(faces - 1)), (0, 4), (2, 7)])
    lengths, angles = generator.uniform(0.1, 2, len(pairs)), generator.uniform(0, 2, len(pairs))
    arguments = votes, generator.uniform(0.2, 2, faces), pairs, lengths, angles
    return Energy(*arguments), arguments


def test_an_energy_by_hand() -> None:
    votes = np.array([[3, 0], [1, 2]])
    energy = Energy(votes, np.array([1.0, 3.0]), np.array([[0, 1]]), np.array([2.0]), np.array([math.pi / 3]))
    alone = -0.5 * math.log(3.5 / 3.5)
    assert energy.of(np.array([0, 0])) == pytest.approx(alone - 1.5 * math.log(1.5 / 3.5))
    assert energy.of(np.array([0, 1])) == pytest.approx(alone - 1.5 * math.log(2.5 / 3.5) + 0.25)


@needs_maxflow
@pytest.mark.parametrize("seed", range(6))
def test_an_expansion_is_the_best_of_all(seed: int) -> None:
    energy, (votes, *_) = energy_of(seed, labels=3)
    labels = votes.argmax(axis=1)
    for label in range(3):
        free = np.flatnonzero(votes[:, label] > 0)
        tried = []
        for chosen in itertools.product([False, True], repeat=len(free)):
            candidate = labels.copy()
            candidate[free[list(chosen)]] = label
            tried.append(energy.of(candidate))
        found = energy.expand(labels, label)
        assert energy.of(found) == pytest.approx(min(tried), abs=1e-12)
        assert (energy.candidates[np.arange(len(found)), found]).all()


@needs_maxflow
@pytest.mark.parametrize("seed", range(6))
def test_with_two_labels_the_cut_is_the_best_labelling(seed: int) -> None:
    energy, arguments = energy_of(seed, labels=2)
    allowed = [np.flatnonzero(row) for row in energy.candidates]
    lowest = min(energy.of(np.array(chosen)) for chosen in itertools.product(*allowed))
    assert energy.of(cut_labels(*arguments)) == pytest.approx(lowest, abs=1e-12)


def ball(centre: float, radius: float = 0.4) -> tuple[np.ndarray, np.ndarray]:
    found = trimesh.creation.icosphere(3, radius)
    return np.array(found.vertices) + np.array([centre, 0, 0]), np.array(found.faces, dtype=np.int64)


def test_pieces_without_points_and_collapsed_faces_are_left_out() -> None:
    (first, faces), (second, others) = ball(-0.5), ball(0.6)
    vertices = np.concatenate([first, second])
    everything = np.concatenate([faces, others + len(first), [[0, 0, 1]]])
    kept, left = poisson.supported_pieces(vertices, everything, first)
    assert (len(kept), len(left)) == (len(first), len(faces))
    assert np.array_equal(kept[left], first[faces])
    nothing = poisson.supported_pieces(vertices, faces[:0], first)
    assert [len(part) for part in nothing] == [0, 0]


def test_normals_are_reversed_together_where_they_tell_a_negative_volume() -> None:
    points = ball(3.0)[0]
    normals = (points - [3, 0, 0]) / 0.4
    for given in (normals, -normals):
        assert np.array_equal(orientations.outward(points, given), normals)


def box_cloud() -> tuple[np.ndarray, np.ndarray]:
    solid = trimesh.creation.box((1.6, 1.0, 0.7))
    mesh = LabelledMesh(np.array(solid.vertices), np.array(solid.faces), np.zeros(12, dtype=np.int64))
    cloud = Cloud.of(mesh, count=4000, seed=0)
    return cloud.points, cloud.normals


@pytest.mark.parametrize(
    "way", [pytest.param("open3d", marks=needs_open3d), pytest.param("meshlab", marks=needs_meshlab), "surfels"]
)
def test_every_orientation_points_out_of_a_box(way: str) -> None:
    points, true = box_cloud()
    found = orientations.ORIENTATIONS[way](points)
    known = found.any(axis=1)
    assert known.mean() > 0.85
    assert ((found * true).sum(axis=1)[known] > 0).mean() > 0.995
    np.testing.assert_allclose(np.linalg.norm(found[known], axis=1), 1, atol=1e-6)


@needs_open3d
def test_poisson_closes_a_box_from_its_cloud() -> None:
    points, normals = box_cloud()
    vertices, faces = poisson.screened_poisson(points, normals, 6)
    mesh = LabelledMesh(vertices, faces, np.zeros(len(faces), dtype=np.int64))
    counts = topology(mesh)
    assert counts["components"] == 1
    assert counts["euler"] == 2
    assert signed_volume(vertices, faces) == pytest.approx(np.prod(np.ptp(points, axis=0)), rel=0.03)


def test_without_normals_nothing_is_reconstructed() -> None:
    points = box_cloud()[0]
    assert [len(part) for part in poisson.screened_poisson(points, 0 * points, 6)] == [0, 0]


def truth_as_surface(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Let every peer find the true mesh; returns the orientations that were asked for."""
    asked: list[str] = []

    def surface(scene: rows.Scene, orientation: str) -> tuple[poisson.Triangles, dict[str, float]]:
        asked.append(orientation)
        mesh = scene.shape.mesh
        return (scene.cloud.normalisation.forward(mesh.vertices), mesh.faces), {"prepare": 1.5, "fit": 2.0}

    monkeypatch.setattr(rows.Scene, "_surface", surface)
    return asked


def test_rows_stand_beside_those_of_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = truth_as_surface(monkeypatch)
    wanted = [PEERS[f"poisson_{name}"] for name in ("surfels_nearest", "surfels_vote")]
    (cfg,) = configs([*SMALL, f"paths.outputs={tmp_path}", "shape=part_01", "study=sheet"])
    made = peer_rows(cfg, wanted)
    assert asked == ["surfels"]
    assert [row.head for row in made] == [peer.name for peer in wanted]
    read, problems = read_rows(tmp_path)
    assert (len(read), problems) == (2, [])
    for row in read:
        assert (row.study, row.recipe, row.steps, row.status) == ("sheet", "points", 0, "ok")
        assert row.scores["unit"]["surface_p99"] < 1e-6
        assert row.scores["unit"]["miou_exact"] > 0.8
        assert row.scores["unit"]["cd_l1_floor"] > 0
        assert row.seconds["total"] >= 3.5
    assert made[0].provenance["config_hash"] != made[1].provenance["config_hash"]
    groups = group_runs(collect(read))
    assert {frozenset(group.runs["head"]) for group in groups} == {frozenset(peer.name for peer in wanted)}
    again = peer_rows(cfg, wanted)
    assert asked == ["surfels"], "rows that are there are left as they are"
    assert [row.provenance for row in again] == [row.provenance for row in made]
    assert "surface_p99" in line(made[0], "unit")


def test_a_cloud_without_any_normal_is_an_empty_mesh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(orientations.ORIENTATIONS, "surfels", np.zeros_like)
    (cfg,) = configs([*SMALL, f"paths.outputs={tmp_path}", "shape=part_01"])
    (row,) = peer_rows(cfg, [PEERS["poisson_surfels_vote"]])
    assert (row.study, row.status, row.counts["faces_pred"]) == ("peers", "empty_mesh", 0)
    assert math.isnan(row.scores["unit"]["cd_l1"])


def test_several_values_are_several_runs() -> None:
    found = [(cfg.shape, cfg.seed, cfg.recipe) for cfg in configs(["shape=part_01,part_02", "seed=0,1"])]
    assert found == [(shape, seed, "points") for shape in ("part_01", "part_02") for seed in (0, 1)]


def without(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    """Let Open3D fail to import, and nothing else be there that could mend it."""

    def refuse(name: str) -> ModuleType:
        raise error if name == "open3d" else ModuleNotFoundError(name)

    monkeypatch.setattr(libraries.importlib, "import_module", refuse)


@pytest.mark.parametrize(
    ("error", "named"),
    [
        (ModuleNotFoundError("No module named 'open3d'"), 'open3d is not installed .*: make peers, or pip install "'),
        (ImportError("libGL.so.1: cannot open shared object file"), "open3d cannot be loaded .libGL.so.1.*apt install"),
        (
            ImportError("libusb-1.0.so.0: no such file\nmore"),
            "open3d cannot be loaded .libusb-1.0.so.0: no such file.:",
        ),
    ],
)
def test_a_missing_library_is_one_line(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, error: Exception, named: str
) -> None:
    without(monkeypatch, error)
    with pytest.raises(InputError, match=f"^{named}[^\n]*$"):
        libraries.open3d()
    with caplog.at_level(logging.ERROR), pytest.raises(SystemExit) as end:
        main(["peers", "shape=part_01"])
    assert end.value.code == 2
    (record,) = [record for record in caplog.records if record.levelno == logging.ERROR]
    assert "\n" not in record.getMessage()


@pytest.mark.parametrize("override", ["nothing=1", "shape", "head=mine"])
def test_an_override_that_no_config_has_is_one_line(override: str) -> None:
    with pytest.raises(InputError, match=r"^[^\n]*see python train.py --help$"):
        list(configs([override]))
