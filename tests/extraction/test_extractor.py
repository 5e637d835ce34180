"""Extraction against analytic level sets, and sparse evaluation against dense on fitted and unfitted fields."""

import logging
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
import torch
import trimesh
from analytic import box_distance, sphere_distance, torus_distance
from scipy.spatial import KDTree
from skimage.measure import marching_cubes
from torch import Tensor, nn

from jointsdf.errors import InputError
from jointsdf.extraction import active_cells as search
from jointsdf.extraction.continuation import NOTHING, Pairs
from jointsdf.extraction.extractor import Extraction, Surface
from jointsdf.extraction.pruning import Believed, Skipped
from jointsdf.extraction.sparse_grid import Grid
from jointsdf.values import BOX, Normalisation

Sdf = Callable[[np.ndarray], np.ndarray]
CELL = 2 * BOX / 127  # at 128 grid points
UNIT = Normalisation(np.zeros(3), 1.0)
TURN = np.linspace(0, 1, 400)
WIRE = KDTree(np.stack([0.8 * np.cos(9 * TURN), 0.8 * np.sin(9 * TURN), 1.7 * TURN - 0.8], axis=1))


def ball(centre: tuple[float, float, float], radius: float) -> Sdf:
    return lambda points: sphere_distance(points - np.array(centre), radius)


def drilled_box(points: np.ndarray) -> np.ndarray:
    return np.maximum(box_distance(points, (0.83, 0.61, 0.37)), 0.293 - np.hypot(points[:, 0], points[:, 1]))


def torus(points: np.ndarray) -> np.ndarray:
    return torus_distance(points, 0.61, 0.17)


def far_apart(points: np.ndarray) -> np.ndarray:
    return np.minimum(ball((0.45, 0.5, 0.4), 0.4)(points), ball((-0.71, -0.67, -0.73), 3 * CELL)(points))


def plate(points: np.ndarray) -> np.ndarray:
    return box_distance(points - np.array([0, 0, 0.0071]), (0.8, 0.7, 0.75 * CELL))


def truncated_tube(points: np.ndarray) -> np.ndarray:
    """A ball with a helical wire 2 cells thick, cut off at +-0.4 cells: the coarse grid misses most of the wire."""
    nearest = WIRE.query(points)[0]
    return np.clip(np.minimum(nearest - CELL, ball((0.8, 0, -0.8), 0.2)(points)), -0.4 * CELL, 0.4 * CELL)


class Siren(nn.Module):
    """A small sine network: every layer's frequency and the spread of its weights are free."""

    def __init__(self, omega: float, spread: float, seed: int) -> None:
        super().__init__()
        generator = torch.Generator().manual_seed(seed)
        self.omega, sizes = omega, [3, 48, 48, 48, 1]
        self.layers = nn.ModuleList(nn.Linear(a, b) for a, b in pairwise(sizes))
        for depth, layer in enumerate(self.layers):
            bound = 1 / 3 if depth == 0 else spread * (6 / layer.in_features) ** 0.5 / omega
            nn.init.uniform_(layer.weight, -bound, bound, generator=generator)
            nn.init.uniform_(layer.bias, -1 / omega, 1 / omega, generator=generator)

    def forward(self, points: Tensor) -> Tensor:
        for layer in self.layers[:-1]:
            points = torch.sin(self.omega * layer(points))
        return self.layers[-1](points)[:, 0]

    def sdf(self, points: np.ndarray) -> np.ndarray:
        assert points.dtype == np.float32
        with torch.no_grad():
            return self(torch.from_numpy(points)).numpy()


def fitted(steps: int) -> Sdf:
    field = Siren(omega=30, spread=1, seed=0)
    generator = torch.Generator().manual_seed(1)
    optimizer = torch.optim.Adam(field.parameters(), lr=3e-4)
    for _ in range(steps):
        points = (2 * torch.rand(1000, 3, generator=generator) - 1) * BOX
        loss = (field(points) - torch.from_numpy(drilled_box(points.numpy())).float()).abs().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    return field.sdf


def as_trimesh(surface: Surface) -> trimesh.Trimesh:
    return trimesh.Trimesh(surface.vertices, surface.faces, process=False)


def assert_same(sparse: Surface, dense: Surface) -> None:
    np.testing.assert_array_equal(sparse.faces, dense.faces)
    np.testing.assert_allclose(sparse.vertices, dense.vertices, atol=1e-6, rtol=0)
    assert len(dense.faces) > 0


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


