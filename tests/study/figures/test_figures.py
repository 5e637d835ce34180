import logging
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from study_rows import make_row, write

from jointsdf.errors import InputError
from jointsdf.runs.row import ResultRow, write_row
from jointsdf.study.collect import collect
from jointsdf.study.figures import renderings as pictures
from jointsdf.study.figures import run_meshes as meshes
from jointsdf.study.figures.__main__ import main, write_figures
from jointsdf.study.figures.loss_curves import loss_curves, read_curves
from jointsdf.study.figures.plots import error_scatter, metric_comparison, part_count, time_quality
from jointsdf.study.figures.run_meshes import Pair
from jointsdf.study.figures.style import COLOURS, MARKERS, dodge, head_style
from jointsdf.study.groups import Group, group_runs
from jointsdf.values import LabelledMesh, Shape

HEADS = ("relu", "siren", "hybrid")


def rows(study: str = "main") -> list[ResultRow]:
    made = []
    for k, parts in enumerate((3, 6, 12, 20)):
        for h, head in enumerate(HEADS):
            scores = {"cd_l1": 0.3 + 0.1 * k + 0.01 * h, "cd_l1_floor": 0.25, "nc": 0.9, "f1": 0.8, "acc": 0.97}
            scores |= {"miou": 0.9 - 0.1 * k, "miou_exact": 0.8 + 0.01 * h, "miou_exact_ceiling": 0.99}
            scores |= {"consistency": 0.95, "surface_p99": 0.01 * (k + 1)}
            row = make_row(head, f"part_0{k}", study=study, parts=parts, **scores)
            made.append(replace(row, seconds={"fit": 1.0, "total": 10.0 * k + h}))
    return made


@pytest.fixture
def group() -> Group:
    (only,) = group_runs(collect(rows()))
    return only


def texts(figure: Figure) -> set[str]:
    legends = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    return {*legends, *(text.get_text() for text in figure.texts)}


def points(figure: Figure, panel: int, head: str) -> list[tuple[float, float]]:
    """What is drawn in the marker of a head."""
    marker = head_style(head, HEADS)["marker"]
    lines = [line for line in figure.axes[panel].lines if line.get_marker() == marker and line.get_markersize() < 6]
    return [(float(x), float(y)) for line in lines for x, y in line.get_xydata()]


# -- plots of the rows


def test_metric_comparison_shows_every_value_by_head(group: Group) -> None:
    drawing = metric_comparison(group)
    assert drawing is not None
    assert texts(drawing.figure) == {*HEADS, "floor", "ceiling"}
    titles = [ax.get_title() for ax in drawing.figure.axes]
    assert titles[0].startswith("CD$_{L1}$")
    assert len(titles) == 8
    for place, head in enumerate(HEADS):
        shown = points(drawing.figure, 0, head)
        assert [y for _, y in shown] == pytest.approx([0.3 + 0.1 * k + 0.01 * place for k in range(4)])
        assert all(abs(x - place) <= 0.3 for x, _ in shown)
    floor = [line for line in drawing.figure.axes[0].lines if line.get_label() == "floor"]
    assert floor[0].get_ydata()[0] == 0.25
    assert "Study main, recipe fast, variant base, built-in shapes, brep labels, protocol unit" in drawing.caption


def test_error_scatter_has_a_point_per_run(group: Group) -> None:
    drawing = error_scatter(group)
    assert drawing is not None
    paper, exact = drawing.figure.axes
    assert (paper.get_xlabel(), paper.get_ylabel()) == (r"CD$_{L1}$ ($\times 10^{-2}$)", r"1 $-$ mIoU")
    assert (exact.get_xlabel(), exact.get_ylabel()) == ("CD$_{L1}$/floor", r"1 $-$ mIoU exact")
    expected = [(0.3 + 0.1 * k, 0.1 + 0.1 * k) for k in range(4)]
    assert np.array(points(drawing.figure, 0, "relu")) == pytest.approx(np.array(expected))
    assert points(drawing.figure, 1, "siren")[0] == pytest.approx((0.31 / 0.25, 0.19))


