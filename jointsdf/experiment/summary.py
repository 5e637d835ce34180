"""Last lines of a run: its scores, the quality of its mesh in words, and the files to open."""

from collections.abc import Mapping
from pathlib import Path

import trimesh

from jointsdf.evaluation.protocol import Protocol, bounding_frame
from jointsdf.runs.row import ResultRow
from jointsdf.values import LabelledMesh, Shape

QUOTED_SCORES = {"surface_p99", "parts_pred", "parts_gt", "components", "components_gt"}


def summary(row: ResultRow, protocol: str, folder: Path | None) -> str:
    """Scores and seconds of the run in one line.

    Args:
        row: The run's row.
        protocol: Name of the protocol to quote.
        folder: The run folder; None where it does not last.
    """
    scores = row.scores[protocol]
    if row.status == "empty_mesh":
        return f"{row.shape} {row.head}: empty_mesh (the field has no surface in the box), {folder or 'not kept'}"
    return (
        f"{row.shape} {row.head}: cd_l1 {scores['cd_l1']:.4f} (floor {scores['cd_l1_floor']:.4f})  "
        f"nc {scores['nc']:.4f}  "
        f"miou {scores['miou']:.4f} (floor {scores['miou_floor']:.4f})  miou_exact {scores['miou_exact']:.4f} "
        f"(ceiling {scores['miou_exact_ceiling']:.4f})  components {scores['components']:.0f}  "
        f"fit {row.seconds['fit']:.0f} s, total {row.seconds['total']:.0f} s" + (f"  {folder}" if folder else "")
    )


def describe(row: ResultRow, protocols: Mapping[str, Protocol], truth: Shape, mesh: LabelledMesh) -> str:
    """Quality of the mesh in plain words; empty for a run without surface or without the scores it quotes.

    Args:
        row: The run's row.
        protocols: The run's protocols; the first whose frame is the ground truth's is quoted.
        truth: Ground truth.
        mesh: The run's mesh, file frame.
    """
    quoted = next((name for name, protocol in protocols.items() if protocol.frame == "truth"), None)
    if quoted is None or mesh.is_empty or not row.scores[quoted].keys() >= QUOTED_SCORES:
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
    return ", ".join(facts)


def files_to_open(folder: Path) -> str:
    """Paths of picture, mesh and scores."""
    return f"open {folder / 'preview.png'} (picture), mesh.glb (3D viewer), result.json (every number) beside it"
