"""Pages of pictures of meshes."""

from collections.abc import Collection
from pathlib import Path

import numpy as np
import pytest
from drawings import labelled, pair, texts
from matplotlib.colors import to_hex

from jointsdf.errors import InputError
from jointsdf.study.figures import renderings as pictures
from jointsdf.study.figures.run_meshes import Pair
from jointsdf.study.groups import Group


@pytest.fixture
def small_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pictures, "PIXELS", {"width": 60, "height": 45, "supersampling": 1})


@pytest.mark.usefixtures("small_pictures")
def test_triptychs_show_a_row_per_shape(group: Group, monkeypatch: pytest.MonkeyPatch) -> None:
    def load(folder: Path, trust: Collection[str]) -> Pair:  # noqa: ARG001 (the signature of `load_pair`)
        if "part_02" in folder.parts:
            raise InputError(f"{folder / 'mesh.ply'} is not there")
        return pair(labelled())

    monkeypatch.setattr(pictures, "load_pair", load)
    drawing, missing = pictures.triptychs(group, Path("out"))
    assert drawing is not None
    assert missing == ["out/main/base/hybrid/part_02/seed0/mesh.ply is not there"]
    shown = texts(drawing.figure)
    assert {"ground truth", "hybrid", "siren", "part_00\n3 parts", "part_03\n20 parts"} < shown
    assert "mIoU exact 0.820, CD/floor 1.28" in shown
    assert len(drawing.figure.axes) == 3 * 3
    first = [np.asarray(ax.get_images()[0].get_array()) for ax in drawing.figure.axes[:3]]
    assert (first[0] == first[1]).all()  # the same mesh, camera and colours
    assert first[0].std() > 10


@pytest.mark.usefixtures("small_pictures")
def test_failures_are_the_worst_runs_with_heat_maps(group: Group, monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = []

    def load(folder: Path, trust: Collection[str]) -> Pair:  # noqa: ARG001 (the signature of `load_pair`)
        loaded.append("/".join(folder.parts[-3:-1]))
        return pair(labelled(scale=1.1))

    monkeypatch.setattr(pictures, "load_pair", load)
    drawing, missing = pictures.failures(group, Path("out"))
    assert drawing is not None
    assert missing == []
    assert loaded[0] == "hybrid/part_03"  # most cd_l1 over floor
    assert loaded[1].endswith("part_03")
    assert loaded[2].startswith("relu/")
    assert {"truth to prediction", "prediction to truth", "wrong labels"} < texts(drawing.figure)
    scales = [ax for ax in drawing.figure.axes if not ax.get_images()]
    assert len(drawing.figure.axes) == 3 * 5 + 3
    assert [tick.get_text() for tick in scales[0].get_yticklabels()] == ["0", "5%"]


def test_heat_is_light_for_no_error_and_dark_for_much() -> None:
    light, dark = pictures.heat_colours(np.array([0.0, 1.0]))
    assert to_hex(light / 255) == "#ffffcc"
    assert light.sum() > 2 * dark.sum()
