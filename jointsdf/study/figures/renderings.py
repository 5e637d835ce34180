"""Pages of rendered meshes: ground truth next to predictions, and the worst runs with their errors."""

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float, UInt8
from matplotlib import colormaps
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.study.captions import caption
from jointsdf.study.comparisons import compare
from jointsdf.study.figures.loss_curves import run_folder
from jointsdf.study.figures.page import HEAT, Row, draw_page, trim
from jointsdf.study.figures.run_meshes import Pair, load_pair
from jointsdf.study.figures.style import Drawing
from jointsdf.study.groups import Group
from jointsdf.values import LabelledMesh
from jointsdf.viewing.render import render

PIXELS: dict[str, Any] = {"width": 600, "height": 450}
PREFERRED = ("hybrid", "siren", "relu", "deep_skip")  # the paper shows the first two
TRIPTYCHS = 6
HEAT_QUANTILE = 0.999  # of the distances, at the end of the colour scale
LEAST_HEAT = 1e-4  # of the longest side: the least end of the scale
RIGHT, WRONG = (225, 225, 225), (178, 24, 43)
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
        rows.append(_failure_row(text, pair))
    if not rows:
        return None, missing
    what = (
        "The worst run by each measure, of those with a mesh. Heat: distance of the ground truth to the prediction and "
        "of the prediction to the ground truth, in percent of the longest side; dark red: predicted faces whose label "
        "is not the ground truth's"
    )
    titles = ["ground truth", "prediction", "truth to prediction", "prediction to truth", "wrong labels"]
    return Drawing(draw_page(rows, titles), caption(what, comparison, unequal=False)), missing


def _triptych_row(title: str, pairs: Sequence[Pair], runs: Sequence[pd.Series]) -> Row:
    truth = pairs[0].truth.mesh
    pictures = [render(truth, **PIXELS), *(render(pair.matched, framed=truth, **PIXELS) for pair in pairs)]
    notes = [f"mIoU exact {run['miou_exact']:.3f}, CD/floor {run['cd_l1_over_floor']:.2f}" for run in runs]
    return Row(title, trim(pictures), ["", *notes])


def _failure_row(title: str, pair: Pair) -> Row:
    truth = pair.truth.mesh
    end = max(float(np.quantile(np.concatenate([pair.error, pair.missed]), HEAT_QUANTILE)), LEAST_HEAT)
    label_colours = np.where(pair.wrong[:, None], WRONG, RIGHT).astype(np.uint8)
    pictures = [
        render(truth, **PIXELS),
        render(pair.matched, framed=truth, **PIXELS),
        render(_plain(truth), colours=heat_colours(pair.missed / end), **PIXELS),
        render(_plain(pair.predicted), framed=truth, colours=heat_colours(pair.error / end), **PIXELS),
        render(_plain(pair.predicted), framed=truth, colours=label_colours, **PIXELS),
    ]
    return Row(title, trim(pictures), [""] * len(pictures), heat=100 * end)


def _plain(mesh: LabelledMesh) -> LabelledMesh:
    """The mesh without part borders."""
    return LabelledMesh(mesh.vertices, mesh.faces, np.zeros_like(mesh.labels))


def heat_colours(shares: Float[ndarray, " f"]) -> UInt8[ndarray, "f 3"]:
    """Colours (sRGB) of shares, light for 0 and dark for 1; clipped outside."""
    colours: ndarray = colormaps[HEAT](np.clip(shares, 0, 1), bytes=True)[:, :3]
    return colours
