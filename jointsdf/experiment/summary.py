"""Last lines of a run: its scores, the quality of its mesh in words, and the files to open."""

import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path

import trimesh
from omegaconf import DictConfig

from jointsdf.evaluation.protocol import Protocol, bounding_frame
from jointsdf.runs.records import HOLDOUT
from jointsdf.runs.row import ResultRow, score_of
from jointsdf.values import LabelledMesh, Shape, Subject
from jointsdf.viewing.page.run_page import REPORT

QUOTED_SCORES = {"surface_p99", "parts_pred", "parts_gt", "components", "components_gt"}


def last_lines(
    row: ResultRow,
    protocol: str,
    folder: Path | None,
    protocols: Mapping[str, Protocol],
    shape: Subject,
    mesh: LabelledMesh,
) -> list[str]:
    """The lines that end a run; arguments as of `summary` and `describe`."""
    files = files_to_open(folder) if folder and not mesh.is_empty else ""
    return [line for line in (summary(row, protocol, folder), describe(row, protocols, shape, mesh), files) if line]


def summary(row: ResultRow, protocol: str, folder: Path | None) -> str:
    """Scores and seconds of the run in one line.

    Args:
        row: The run's row.
        protocol: Name of the protocol to quote.
        folder: The run folder; None where it does not last.
    """
    if row.status == "empty_mesh":
        return f"{row.shape} {row.head}: empty_mesh (the field has no surface in the box), {folder or 'not kept'}"
    fitted, total = (row.seconds.get(stage, math.nan) for stage in ("fit", "total"))
    if HOLDOUT in row.scores:
        score = partial(score_of, row, HOLDOUT)
        return (
            f"{row.shape} {row.head}: held-out points {score('held_out_mean'):.3%} from the surface "
            f"(p99 {score('held_out_p99'):.3%} of the longest side), labels right at {score('held_out_acc'):.1%}  "
            f"surface to cloud {score('to_cloud_mean'):.3%}, uncovered {score('uncovered'):.1%}  "
            f"components {score('components'):.0f}  fit {fitted:.0f} s, total {total:.0f} s"
            + (f"  {folder}" if folder else "")
        )
    score = partial(score_of, row, protocol)
    return (
        f"{row.shape} {row.head}: cd_l1 {score('cd_l1'):.4f} (floor {score('cd_l1_floor'):.4f})  "
        f"nc {score('nc'):.4f}  "
        f"miou {score('miou'):.4f} (floor {score('miou_floor'):.4f})  miou_exact {score('miou_exact'):.4f} "
        f"(ceiling {score('miou_exact_ceiling'):.4f})  components {score('components'):.0f}  "
        f"fit {fitted:.0f} s, total {total:.0f} s" + (f"  {folder}" if folder else "")
    )


def describe(row: ResultRow, protocols: Mapping[str, Protocol], shape: Subject, mesh: LabelledMesh) -> str:
    """Quality of the mesh in plain words; empty for a run without surface or without the scores it quotes.

    Args:
        row: The run's row.
        protocols: The run's protocols; the first whose frame is the ground truth's is quoted.
        shape: Mesh or point cloud; empty text for one without a truth.
        mesh: The run's mesh, file frame.
    """
    quoted = next((name for name, protocol in protocols.items() if protocol.frame == "truth"), None)
    truth = shape.truth
    if truth is None or quoted is None or mesh.is_empty or not row.scores[quoted].keys() >= QUOTED_SCORES:
        return ""
    scores, side = row.scores[quoted], bounding_frame(truth.mesh).scale
    p99 = scores["surface_p99"]
    facts = [
        f"99% of the surface is within {p99 * side:.2g} {truth.unit.name} of the part ({p99:.2%} of its longest side)"
    ]
    if row.num_parts:
        facts.append(f"{scores['parts_pred']:.0f} of {scores['parts_gt']:.0f} parts")
    closed = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).is_watertight
    facts.append("watertight" if closed else "not watertight")
    pieces, wanted = scores["components"], scores["components_gt"]
    facts.append("one piece" if pieces == wanted == 1 else f"{pieces:.0f} pieces where the part has {wanted:.0f}")
    if specks := scores.get("specks", 0):
        facts.append(f"{specks:.0f} of them specks (extraction.smallest_piece=0.003 leaves them out)")
    return ", ".join(facts)


def three_numbers(cfg: DictConfig, scores: Mapping[str, float], truth: Shape) -> str:
    """Mean and 99th percentile of the surface's distance in file units, and the share of right labels, for a picture.

    Without labels the volume takes their place. Empty where the primary protocol is not in the ground truth's frame, or
    a number is missing.

    Args:
        cfg: The composed config.
        scores: Of the primary protocol.
        truth: Ground truth.
    """
    side, unit = bounding_frame(truth.mesh).scale, truth.unit.name
    mean, p99, right = (scores.get(name, math.nan) for name in ("surface_mean", "surface_p99", "acc_exact"))
    volume = scores.get("volume", math.nan) / scores.get("volume_gt", math.nan)
    third = f"labels right on {right:.2%} of the surface" if math.isfinite(right) else f"volume {volume - 1:+.2%}"
    if cfg.evaluation.protocols[cfg.evaluation.primary].frame != "truth" or not math.isfinite(mean + p99 + volume):
        return ""
    return f"distance to the truth: mean {mean * side:.2g} {unit}, 99% within {p99 * side:.2g} {unit}; {third}"


def files_to_open(folder: Path) -> str:
    """Paths of page, picture, mesh and scores."""
    if (folder / REPORT).is_file():
        return f"open {folder / REPORT} (browser, 3D); preview.png, mesh.glb and result.json (every number) beside it"
    return f"open {folder / 'preview.png'} (picture), mesh.glb (3D viewer), result.json (every number) beside it"