@pytest.mark.parametrize(
    ("sdf", "resolution"),
    [(drilled_box, 97), (torus, 97), (plate, 97), pytest.param(drilled_box, 256, marks=pytest.mark.slow)],
)
def test_mesh_is_that_of_marching_cubes_over_the_whole_grid_at_once(sdf: Sdf, resolution: int) -> None:
    """Same vertices, same faces, both up to order: slabs are welded as if there were none."""
    axis = np.linspace(-BOX, BOX, resolution).astype(np.float32)
    points = axis[np.indices((resolution,) * 3).reshape(3, -1).T]
    values = np.concatenate([sdf(part) for part in np.array_split(points, 64)]).astype(np.float32)
    vertices, faces, *_ = marching_cubes(values.reshape((resolution,) * 3), 0.0, allow_degenerate=False)
    vertices = vertices.astype(np.float64) * (2 * BOX / (resolution - 1)) - BOX
    found = Extraction(resolution).surface(sdf)
    distance, which = KDTree(vertices).query(found.vertices)
    assert distance.max() < 1e-7  # float32 of a whole grid's coordinate
    assert len(np.unique(which)) == len(which) == len(vertices)
    assert {frozenset(face) for face in which[found.faces].tolist()} == {frozenset(face) for face in faces.tolist()}
    assert as_trimesh(found).volume > 0


@pytest.mark.parametrize("resolution", [97, 128, 190, pytest.param(370, marks=pytest.mark.slow)])  # strides 4, 4, 8, 16
@pytest.mark.parametrize("sdf", [drilled_box, torus, far_apart, plate], ids=lambda sdf: sdf.__name__)
def test_sparse_is_dense_on_analytic_fields(sdf: Sdf, resolution: int) -> None:
    sparse = Extraction(resolution, "sparse").surface(sdf)
    dense = Extraction(resolution, "dense").surface(sdf)
    assert_same(sparse, dense)
    assert sparse.evaluated < 0.2
    assert dense.evaluated == 1


def test_genus_and_components_are_the_shapes() -> None:
    extraction = Extraction(128)
    assert as_trimesh(extraction.surface(drilled_box)).euler_number == 0
    assert as_trimesh(extraction.surface(torus)).euler_number == 0
    assert as_trimesh(extraction.surface(far_apart)).body_count == 2
    thin = as_trimesh(extraction.surface(plate))
    assert thin.is_watertight
    assert thin.euler_number == 2


def test_surface_is_followed_where_the_coarse_grid_sees_no_slope() -> None:
    sparse = Extraction(128, "sparse").surface(truncated_tube)
    assert_same(sparse, Extraction(128, "dense").surface(truncated_tube))
    assert sparse.evaluated < 0.1


def test_sparse_is_dense_on_a_fitted_field() -> None:
    sdf = fitted(steps=150)
    sparse = Extraction(100, "sparse").surface(sdf)
    assert_same(sparse, Extraction(100, "dense").surface(sdf))
    assert sparse.evaluated < 0.35


@pytest.mark.parametrize(("omega", "spread", "seed"), [(30, 1, 0), (45, 1.5, 1), (10, 3, 2)])
def test_sparse_is_dense_on_an_unfitted_field(omega: float, spread: float, seed: int) -> None:
    field = Siren(omega, spread, seed)
    assert_same(Extraction(64, "sparse").surface(field.sdf), Extraction(64, "dense").surface(field.sdf))


def stepped(signed: np.ndarray, high: float, slope: float) -> np.ndarray:
    """A field that is flat but for a band around the zero of another: steep there, and nothing foretells it."""
    return np.clip(slope * signed, -high, high)


def far_sheet(points: np.ndarray) -> np.ndarray:
    """A ball, and far from it a closed sheet 1.5 cells thick between two planes of the coarse lattice."""
    sheet = box_distance(points - (np.array([0, 0, 102 * CELL - BOX])), (0.9, 0.9, 0.75 * CELL))
    return np.minimum(ball((0, 0, -0.5), 0.3)(points), stepped(sheet, 0.2, 10))


def floater(points: np.ndarray) -> np.ndarray:
    """A ball, and far from it one of radius 1.5 cells amid eight points of the coarse lattice, 20 times steeper."""
    small = ball(tuple(np.array([98, 98, 106]) * CELL - BOX), 1.5 * CELL)(points)
    return np.minimum(ball((-0.3, -0.3, -0.5), 0.3)(points), stepped(small, 0.6, 20))


def steep_noise(points: np.ndarray) -> np.ndarray:
    """A ball, and a far region where a wave shorter than the coarse lattice reaches below zero here and there."""
    waves = np.prod(np.sin(points * np.array([97.0, 89.0, 83.0])), axis=1)
    envelope = np.exp(-((points - 0.6) ** 2).sum(axis=1) / 0.1)
    return ball((-0.3, -0.3, -0.5), 0.4)(points) - 2.0 * envelope * waves