def test_time_quality_has_each_run_and_each_mean(group: Group) -> None:
    drawing = time_quality(group)
    assert drawing is not None
    assert [x for x, _ in points(drawing.figure, 1, "siren")] == [1.0, 11.0, 21.0, 31.0]
    large = [line.get_xydata()[0] for line in drawing.figure.axes[1].lines if line.get_markersize() > 6]
    assert [tuple(map(float, point)) for point in large] == [
        pytest.approx((15.0 + h, 0.8 + 0.01 * h)) for h in range(3)
    ]
    assert "Measured on: a machine" in drawing.caption


def test_time_quality_leaves_out_the_labels_of_a_baseline_without_any() -> None:
    bare = {"miou": math.nan, "miou_exact": math.nan}
    flat = [
        replace(row, head="none", scores={"unit": row.scores["unit"] | bare}) for row in rows() if row.head == "relu"
    ]
    (group,) = group_runs(collect([*rows(), *flat]))
    drawing = time_quality(group)
    assert drawing is not None
    large = [line.get_xydata()[0] for line in drawing.figure.axes[1].lines if line.get_markersize() > 6]
    assert [bool(np.isfinite(point).all()) for point in large] == [False, True, True, True]


def test_part_count_has_a_mean_in_each_range(group: Group) -> None:
    drawing = part_count(group)
    assert drawing is not None
    places = {round(x) for x, _ in points(drawing.figure, 2, "hybrid")}
    assert places == {3, 6, 12, 20}
    bars = [line.get_ydata()[0] for line in drawing.figure.axes[2].lines if line.get_marker() in ("None", "")]
    assert sorted({round(float(y), 9) for y in bars}) == pytest.approx([0.6, 0.7, 0.8, 0.9])
    assert "parts of the ground truth" in drawing.figure.axes[0].get_xlabel()


def test_what_no_run_has_is_no_figure() -> None:
    (bare,) = group_runs(collect([make_row("relu"), make_row("siren")]))
    assert [plot(bare) for plot in (metric_comparison, error_scatter, time_quality, part_count)] == [None] * 4


def test_missing_values_are_not_drawn_as_zero() -> None:
    made = [make_row("relu", f"abc_{k}", cd_l1=value) for k, value in enumerate((0.5, math.nan, 0.7))]
    (one,) = group_runs(collect(made))
    drawing = metric_comparison(one)
    assert drawing is not None
    assert [y for _, y in points(drawing.figure, 0, "relu")] == [0.5, 0.7]


def test_heads_look_the_same_everywhere_and_differ_in_colour_and_marker() -> None:
    assert head_style("siren", ["siren"]) == head_style("siren", ["none", "relu", "siren", "mine"])
    seven = ["none", "relu", "siren", "hybrid", "deep_skip", "mine", "yours"]
    assert (
        len({head_style(head, seven)["color"] for head in seven})
        == len({head_style(head, seven)["marker"] for head in seven})
        == 7
    )
    assert len(COLOURS) == len(MARKERS)


def test_points_of_one_value_are_moved_apart() -> None:
    shifts = dodge(np.array([0.5, 0.5, 0.5, 0.9]), 0.3)
    assert len(set(shifts[:3])) == 3
    assert np.abs(shifts).max() <= 0.3
    assert shifts[3] == 0


# -- loss curves


def test_loss_curves_are_the_events(tmp_path: Path, group: Group) -> None:
    from torch.utils.tensorboard import SummaryWriter

    for head, scale in (("relu", 1.0), ("siren", 2.0)):
        for k in range(4):
            with SummaryWriter(str(tmp_path / "main" / "base" / head / f"part_0{k}" / "seed0" / "tb")) as writer:
                for step in (0, 10, 20):
                    writer.add_scalar("loss/total", scale * (k + 1) / (step + 1), step)
                    writer.add_scalar("result/nc", 1.0, step)
    read = read_curves(tmp_path / "main" / "base" / "relu" / "part_01" / "seed0" / "tb")
    assert list(read) == ["total"]
    assert read["total"].to_dict() == pytest.approx({0: 2.0, 10: 2 / 11, 20: 2 / 21})
    drawing, missing = loss_curves(group, tmp_path)
    assert drawing is not None
    assert len(missing) == 4
    assert "hybrid" in missing[0]
    lines = {line.get_label(): line for line in drawing.figure.axes[0].lines}
    assert list(lines["siren"].get_xdata()) == [0, 10, 20]
    assert list(lines["siren"].get_ydata()) == pytest.approx([5.0, 5 / 11, 5 / 21])  # median of 2, 4, 6, 8
    assert drawing.figure.axes[0].get_yscale() == "log"
    assert "(relu 4, siren 4)" in drawing.caption


