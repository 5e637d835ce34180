"""Load on fields: surfaces that fill the box end, queries take memory by the answer."""

from pathlib import Path

import numpy as np
import pytest
from command_line import assert_one_line_error, train
from forked import peak_of_query, server

from jointsdf.errors import InputError
from jointsdf.extraction import extractor, marching_cubes, resolution
from jointsdf.extraction.extractor import Extraction
from jointsdf.extraction.sparse_grid import TooLarge


class Noise:
    """A field that is on another side at every grid point."""

    def __init__(self) -> None:
        self.evaluated = 0

    def __call__(self, points: np.ndarray) -> np.ndarray:
        self.evaluated += len(points)
        return np.random.default_rng(self.evaluated).uniform(-1e-3, 1e-3, len(points)).astype(np.float32)


def ball(points: np.ndarray) -> np.ndarray:
    return np.linalg.norm(points, axis=1).astype(np.float32) - np.float32(0.5)


def test_a_surface_that_fills_the_box_ends_before_more_is_evaluated(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extractor, "MOST_EVALUATED", 100_000)
    noise = Noise()
    with pytest.raises(TooLarge, match=r"^64\^3: more than 0 million points .* give a smaller extraction.resolution$"):
        Extraction(resolution=64).surface(noise)
    assert noise.evaluated <= 100_000
    assert len(Extraction(resolution=64).surface(ball).faces) > 5000, "a shape is extracted within the same bound"


@pytest.mark.parametrize("method", ["sparse", "dense"])
def test_a_surface_of_too_many_faces_ends(monkeypatch: pytest.MonkeyPatch, method: str) -> None:
    monkeypatch.setattr(marching_cubes, "MOST_FACES", 50_000)
    with pytest.raises(InputError, match=r"48\^3: more than 0 million faces"):
        Extraction(resolution=48, method=method).surface(Noise())
    assert len(Extraction(resolution=48, method=method).surface(ball).faces) > 2000


def test_noise_is_measured_on_a_coarse_grid_where_the_grid_is_chosen(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(extractor, "MOST_EVALUATED", 20_000)
    monkeypatch.setattr(resolution, "NOISE", 16)
    extraction, surface = resolution.refine_until_stable(Extraction(resolution=48), Noise(), (48, 64))
    assert (extraction.resolution, surface.evaluated) == (16, 1.0)
    assert ["fills the box" in message and message.endswith("which is taken: 16") for message in caplog.messages] == [
        True
    ]


def test_a_finer_grid_that_holds_too_much_leaves_the_coarser_one(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def two_sheets(points: np.ndarray) -> np.ndarray:
        return np.abs(points[:, 2] - 0.0175).astype(np.float32) - np.float32(0.012)

    monkeypatch.setattr(extractor, "MOST_EVALUATED", 60_000)
    found, surface = resolution.refine_until_stable(Extraction(resolution=64), two_sheets, (64, 512))
    assert found.resolution == 64
    assert len(surface.faces)
    assert "fills the box" in caplog.text


def test_a_run_whose_surface_fills_the_box_ends_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extractor, "MOST_EVALUATED", 1000)
    assert_one_line_error(train(tmp_path), "16^3", "give a smaller extraction.resolution")
    assert list(tmp_path.rglob("last.ckpt")), "its fit is kept"


def test_a_query_of_many_points_takes_memory_by_the_point() -> None:
    points = 1_000_000
    receiver, sender = server().Pipe(duplex=False)
    process = server().Process(target=peak_of_query, args=(sender, points))
    process.start()
    peak = receiver.recv()
    process.join()
    answers = 4 * (1 + 3)  # bytes a point
    copy = 3 * 8  # in float64
    assert answers < peak / points < copy + 2 * answers + 16
