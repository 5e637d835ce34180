"""Sparse evaluation against dense on analytic, fitted and unfitted fields: the same mesh from fewer points."""

import logging
from itertools import pairwise

import numpy as np
import pytest
import torch
from level_sets import Sdf, assert_same, drilled_box, far_apart, plate, torus
from torch import Tensor, nn

from jointsdf.extraction.extractor import Extraction
from jointsdf.values import BOX


class Siren(nn.Module):
    """A small sine network of any frequency and spread of weights."""

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


@pytest.mark.parametrize("resolution", [97, 128, 190, pytest.param(370, marks=pytest.mark.slow)])  # strides 4, 4, 8, 16
@pytest.mark.parametrize("sdf", [drilled_box, torus, far_apart, plate], ids=lambda sdf: sdf.__name__)
def test_sparse_is_dense_on_analytic_fields(sdf: Sdf, resolution: int) -> None:
    sparse = Extraction(resolution, "sparse").surface(sdf)
    dense = Extraction(resolution, "dense").surface(sdf)
    assert_same(sparse, dense)
    assert sparse.evaluated < 0.2
    assert dense.evaluated == 1


def test_sparse_is_dense_on_a_fitted_field() -> None:
    sdf = fitted(steps=150)
    sparse = Extraction(100, "sparse").surface(sdf)
    assert_same(sparse, Extraction(100, "dense").surface(sdf))
    assert sparse.evaluated < 0.35


@pytest.mark.parametrize(("omega", "spread", "seed"), [(30, 1, 0), (45, 1.5, 1), (10, 3, 2)])
def test_sparse_is_dense_on_an_unfitted_field(omega: float, spread: float, seed: int) -> None:
    field = Siren(omega, spread, seed)
    assert_same(Extraction(64, "sparse").surface(field.sdf), Extraction(64, "dense").surface(field.sdf))


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


@pytest.mark.parametrize("resolution", [129, 130, 133, 256, 740])  # 256: the last blocks are 7 of 8 cells deep
def test_a_plane_breaks_no_bound(resolution: int, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG, "jointsdf.extraction.active_cells")
    normal = np.array([0.36, 0.48, 0.8])
    surface = Extraction(resolution).surface(lambda points: points @ normal - 0.1)
    assert "checks failed" not in caplog.text
    assert surface.evaluated < 12 / resolution
