"""Pages of rendered meshes: ground truth next to predictions, and the worst runs with their errors."""

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float, UInt8
from matplotlib import colormaps
from numpy import ndarray
from PIL import Image, ImageDraw

from jointsdf.errors import InputError
from jointsdf.study.captions import caption
from jointsdf.study.comparisons import compare
from jointsdf.study.figures.focus import LABEL_RADIUS, RADIUS, Focus, find_focus
from jointsdf.study.figures.loss_curves import run_folder
from jointsdf.study.figures.page import HEAT, Picture, Row, draw_page, trim
from jointsdf.study.figures.run_meshes import Pair, load_pair
from jointsdf.study.figures.style import Drawing
from jointsdf.study.groups import Group
from jointsdf.values import LabelledMesh
from jointsdf.viewing.raycast import fit_camera
from jointsdf.viewing.render import render

PIXELS: dict[str, Any] = {"width": 600, "height": 450}
PREFERRED = ("hybrid", "siren", "relu", "deep_skip")  # the paper shows the first two
TRIPTYCHS = 6
HEAT_QUANTILE = 0.999  # of the distances, at the end of the colour scale
LEAST_HEAT = 1e-4  # of the longest side: the least end of the scale
RIGHT, WRONG = (225, 225, 225), (178, 24, 43)
OF_LABELS = ("miou_exact",)
CRITERIA = {  # column: name, whether the largest is worst
    "cd_l1_over_floor": ("CD$_{L1}$/floor", True),
    "surface_p99": ("surface p99", True),
    "miou_exact": ("mIoU exact", False),
}


def triptychs(group: Group, outputs: Path, trust: Collection[str] = ()) -> tuple[Drawing | None, list[str]]:
    """Ground truth and two heads in part colours, a row per shape, one camera per row.

    The shapes are spread evenly over the number of parts, not chosen by hand.

    Args:
        group: Runs that may be compared.
        outputs: Folder of the studies.
        trust: Modules whose classes a run folder's config may name.

    Returns:
        The figure, None where no run can be shown; and a message for each run that cannot.
    """
    comparison = compare(group, baseline=False)
    heads = [head for head in (*PREFERRED, *comparison.heads) if head in comparison.heads]
    heads = list(dict.fromkeys(heads))[:2]
    counts = comparison.runs.groupby("shape")["num_parts"].max()
    order = sorted(comparison.shapes, key=lambda shape: (counts[shape], shape))
    chosen = dict.fromkeys(order[int(place)] for place in np.linspace(0, len(order) - 1, TRIPTYCHS)) if order else {}
    rows, missing = [], []
    for shape in chosen:
        here = comparison.runs[comparison.runs["shape"] == shape].sort_values("seed")
        runs = [here[here["head"] == head].iloc[0] for head in heads]
        if empty := [run["head"] for run in runs if run["status"] != "ok"]:
            missing.append(f"{shape}: no mesh from {', '.join(empty)}")
            continue
        try:
            pairs = [load_pair(run_folder(outputs, run), trust) for run in runs]
        except InputError as error:
            missing.append(str(error))
            continue
        rows.append(_triptych_row(f"{shape}\n{counts[shape]} parts", pairs, runs))
    if not rows:
        return None, missing
    what = (
        "Ground truth and reconstructions in part colours, each row by one camera; a predicted part has the colour of "
        "the ground truth's part that it covers best, one to one. Shapes: spread evenly over the number of parts"
    )
    titles = ["ground truth", *heads]
    return Drawing(draw_page(rows, titles), caption(what, comparison, unequal=False)), missing