# -- pictures of meshes


def labelled(scale: float = 1.0) -> LabelledMesh:
    """A box with a part per side, of ids 0 to 5."""
    box = trimesh.creation.box((2.0 * scale, 1.0, 1.0)).subdivide().subdivide()
    labels = 2 * np.abs(box.face_normals).argmax(axis=1) + (box.face_normals.sum(axis=1) > 0)
    return LabelledMesh(np.array(box.vertices), np.array(box.faces), labels)


def pair(predicted: LabelledMesh) -> Pair:
    return Pair(Shape("box", labelled(), "sha", "builtin", True, 0, 0), predicted)


def test_parts_are_matched_to_those_that_they_cover() -> None:
    truth = labelled()
    permuted = pair(replace(truth, labels=np.array([3, 5, 4, 0, 2, 1])[truth.labels]))
    assert (permuted.matched.labels == truth.labels).all()
    assert permuted.wrong.all()
    split_in_two = truth.labels.copy()
    split_in_two[np.flatnonzero(truth.labels == 2)[:4]] = 9
    extra = pair(replace(truth, labels=split_in_two))
    assert (extra.matched.labels[extra.predicted.labels != 9] == truth.labels[split_in_two != 9]).all()
    assert extra.matched.labels[split_in_two == 9].min() > 9
    assert (extra.wrong == (split_in_two == 9)).all()


def test_errors_are_distances_in_shares_of_the_longest_side() -> None:
    longer = pair(labelled(scale=1.1))
    ends = np.abs(meshes.centroids(longer.predicted)[:, 0]) > 1.09
    assert longer.error[ends] == pytest.approx(0.1 / 2)
    assert longer.error[~ends].max() <= 0.1 / 2 + 1e-9
    assert longer.missed.max() == pytest.approx(0.1 / 2)
    assert pair(labelled()).error.max() == pytest.approx(0.0, abs=1e-12)


@pytest.fixture
def small_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pictures, "PIXELS", {"width": 60, "height": 45, "supersampling": 1})


@pytest.mark.usefixtures("small_pictures")
def test_triptychs_show_a_row_per_shape(group: Group, monkeypatch: pytest.MonkeyPatch) -> None:
    def load(folder: Path) -> Pair:
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

    def load(folder: Path) -> Pair:
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


# -- the command


def test_the_command_writes_what_it_can_and_says_what_it_cannot(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    for row in rows():
        write_row(tmp_path / "main" / "base" / row.head / row.shape / "seed0", row)
    with caplog.at_level(logging.INFO):
        assert main([str(tmp_path), "--results", str(tmp_path / "none")]) == 0
    made = ("metric_comparison", "error_scatter", "time_quality", "part_count_plot")
    folder = tmp_path / "figures"
    assert {path.name for path in folder.iterdir()} == {f"{n}.{e}" for n in made for e in ("pdf", "png", "tex")}
    for name in made:
        assert (folder / f"{name}.pdf").read_bytes().startswith(b"%PDF")
        assert (folder / f"{name}.png").stat().st_size > 5000
        assert rf"\includegraphics[width=\linewidth]{{{name}.pdf}}" in (folder / f"{name}.tex").read_text()
    said = [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]
    assert [line.partition(":")[0] for line in said] == ["triptychs", "failures", "loss_curves"]
    assert "without 4 run folders, the first: " in said[0]
    assert all("\n" not in line for line in said)


def test_figures_of_groups_gone_since_are_deleted(tmp_path: Path) -> None:
    folder = tmp_path / "figures"
    folder.mkdir()
    for name in ("time_quality--old.pdf", "triptychs.png", "mine.png"):
        (folder / name).write_text("")
    assert write_figures([make_row("relu")], tmp_path) == []
    assert [path.name for path in folder.iterdir()] == ["mine.png"]


def test_no_rows_is_one_line_and_exit_code_2(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    assert main([str(tmp_path), "--results", str(tmp_path)]) == 2
    assert "no result rows below it" in caplog.records[-1].getMessage()


def test_a_run_without_its_mesh_is_named(tmp_path: Path) -> None:
    write(tmp_path, make_row())
    with pytest.raises(InputError, match=r"run0000/mesh.ply is not there"):
        meshes.load_pair(tmp_path / "run0000")
