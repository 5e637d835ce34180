"""The page of runs of one shape, ground truth and fits side by side: `report.html` of a run folder."""

import time
from collections.abc import Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np

from jointsdf.geometry.mesh import part_areas
from jointsdf.runs.files import write_atomically
from jointsdf.runs.row import ResultRow, score_of
from jointsdf.values import UNLABELLED, Subject
from jointsdf.viewing.page.document import ASSETS, page_modules, render_page, without_nan
from jointsdf.viewing.page.numbers import plain
from jointsdf.viewing.page.packed_surfaces import colours_of
from jointsdf.viewing.page.scene import Detail, Fit, Scene, build_scene
from jointsdf.viewing.page.texts import about, accuracy, facts, quoted_protocol, size_note
from jointsdf.viewing.palette import HEAD_COLOURS

REPORT = "report.html"
MODES = {
    "part": ("part", "The colour of each part, the same in every picture of the project."),
    "error": (
        "signed error",
        "Distance to the other surface: red where the fit has material too much, blue where too little.",
    ),
    "wrong": ("wrong labels", "Orange where the part differs from that of the closest place of the other surface."),
    "normal": ("normals", "Angle between the normals of a face and of the closest place of the other surface."),
    "head": ("head", "A colour for each fit."),
}
OF_POINTS = "Points: distance from the fit, red inside it, blue outside. Fit: distance from the nearest point, red."
ISOLINES = 14  # about so many across the longest side
FIRST_CLIP = 0.6  # of the slider: an end of the colour scale 16 times below the largest error


def write_run_page(
    path: Path,
    shape: Subject,
    fits: Sequence[tuple[Fit, ResultRow]],
    *,
    warnings: Sequence[str] = (),
    detail: Detail = Detail(),  # noqa: B008 (immutable)
    shared: str = "",
    back: str = "",
) -> None:
    """Write the page.

    Args:
        path: Of the HTML file.
        shape: What was fitted, file frame.
        fits: Its fits and their rows, at least one.
        warnings: What the runs warned of.
        detail: How much of them.
        shared: Path of the shared script from the page; empty for a page that needs no other file.
        back: Link to the page of the study; empty for none.
    """
    began = time.perf_counter()
    scene, rows = build_scene(shape, [fit for fit, _ in fits], detail), [row for _, row in fits]
    page = about(scene, rows) | {"warnings": list(dict.fromkeys(warnings)), "back": back}
    page["runs"] = [{"name": fit.name, "facts": facts(row)} for fit, row in fits]
    page["runs"].append({"name": "this page", "facts": [("made in", f"{time.perf_counter() - began:.1f} s")]})
    text = render_page(
        ASSETS.joinpath("run.html"),
        modules=[] if shared else page_modules(),
        shared=shared,
        data=without_nan(_data(scene)),
        page=page,
        scene=_view(scene, rows),
    )
    write_atomically(path, text)


def _data(scene: Scene) -> dict[str, Any]:
    """What the scripts read."""
    corners = scene.corners
    low, high = corners.min(axis=0), corners.max(axis=0)
    colours = cycle(HEAD_COLOURS[1:])
    surfaces = [surface | ({"colour": next(colours)} if surface["role"] == "fit" else {}) for surface in scene.surfaces]
    parts = [
        {"name": _part_name(part), "colour": colour}
        for part, colour in zip(scene.part_ids.tolist(), colours_of(scene.part_ids), strict=True)
    ]
    return {
        "unit": scene.shape.unit.name,
        "up": scene.shape.up,
        "middle": ((low + high) / 2).tolist(),
        "radius": float(np.linalg.norm(high - low) / 2),
        "box": {"low": low.tolist(), "high": high.tolist()},
        "spacing": _round(scene.size / ISOLINES),
        "largest": scene.largest or 1.0,
        "parts": parts,
        "surfaces": surfaces,
        "legends": {mode: text for mode, (_, text) in MODES.items()}
        | ({} if scene.shape.truth else {"error": OF_POINTS}),
    }


def _view(scene: Scene, rows: Sequence[ResultRow]) -> dict[str, Any]:
    """What the template reads of the scene."""
    unit, truth = scene.shape.unit.name, scene.shape.truth
    labelled = any(row.num_parts for row in rows)
    has_iou = any(
        f"iou_{part}" in row.scores.get(quoted_protocol(row), {}) for row in rows for part in scene.part_ids.tolist()
    )
    areas = {} if truth is None else _areas(truth.mesh)
    found = [_areas(fit.mesh) for fit in scene.fits]
    parts = []
    for part in scene.part_ids.tolist():
        ious = [plain(score_of(row, quoted_protocol(row), f"iou_{part}"), 3) for row in rows]
        cells = ious if has_iou else [plain(own.get(part, float("nan")), 3) for own in found]
        parts.append({"name": _part_name(part), "area": plain(areas.get(part, float("nan")), 3), "cells": cells})
    hidden = {"head"} if len(rows) == 1 else set()
    hidden |= set() if labelled else {"wrong"}
    spacing = f"{_round(scene.size / ISOLINES):g}"
    surfaces = [
        surface | {"note": size_note(surface), "accuracy": accuracy(surface, scene)} for surface in scene.surfaces
    ]
    return {
        "surfaces": surfaces,
        "fits": [fit.name for fit in scene.fits],
        "modes": [(mode, name) for mode, (name, _) in MODES.items() if mode not in hidden],
        "clip": FIRST_CLIP,
        "unit": unit,
        "parts": parts,
        "has_iou": has_iou,
        "field_note": f"In the plane: signed distance, an isoline every {spacing} {unit}, the thick one its zero.",
    }


def _part_name(part: int) -> str:
    return "unlabelled" if part == UNLABELLED else f"part {part}"


def _areas(mesh: Any) -> dict[int, float]:
    return dict(zip(mesh.part_ids.tolist(), part_areas(mesh).tolist(), strict=True)) if not mesh.is_empty else {}


def _round(value: float) -> float:
    """A length of one digit: 1, 2 or 5 times a power of ten.

    >>> _round(0.034), _round(7.0)
    (0.02, 5.0)
    """
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(step for step in (1, 2, 5) if step * power <= value * (1 + 1e-9)))