def unchecked(grid: Grid, skipped: dict[int, Skipped], rng: np.random.Generator) -> tuple[Believed, Pairs]:  # noqa: ARG001
    """No check is made."""
    return Believed(*np.zeros((2, *[len(grid.lines) - 1] * 3))), Pairs(NOTHING, NOTHING)


@pytest.mark.parametrize("sdf", [far_sheet, floater, steep_noise], ids=lambda sdf: sdf.__name__)
def test_checks_find_what_the_slope_between_lattice_points_does_not_foretell(
    sdf: Sdf, monkeypatch: pytest.MonkeyPatch
) -> None:
    dense = Extraction(128, "dense").surface(sdf)
    assert as_trimesh(dense).body_count > 1
    sparse = Extraction(128).surface(sdf)
    assert_same(sparse, dense)
    assert sparse.evaluated < 0.5
    monkeypatch.setattr("jointsdf.extraction.active_cells._check", unchecked)
    assert len(Extraction(128).surface(sdf).faces) < len(dense.faces), "no test of the checks: found without them"


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("kind", ["wall", "needle", "bubble"])
def test_features_thinner_than_a_cell_are_those_of_the_dense_grid(kind: str, seed: int) -> None:
    """Exact distances bend most about them: between the points of a block that is halved they must not be lost."""
    rng = np.random.default_rng(seed)
    cell = 2 * BOX / 63
    thickness = rng.uniform(0.2, 0.9) * cell
    centres = rng.uniform(-0.9, 0.9, (40 if kind == "bubble" else 1, 3))
    along = rng.standard_normal(3)
    along /= np.linalg.norm(along)

    def sdf(points: np.ndarray) -> np.ndarray:
        offsets = points[:, None] - centres
        heights = offsets @ along
        if kind == "wall":
            apart = np.abs(heights)
        elif kind == "needle":
            apart = np.linalg.norm(offsets - heights[..., None] * along, axis=2)
        else:
            apart = np.linalg.norm(offsets, axis=2)
        return np.minimum(apart.min(axis=1) - thickness, points[:, 2] + 0.3)  # above a plane

    sparse = Extraction(64).surface(sdf)
    assert_same(sparse, Extraction(64, "dense").surface(sdf))
    assert sparse.evaluated < 0.3


