"""Extraction of analytic level sets: accuracy, labels, units, and what is refused."""

import numpy as np
import pytest
from level_sets import as_trimesh, ball, drilled_box, far_apart, plate, torus

from jointsdf.errors import InputError
from jointsdf.extraction.extractor import Extraction
from jointsdf.values import BOX, Normalisation

UNIT = Normalisation(np.zeros(3), 1.0)


@pytest.mark.parametrize(("resolution", "share"), [(128, 0.11), (256, 0.04)])
def test_sphere_is_within_a_tenth_of_a_cell(resolution: int, share: float) -> None:
    surface = Extraction(resolution).surface(ball((0.013, -0.021, 0.034), 0.7))
    offsets = np.linalg.norm(surface.vertices - [0.013, -0.021, 0.034], axis=1) - 0.7
    assert np.abs(offsets).max() < 0.1 * 2 * BOX / (resolution - 1)
    mesh = as_trimesh(surface)
    assert mesh.is_watertight
    assert mesh.euler_number == 2
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 0.7**3, rel=1e-3)  # positive: faces look outward
    assert surface.evaluated < share


def test_genus_and_components_are_the_shapes() -> None:
    extraction = Extraction(128)
    assert as_trimesh(extraction.surface(drilled_box)).euler_number == 0
    assert as_trimesh(extraction.surface(torus)).euler_number == 0
    assert as_trimesh(extraction.surface(far_apart)).body_count == 2
    thin = as_trimesh(extraction.surface(plate))
    assert thin.is_watertight
    assert thin.euler_number == 2


@pytest.mark.parametrize("method", ["sparse", "dense"])
def test_chunks_do_not_change_the_mesh(method: str) -> None:
    whole = Extraction(48, method, chunk=1 << 20).surface(torus)
    pieces = Extraction(48, method, chunk=1000).surface(torus)
    np.testing.assert_array_equal(whole.vertices, pieces.vertices)
    np.testing.assert_array_equal(whole.faces, pieces.faces)
    assert whole.evaluated == pieces.evaluated


@pytest.mark.parametrize("method", ["sparse", "dense"])
@pytest.mark.parametrize("value", [1.0, -1.0, np.nan])
def test_no_sign_change_is_an_empty_mesh(method: str, value: float) -> None:
    mesh = Extraction(32, method).labelled_mesh(
        lambda points: np.full(len(points), value), lambda points: np.zeros(len(points), dtype=np.int64), UNIT
    )
    assert mesh.is_empty
    assert mesh.vertices.shape == mesh.faces.shape == (0, 3)
    assert mesh.labels.shape == (0,)


def test_faces_take_the_majority_and_only_ties_query_the_centroid() -> None:
    asked: list[np.ndarray] = []

    def label(points: np.ndarray) -> np.ndarray:
        """Six sectors about z, and four slabs in z: three sectors meet at slab borders."""
        asked.append(points)
        sector = np.floor(np.arctan2(points[:, 1], points[:, 0]) * 3 / np.pi).astype(np.int64)
        return 10 * sector + np.floor(4 * points[:, 2]).astype(np.int64) + 100

    extraction = Extraction(64)
    mesh = extraction.labelled_mesh(ball((0, 0, 0), 0.7), label, UNIT)
    queried = len(np.concatenate(asked))
    at_vertices = label(mesh.vertices.astype(np.float32))[mesh.faces]
    at_centroids = label(mesh.vertices[mesh.faces].mean(axis=1).astype(np.float32))
    ties = 0
    for votes, centroid, found in zip(at_vertices.tolist(), at_centroids, mesh.labels, strict=True):
        winners = [vote for vote in votes if votes.count(vote) > 1]
        assert found == (winners[0] if winners else centroid)
        ties += not winners
    assert ties > 0
    assert queried == len(mesh.vertices) + ties


def test_mesh_is_in_file_units() -> None:
    file_units = Normalisation(np.array([120.0, -40.0, 7.5]), 35.0)
    mesh = Extraction(64).labelled_mesh(
        ball((0, 0, 0), 0.7), lambda points: (points[:, 0] > 0).astype(np.int64), file_units
    )
    radii = np.linalg.norm(mesh.vertices - file_units.centre, axis=1)
    np.testing.assert_allclose(radii, 0.7 * 35, atol=0.1 * 35 * 2 * BOX / 63)
    surface = Extraction(64).surface(ball((0, 0, 0), 0.7))
    np.testing.assert_allclose(file_units.forward(mesh.vertices), surface.vertices, atol=1e-12)
    centroids = mesh.vertices[mesh.faces].mean(axis=1)[:, 0] - 120
    clear = np.abs(centroids) > 35 * 2 * BOX / 63
    np.testing.assert_array_equal(mesh.labels[clear], centroids[clear] > 0)


@pytest.mark.parametrize("wrong", [{"resolution": 7}, {"resolution": 4096}, {"method": "octree"}, {"chunk": 0}])
def test_values_out_of_range_name_the_fix(wrong: dict[str, int | str]) -> None:
    key, value = next(iter(wrong.items()))
    with pytest.raises(InputError, match=rf"extraction\.{key}={value}: (give an integer|accepted are)"):
        Extraction(**wrong)