def failures(group: Group, outputs: Path, trust: Collection[str] = ()) -> tuple[Drawing | None, list[str]]:
    """The worst run by each criterion: ground truth, prediction, both with the distance between them, wrong labels.

    Args:
        group: Runs that may be compared.
        outputs: Folder of the studies.
        trust: Modules whose classes a run folder's config may name.

    Returns:
        The figure, None where no run can be shown; and a message for each run that cannot.
    """
    comparison = compare(group, baseline=False)
    runs = comparison.runs[comparison.runs["status"] == "ok"]
    rows, missing = [], []
    for column, (name, largest) in CRITERIA.items():
        if column not in runs or runs[column].isna().all():
            continue
        run = runs.sort_values(column, ascending=not largest, kind="stable").iloc[0]
        try:
            pair = load_pair(run_folder(outputs, run), trust)
        except InputError as error:
            missing.append(str(error))
            continue
        text = f"{name}: {run[column]:.3g}\n{run['head']}\n{run['shape']}"
        rows.append(_failure_row(text, pair, labels=column in OF_LABELS))
    if not rows:
        return None, missing
    what = (
        "The worst run by each measure, of those with a mesh: the whole ground truth with the place of the most error "
        "(of the most wrong labels, where the measure is of labels), then that place from the same side. Heat: "
        "distance of the ground truth to the prediction and of the prediction to the ground truth, in percent of the "
        "longest side; dark red: predicted faces whose label is not the ground truth's"
    )
    titles = ["ground truth", "prediction", "truth to prediction", "prediction to truth", "wrong labels"]
    return Drawing(draw_page(rows, titles), caption(what, comparison, unequal=False)), missing


def _triptych_row(title: str, pairs: Sequence[Pair], runs: Sequence[pd.Series]) -> Row:
    truth = pairs[0].truth.mesh
    pictures = [render(truth, **PIXELS), *(render(pair.matched, framed=truth, **PIXELS) for pair in pairs)]
    notes = [f"mIoU exact {run['miou_exact']:.3f}, CD/floor {run['cd_l1_over_floor']:.2f}" for run in runs]
    return Row(title, trim(pictures), ["", *notes])


def _failure_row(title: str, pair: Pair, *, labels: bool) -> Row:
    truth, view = pair.truth.mesh, dict(PIXELS)
    whole = render(truth, **PIXELS)
    if focus := _focus(pair, labels=labels):
        whole = _box_drawn(render(truth, **PIXELS, azimuth=focus.azimuth, elevation=focus.elevation), truth, focus)
        view |= {"framed": focus.corners, "azimuth": focus.azimuth, "elevation": focus.elevation}
    else:
        view |= {"framed": truth}
    end = max(float(np.quantile(np.concatenate([pair.error, pair.missed]), HEAT_QUANTILE)), LEAST_HEAT)
    label_colours = np.where(pair.wrong[:, None], WRONG, RIGHT).astype(np.uint8)
    pictures = [
        whole,
        render(pair.matched, **view),
        render(_plain(truth), colours=heat_colours(pair.missed / end), **view),
        render(_plain(pair.predicted), colours=heat_colours(pair.error / end), **view),
        render(_plain(pair.predicted), colours=label_colours, **view),
    ]
    return Row(title, trim(pictures), [""] * len(pictures), heat=100 * end)


def _focus(pair: Pair, *, labels: bool) -> Focus | None:
    """Where the most labels are wrong, or where one surface is farthest from the other, by the square."""
    if labels:
        return find_focus(pair.predicted, pair.wrong.astype(float), LABEL_RADIUS * pair.size)
    if pair.missed.max(initial=0) > pair.error.max(initial=0):
        return find_focus(pair.truth.mesh, pair.missed**2, RADIUS * pair.size)
    return find_focus(pair.predicted, pair.error**2, RADIUS * pair.size)


def _box_drawn(picture: Picture, mesh: LabelledMesh, focus: Focus) -> Picture:
    """The picture of the whole mesh with the focus framed."""
    height, width = picture.shape[:2]
    camera = fit_camera(mesh, width, height, focus.azimuth, focus.elevation)
    right, up, _ = camera.project(focus.corners).T
    box = (right.min() + width / 2, height / 2 - up.max(), right.max() + width / 2, height / 2 - up.min())
    image = Image.fromarray(picture)
    ImageDraw.Draw(image).rectangle(box, outline=WRONG, width=max(1, width // 200))
    return np.asarray(image)


def _plain(mesh: LabelledMesh) -> LabelledMesh:
    """The mesh without part borders."""
    return LabelledMesh(mesh.vertices, mesh.faces, np.zeros_like(mesh.labels))


def heat_colours(shares: Float[ndarray, " f"]) -> UInt8[ndarray, "f 3"]:
    """Colours (sRGB) of shares, light for 0 and dark for 1; clipped outside."""
    colours: ndarray = colormaps[HEAT](np.clip(shares, 0, 1), bytes=True)[:, :3]
    return colours
