"""Each corruption does what its setting says, with the seed alone; the truth and the clean cloud stay as they are."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.optimize import linprog
from scipy.spatial import KDTree
from scipy.stats import kstest
from solids import distance_to_halves, halves, labelled

from jointsdf.data.corruption import Corruption, flip_labels
from jointsdf.data.point_cloud import Cloud
from jointsdf.data.sample_settings import SampleSettings
from jointsdf.data.samples import draw_cloud
from jointsdf.data.scanner import Scanner
from jointsdf.data.surface_points import SurfacePoints
from jointsdf.errors import InputError
from jointsdf.values import Shape

MESH = halves()  # sides 4, 2, 2
COUNT = 20000
CLEAN = Corruption().scan_mesh(MESH, COUNT, seed=0)
EVERYTHING = Corruption(Scanner(9, 0.001), 4.0, 0.1, 12000, 0.02, 0.003, 0.05)


def corrupted(seed: int = 0, **settings: object) -> SurfacePoints:
    return Corruption(**settings).scan_mesh(MESH, COUNT, seed)


def same(one: SurfacePoints, other: SurfacePoints) -> bool:
    pairs = ((one.points, other.points), (one.normals, other.normals), (one.labels, other.labels))
    return all(np.array_equal(a, b) for a, b in pairs)


def test_by_default_the_cloud_is_the_clean_one() -> None:
    cloud = Cloud.of(MESH, count=COUNT, seed=0)
    np.testing.assert_array_equal(cloud.normalisation.forward(CLEAN.points), cloud.points)
    np.testing.assert_array_equal(CLEAN.labels, cloud.part_ids[cloud.labels])
    assert str(Corruption()) == ""


@pytest.mark.parametrize(
    "settings",
    [{"noise": 0.01}, {"missing": 0.1}, {"outliers": 0.01}, {"density": 10.0}, {"label_flip": 0.1}, {"count": 500}],
    ids=str,
)
def test_a_corruption_depends_on_the_seed_and_leaves_the_mesh_alone(settings: dict[str, float]) -> None:
    before = (MESH.vertices.copy(), MESH.labels.copy())
    assert same(corrupted(3, **settings), corrupted(3, **settings))
    assert not same(corrupted(3, **settings), corrupted(4, **settings))
    assert not same(corrupted(**settings), CLEAN)
    np.testing.assert_array_equal(MESH.vertices, before[0])
    np.testing.assert_array_equal(MESH.labels, before[1])
    once, name = Corruption(**settings), next(iter(settings))
    again = once.corrupt(CLEAN, 3)
    assert same(again, once.corrupt(CLEAN, 3))
    assert str(once) == f"{name}={settings[name]:g}"


def test_noise_is_gaussian_and_isotropic_in_shares_of_the_longest_side() -> None:
    moved = corrupted(noise=0.005).points - CLEAN.points
    np.testing.assert_allclose(moved.mean(axis=0), 0, atol=4 * 0.02 / np.sqrt(COUNT))
    np.testing.assert_allclose(np.cov(moved.T), 0.02**2 * np.eye(3), atol=0.02**2 * 0.04)
    assert kstest(moved.ravel() / 0.02, "norm").pvalue > 0.01


def test_missing_cuts_off_a_cap() -> None:
    found = corrupted(missing=0.1)
    assert len(found) == 18000
    gone = np.isinf(KDTree(found.points).query(CLEAN.points, distance_upper_bound=1e-12)[0])
    assert gone.sum() == 2000
    sides = np.where(gone, 1, -1)[:, None]
    plane = linprog(
        np.zeros(4), -sides * np.c_[CLEAN.points, np.ones(COUNT)], np.full(COUNT, -1.0), bounds=(None, None)
    )
    assert plane.success, "a plane tells the cap from the rest"


def test_count_keeps_points_of_all_places_alike() -> None:
    found = corrupted(count=5000)
    assert len(found) == 5000
    distance, index = KDTree(CLEAN.points).query(found.points)
    assert distance.max() == 0
    assert (np.diff(index) > 0).all()
    assert kstest(index / COUNT, "uniform").pvalue > 0.01
    np.testing.assert_array_equal(found.labels, CLEAN.labels[index])


def test_density_falls_by_its_ratio_along_the_longest_side_at_the_same_count() -> None:
    points = corrupted(density=10.0).points
    assert len(points) == COUNT
    np.testing.assert_allclose(distance_to_halves(points), 0, atol=1e-12)
    sides = points[np.abs(points[:, 1:]).max(axis=1) > 1 - 1e-9]  # those parallel to the axis: uniform in x when clean
    along = (sides[:, 0] + 1.5) / 4
    assert kstest(along, lambda t: (1 - 10.0**-t) / (1 - 0.1)).pvalue > 0.01
    thinned = Corruption(density=10.0).corrupt(CLEAN, 0)
    assert 0.3 < len(thinned) / COUNT < 0.5, "of a cloud nothing can be drawn anew"
    along = (thinned.points[np.abs(thinned.points[:, 1:]).max(axis=1) > 1 - 1e-9][:, 0] + 1.5) / 4
    assert kstest(along, lambda t: (1 - 10.0**-t) / (1 - 0.1)).pvalue > 0.01


def test_outliers_are_uniform_in_the_cube_about_the_box_and_have_any_label() -> None:
    found = corrupted(outliers=0.1, noise=0.001)
    strays = np.linalg.norm(found.points - CLEAN.points, axis=1) > 0.1
    assert strays.sum() == pytest.approx(2000, abs=12), "some stay near"
    places = (found.points[strays] - [0.5, 0, 0]) / (1.1 * 2)
    assert np.abs(places).max() <= 1
    assert kstest((places.ravel() + 1) / 2, "uniform").pvalue > 0.01
    assert not found.normals[strays].any()
    assert (found.labels[strays] == 4).mean() == pytest.approx(0.5, abs=0.05)
    np.testing.assert_array_equal(found.labels[~strays], CLEAN.labels[~strays])


def test_the_given_share_of_the_labels_is_another_parts() -> None:
    labels = np.repeat([2, 7, 9, -1], 1000)
    found = flip_labels(labels, 0.1, np.array([2, 7, 9]), 0)
    assert (found != labels).sum() == 300
    assert (found[labels == -1] == -1).all()
    wrong = found[:1000][found[:1000] != 2]
    assert set(wrong) == {7, 9}
    np.testing.assert_array_equal(flip_labels(labels, 0.1, np.array([2]), 0), labels)
    flipped = corrupted(label_flip=0.05)
    assert (flipped.labels != CLEAN.labels).sum() == 1000
    np.testing.assert_array_equal(flipped.points, CLEAN.points)


def test_the_order_is_the_documented_one() -> None:
    """All together, the steps one after another give the same: missing before count, outliers without noise, ..."""
    settings = {"missing": 0.1, "count": 9000, "outliers": 0.02, "noise": 0.003, "label_flip": 0.05}
    step = CLEAN
    for name, value in settings.items():
        if name == "noise":
            break
        step = Corruption(**{name: value}).corrupt(step, 0)
    together = corrupted(**settings)
    assert len(together) == len(step) == 9000
    strays = ~step.normals.any(axis=1)
    assert strays.sum() == 180
    np.testing.assert_array_equal(together.points[strays], step.points[strays])
    assert (together.points - step.points)[~strays].std() == pytest.approx(0.012, rel=0.03)


def test_a_scanner_takes_the_place_of_uniform_points() -> None:
    found = EVERYTHING.scan_mesh(MESH, COUNT, 0)
    assert len(found) == 12000
    assert set(found.labels) == {4, 9}
    clean = Corruption(Scanner(9)).scan_mesh(MESH, COUNT, 0)
    assert len(clean) == COUNT
    np.testing.assert_allclose(distance_to_halves(clean.points), 0, atol=1e-12)
    assert str(EVERYTHING) == (
        "scanner.views=9 scanner.noise=0.001 density=4 missing=0.1 count=12000 outliers=0.02 noise=0.003 "
        "label_flip=0.05"
    )
    with pytest.raises(InputError, match=r"scanner.views=9: it scans a mesh"):
        EVERYTHING.corrupt(CLEAN, 0)
    needle = labelled(trimesh.creation.box((1, 1e-7, 1e-7)))
    with pytest.raises(InputError, match="see next to nothing"):
        Corruption(Scanner(1)).scan_mesh(needle, 10, 0)


def test_a_training_cloud_is_corrupted_before_its_frame_is_found() -> None:
    shape = Shape("halves", MESH, "0" * 64, "builtin", True)
    settings = SampleSettings(COUNT, 0, distances="cloud", corruption=Corruption(missing=0.2, label_flip=0.1))
    cloud = draw_cloud(shape, replace(settings, label_fraction=0.5), 0)
    assert len(cloud.points) == cloud.uniform == 16000
    np.testing.assert_allclose(cloud.points.mean(axis=0), 0, atol=1e-12)
    assert np.abs(cloud.points).max() == pytest.approx(1, abs=1e-12)
    assert (cloud.labels == -1).sum() == 8000
    np.testing.assert_array_equal(cloud.part_ids, [4, 9])


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"corruption": {"noise": 0.01}}, r"data\.corruption \(noise=0\.01\): the mesh would tell .*recipe=points"),
        ({"corruption": {"noise": 0.01}, "distances": "cloud", "part_points": 5}, "data.part_points=5 must be 0"),
        ({"corruption": {"count": 3000}, "distances": "cloud"}, "data.corruption.count=3000: it is of the cloud's"),
        ({"corruption": {"count": 99}}, "data.corruption.count=99: give an integer, at least 100"),
        ({"corruption": {"noise": -0.01}}, "data.corruption.noise=-0.01: give a number, from 0 to 1"),
        ({"corruption": {"density": 0.5}}, "data.corruption.density=0.5: give a number"),
        ({"corruption": {"missing": 1.5}}, "data.corruption.missing=1.5: give a number"),
        ({"corruption": {"outliers": "many"}}, "data.corruption.outliers=many: give a number"),
    ],
    ids=str,
)
@pytest.mark.usefixtures("as_in_training")
def test_impossible_corruptions_are_input_errors(settings: dict, words: str) -> None:
    with pytest.raises(InputError, match=words):
        SampleSettings(
            **{"cloud_size": 2000, "pool_size": 0, **settings, "corruption": Corruption(**settings["corruption"])}
        )


def test_a_scanner_without_places_is_none() -> None:
    unused = Corruption(Scanner(views=0, noise=0.1))
    assert str(unused) == ""
    assert SampleSettings(2000, 0, corruption=unused).distances == "mesh"


def test_what_leaves_too_few_points_is_refused() -> None:
    with pytest.raises(InputError, match=r"data.corruption \(missing=0.9\) leaves 20 points: at least 100"):
        Corruption(missing=0.9).scan_mesh(MESH, 200, 0)
