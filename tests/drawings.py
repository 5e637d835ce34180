"""Rows and meshes to draw, and what a figure shows."""

from dataclasses import replace

import numpy as np
import trimesh
from matplotlib.figure import Figure
from study_rows import make_row

from jointsdf.runs.row import ResultRow
from jointsdf.study.figures.run_meshes import Pair
from jointsdf.study.figures.style import INK, head_style
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


def texts(figure: Figure) -> set[str]:
    legends = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    return {*legends, *(text.get_text() for text in figure.texts)}


def points(figure: Figure, panel: int, head: str) -> list[tuple[float, float]]:
    """What is drawn in the marker of a head."""
    marker = head_style(head, HEADS)["marker"]
    lines = [
        line for line in figure.axes[panel].lines if line.get_marker() == marker and line.get_markeredgecolor() != INK
    ]
    return [(float(x), float(y)) for line in lines for x, y in line.get_xydata()]


def labelled(scale: float = 1.0) -> LabelledMesh:
    """A box with a part per side, of ids 0 to 5."""
    box = trimesh.creation.box((2.0 * scale, 1.0, 1.0)).subdivide().subdivide()
    labels = 2 * np.abs(box.face_normals).argmax(axis=1) + (box.face_normals.sum(axis=1) > 0)
    return LabelledMesh(np.array(box.vertices), np.array(box.faces), labels)


def pair(predicted: LabelledMesh) -> Pair:
    return Pair(Shape("box", labelled(), "sha", "builtin", True), predicted)