def test_where_interpolation_misleads_a_failed_check_takes_it_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pockets of one grid point each above a plane, all between the points of halved blocks: only checks see them."""
    odd = np.arange(17, 112, 2)
    centres = np.array([(x, y, 65) for x in odd for y in odd]) * CELL - BOX
    tree = KDTree(centres)

    def sdf(points: np.ndarray) -> np.ndarray:
        return points[:, 2] - 3 * CELL * np.maximum(0, 1 - tree.query(points)[0] / (0.9 * CELL))

    def pockets() -> int:
        return int(as_trimesh(Extraction(128).surface(sdf)).body_count) - 1

    found = pockets()
    monkeypatch.setattr("jointsdf.extraction.active_cells._check", unchecked)
    assert pockets() == 0, "no test of the checks: found without them"
    assert found > len(centres) / 3


@pytest.mark.parametrize(("resolution", "stride"), [(128, 4), (190, 8), (400, 16)])
def test_every_ball_around_a_point_of_the_coarse_lattice_is_found(
    resolution: int, stride: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Radius 1.5 cells, amid a flat field: neither slopes nor interpolation foretell them, and no check is made."""
    cell = 2 * BOX / (resolution - 1)
    lines = stride * np.arange(3, resolution // stride - 3, 6)
    centres = np.stack(np.meshgrid(lines, lines, lines), axis=-1).reshape(-1, 3) * cell - BOX
    tree = KDTree(centres)
    monkeypatch.setattr("jointsdf.extraction.active_cells._check", unchecked)
    surface = Extraction(resolution).surface(lambda points: np.clip(tree.query(points)[0] / cell - 1.5, -0.2, 0.5))
    mesh = as_trimesh(surface)
    assert mesh.body_count == len(centres) >= 8
    assert mesh.is_watertight
    assert surface.evaluated < 0.08


def test_what_a_check_met_is_in_the_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    """Floaters of radius 2 cells, between the points of a lattice of 8: a check finds some of them, by chance."""
    cell = 2 * BOX / 189
    lines = 8 * np.arange(2, 22, 2) + 4
    centres = np.stack(np.meshgrid(lines, lines, lines), axis=-1).reshape(-1, 3) * cell - BOX
    tree, met = KDTree(centres), []

    def sdf(points: np.ndarray) -> np.ndarray:
        return np.clip(5 * (tree.query(points)[0] / cell - 2), -0.2, 0.5)

    def recorded(grid: Grid, skipped: dict[int, Skipped], rng: np.random.Generator) -> tuple[Believed, Pairs]:
        seen, pairs = checked(grid, skipped, rng)
        met.extend(tree.query(pairs.others * grid.spacing - BOX)[1])
        return seen, pairs

    checked = search._check
    monkeypatch.setattr(search, "_check", recorded)
    mesh = as_trimesh(Extraction(190).surface(sdf))
    assert len(centres) / 20 < len(set(met)) < len(centres)
    bodies = tree.query(np.array([part.centroid for part in mesh.split(only_watertight=False)]))[1]
    assert set(met) <= set(bodies)
    assert len(bodies) == len(set(bodies))


@pytest.mark.parametrize("resolution", [129, 130, 133, 256, 740])  # 256: the last blocks are 7 of 8 cells deep
def test_a_plane_needs_no_second_look(resolution: int, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG, "jointsdf.extraction.active_cells")
    normal = np.array([0.36, 0.48, 0.8])
    surface = Extraction(resolution).surface(lambda points: points @ normal - 0.1)
    assert "checks failed" not in caplog.text
    assert surface.evaluated < 12 / resolution


def test_most_tiny_floaters_at_random_places_are_found() -> None:
    """Radius 1.8 cells, within a flank of 1.1 cells: about as small and steep as a field on this grid can be."""
    found = 0
    for seed in range(12):
        centre = np.random.default_rng(seed).uniform(0.1, 0.9, 3)

        def sdf(points: np.ndarray, centre: np.ndarray = centre) -> np.ndarray:
            small = stepped(ball(tuple(centre), 1.8 * 2 * BOX / 63)(points), 0.6, 15)
            return np.minimum(ball((-0.4, -0.4, -0.4), 0.3)(points), small)

        found += as_trimesh(Extraction(64).surface(sdf)).body_count == 2
    assert found >= 10


@pytest.mark.parametrize("method", ["sparse", "dense"])
def test_chunks_do_not_change_the_mesh(method: str) -> None:
    whole = Extraction(48, method, chunk=1 << 20).surface(torus)
    pieces = Extraction(48, method, chunk=1000).surface(torus)
    np.testing.assert_array_equal(whole.vertices, pieces.vertices)
    np.testing.assert_array_equal(whole.faces, pieces.faces)
    assert whole.evaluated == pieces.evaluated


@pytest.mark.parametrize("method", ["sparse", "dense"])
def test_no_point_is_evaluated_twice_and_coordinates_are_not_rounded(method: str) -> None:
    seen: list[np.ndarray] = []

    def recorded(points: np.ndarray) -> np.ndarray:
        seen.append(points)
        return torus(points)

    surface = Extraction(64, method).surface(recorded)
    points = np.concatenate(seen)
    assert points.dtype == np.float32
    assert len(points) == round(surface.evaluated * 64**3)
    twice = len(points) - len(np.unique(points, axis=0))
    assert twice <= (0 if method == "dense" else 0.02 * len(points)), "only checks may meet a point again"
    index = (points.astype(np.float64) + BOX) / (2 * BOX / 63)
    assert np.abs(index - np.rint(index)).max() < 63 * 1e-7  # half a float32 unit, in cells


@pytest.mark.parametrize("method", ["sparse", "dense"])
@pytest.mark.parametrize("value", [1.0, -1.0, np.nan])
def test_no_sign_change_is_an_empty_mesh(method: str, value: float) -> None:
    mesh = Extraction(32, method).labelled_mesh(
        lambda points: np.full(len(points), value), lambda points: np.zeros(len(points), dtype=np.int64), UNIT
    )
    assert mesh.is_empty
    assert mesh.vertices.shape == mesh.faces.shape == (0, 3)
    assert mesh.labels.shape == (0,)


@pytest.mark.parametrize("method", ["sparse", "dense"])
def test_zeros_at_grid_points_leave_no_degenerate_face(method: str) -> None:
    step = np.float32(2 * BOX / 32)
    surface = Extraction(33, method).surface(lambda points: np.abs(np.rint(points / step)).sum(axis=1) - 9)
    mesh = as_trimesh(surface)
    assert mesh.is_watertight
    assert mesh.euler_number == 2
    assert mesh.area_faces.min() > 1e-6
    assert mesh.volume == pytest.approx(4 / 3 * (9 * float(step)) ** 3, rel=1e-6)  # an octahedron


def test_a_single_zero_is_an_empty_mesh() -> None:
    def touching(points: np.ndarray) -> np.ndarray:
        return np.rint(np.abs(points).sum(axis=1) / (2 * BOX / 16))

    assert len(Extraction(17).surface(touching).faces) == 0


def test_faces_take_the_majority_and_only_ties_are_asked_again() -> None:
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


def test_mesh_comes_back_in_file_units() -> None:
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
    with pytest.raises(InputError, match=f"extraction.{key}={value}: use "):
        Extraction(**wrong)
