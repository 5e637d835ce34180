"""A tenth of the points is held out, the same in every run, and everywhere on the surface."""

import numpy as np
import pytest
from cloud_files import on_box
from scipy.spatial import KDTree

from jointsdf.data.corruption import Corruption
from jointsdf.data.held_out import mark_held_out
from jointsdf.data.sample_settings import SampleSettings
from jointsdf.data.samples import draw_cloud
from jointsdf.errors import InputError
from jointsdf.shapes.clouds.sources import load_cloud
from jointsdf.values import Scan, Shape

BOX = on_box(5000)
SETTINGS = SampleSettings(30000, 0, distances="cloud")


@pytest.fixture
def scan() -> Scan:
    return load_cloud(points=BOX.points, normals=BOX.normals, labels=BOX.labels, name="scan")


def test_a_tenth_is_held_out_whatever_the_order_of_the_points() -> None:
    held = mark_held_out(BOX.points)
    assert held.sum() == 500
    np.testing.assert_array_equal(held, mark_held_out(BOX.points))
    shuffled = np.random.default_rng(0).permutation(5000)
    np.testing.assert_array_equal(mark_held_out(BOX.points[shuffled]), held[shuffled])
    np.testing.assert_array_equal(mark_held_out(1000 * BOX.points - 7), held)


def test_the_held_out_points_are_spread_more_evenly_than_random_ones() -> None:
    def widest(marked: np.ndarray) -> float:
        return KDTree(BOX.points[marked]).query(BOX.points)[0].max()

    generator = np.random.default_rng(0)
    others = [widest(generator.permutation(5000) < 500) for _ in range(20)]
    assert widest(mark_held_out(BOX.points)) < np.quantile(others, 0.1)


def test_a_run_trains_on_the_others_unless_there_is_a_truth(scan: Scan, box_shape: Shape) -> None:
    held = mark_held_out(scan.points)
    cloud = draw_cloud(scan, SETTINGS, 0)
    np.testing.assert_allclose(cloud.normalisation.inverse(cloud.points), scan.points[~held], atol=1e-12)
    np.testing.assert_array_equal(cloud.part_ids[cloud.labels], scan.labels[~held])
    scored = Scan(scan.name, scan.points, scan.normals, scan.labels, "0" * 64, "array", truth=box_shape)
    assert len(draw_cloud(scored, SETTINGS, 0).points) == 5000


def test_a_large_cloud_is_thinned_and_says_so(scan: Scan, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    few = SampleSettings(1000, 0, distances="cloud")
    one, again, other = (draw_cloud(scan, few, seed) for seed in (0, 0, 1))
    assert len(one.points) == 1000
    np.testing.assert_array_equal(one.points, again.points)
    assert not np.array_equal(one.points, other.points)
    assert "scan: 4500 points are thinned to 1000 at random; data.cloud_size=4500 trains on more" in caplog.text
    places = one.normalisation.inverse(one.points)
    assert KDTree(scan.points[~mark_held_out(scan.points)]).query(places)[0].max() < 1e-12


def test_corruption_leaves_the_held_out_points_alone(scan: Scan) -> None:
    before = scan.points.copy()
    noisy = draw_cloud(scan, SampleSettings(30000, 0, distances="cloud", corruption=Corruption(noise=0.01)), 0)
    np.testing.assert_array_equal(scan.points, before)
    moved = noisy.normalisation.inverse(noisy.points) - scan.points[~mark_held_out(scan.points)]
    train_side = np.ptp(scan.points[~mark_held_out(scan.points)], axis=0).max()
    assert moved.std() == pytest.approx(0.01 * train_side, rel=0.03)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({}, "data.distances=mesh: scan is a point cloud, which tells no exact distances; give recipe=points"),
        ({"distances": "cloud", "crease_points": 5}, "data.crease_points=5: they are drawn from a mesh"),
    ],
)
def test_what_needs_a_mesh_is_refused(scan: Scan, settings: dict, words: str) -> None:
    with pytest.raises(InputError, match=words):
        draw_cloud(scan, SampleSettings(**{"cloud_size": 1000, "pool_size": 0, **settings}), 0)
