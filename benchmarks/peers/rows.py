"""One peer on one run's cloud: from the config to its result row, in the folder of a run."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from omegaconf import DictConfig

from benchmarks.peers.label_transfer import TRANSFERS
from benchmarks.peers.orientations import ORIENTATIONS
from benchmarks.peers.poisson import Triangles, screened_poisson
from jointsdf.data.point_cloud import Cloud
from jointsdf.evaluation.protocol import GroundTruth, Scores
from jointsdf.experiment import build
from jointsdf.experiment.process import process_settings
from jointsdf.experiment.settings import resolve_settings, shared_settings
from jointsdf.experiment.stopwatch import Stopwatch
from jointsdf.runs import folder as run_folder
from jointsdf.runs import status
from jointsdf.runs.lock import lock
from jointsdf.runs.provenance import code_state, provenance
from jointsdf.runs.row import ResultRow, config_hash, write_row
from jointsdf.shapes.mesh_report import MeshReport, mesh_report
from jointsdf.training.hardware import peak_memory_mb
from jointsdf.values import UNLABELLED, LabelledMesh, Shape
from jointsdf.viewing.export import write_mesh

DEPTH = 9  # of Poisson's octree


@dataclass(frozen=True)
class Peer:
    """A way to reconstruct, whose name stands in the column of the heads.

    Attributes:
        orientation: Of `ORIENTATIONS`.
        labels: Of `TRANSFERS`.
    """

    orientation: str
    labels: str

    @property
    def name(self) -> str:
        """As in rows and folders."""
        return f"poisson_{self.orientation}_{self.labels}"


PEERS = {peer.name: peer for peer in (Peer(way, labels) for way in ORIENTATIONS for labels in TRANSFERS)}


def peer_rows(cfg: DictConfig, peers: Sequence[Peer]) -> list[ResultRow]:
    """Reconstruct the cloud of a config in several ways, score each by the config's protocols, and write its rows.

    A row that is there already is left as it is.

    Args:
        cfg: The composed config of a run, whose cloud is used.
        peers: In the order of the rows.

    Raises:
        InputError: Shape or config cannot be used, or a library is not installed.
    """
    with process_settings():
        build.check_config(cfg)
        scene = Scene(cfg, build.load_shape(cfg))
        return [scene.row(peer) for peer in peers]


class Scene:
    """One shape and its cloud, with what several peers share: surfaces by orientation, samples of the truth.

    Args:
        cfg: The config, checked.
        shape: Ground truth.
    """

    def __init__(self, cfg: DictConfig, shape: Shape) -> None:
        self.cfg, self.shape = cfg, shape
        self.cloud: Cloud = build.cloud_of(cfg, shape)
        self.truth = GroundTruth(shape.mesh, build.measures(cfg, 2**DEPTH).protocols)
        self.settings, fingerprint = resolve_settings(cfg, shape, 1.0)
        self.identity = {name: fingerprint[name] for name in ("seed", "tessellation", "data", "evaluation", "shape")}
        self.surface = cache(self._surface)
        self.references = cache(lambda: self.truth.references(None))
        self.report = cache(lambda: mesh_report(shape))

    def row(self, peer: Peer) -> ResultRow:
        """The peer's row, from its folder or made now."""
        cfg = self.cfg
        names = (cfg.paths.outputs, cfg.study, cfg.variant, peer.name, self.shape.name, f"seed{cfg.seed}")
        folder = Path(*map(str, names))
        identity: dict[str, Any] = {**self.identity, "peer": {"name": peer.name, "depth": DEPTH}}
        with lock(folder, wait=True):
            if found := run_folder.finished_row(folder, identity, force=cfg.force, reuse=False):
                return found
            status.begin(folder)
            run_folder.claim(folder, self.settings, identity, resume="never", force=cfg.force)
            row = self._make(peer, folder, identity)
            write_row(folder, row)
            status.end(folder)
        return row

    def _make(self, peer: Peer, folder: Path, identity: dict[str, Any]) -> ResultRow:
        code, watch = code_state(), Stopwatch()
        surface, seconds = self.surface(peer.orientation)
        watch.seconds |= seconds
        with watch("label", f"{len(surface[1])} faces by {peer.labels}"):
            mesh = self._labelled(surface, peer.labels)
        write_mesh(folder, mesh, self.shape.unit, self.shape.up)
        with watch("evaluate", peer.name):
            found = self.truth.scores(mesh)
            scores = {name: found[name] | references for name, references in self.references().items()}
        facts = provenance(
            code,
            config_hash=config_hash(identity),
            settings_hash=config_hash(shared_settings(self.settings) | {"peer": peer.name}),
            device="cpu",
            threads=1,
            mesh_sha256=self.shape.mesh_sha256,
            label_provider=self.shape.label_provider,
            resolution=2**DEPTH,
            **self.report().facts(),
        )
        return _row(self.cfg, peer, self.shape, self.report(), mesh, scores, watch.seconds, facts)

    def _surface(self, orientation: str) -> tuple[Triangles, dict[str, float]]:
        """The surface in the network frame, and the seconds that it took."""
        points, watch = self.cloud.points[: self.cloud.uniform], Stopwatch()
        with watch("prepare", f"normals of {len(points)} points by {orientation}"):
            normals = ORIENTATIONS[orientation](points)
        with watch("fit", f"screened Poisson, depth {DEPTH}, {normals.any(axis=1).mean():.0%} of the normals known"):
            surface = screened_poisson(points, normals, DEPTH)
        return surface, watch.seconds

    def _labelled(self, surface: Triangles, transfer: str) -> LabelledMesh:
        """The mesh with part labels, file frame."""
        cloud, (vertices, faces) = self.cloud, surface
        nothing = LabelledMesh(vertices, faces, np.full(len(faces), UNLABELLED))
        points, labels = cloud.points[: cloud.uniform], cloud.labels[: cloud.uniform]
        classes = nothing.labels
        if len(faces) and (labels != UNLABELLED).any():
            classes = cloud.part_ids[TRANSFERS[transfer](nothing, points, labels)]
        return LabelledMesh(cloud.normalisation.inverse(vertices), faces, classes)


def _row(
    cfg: DictConfig,
    peer: Peer,
    shape: Shape,
    report: MeshReport,
    mesh: LabelledMesh,
    scores: Scores,
    seconds: dict[str, float],
    facts: dict[str, Any],
) -> ResultRow:
    """The row; its head is the peer's name, and it took no steps."""
    sizes = {"faces_gt": len(shape.mesh.faces), "faces_pred": len(mesh.faces), "vertices_pred": len(mesh.vertices)}
    return ResultRow(
        study=cfg.study,
        variant=cfg.variant,
        recipe=cfg.recipe,
        head=peer.name,
        shape=shape.name,
        seed=cfg.seed,
        status="empty_mesh" if mesh.is_empty else "ok",
        steps=0,
        num_parts=len(shape.mesh.part_ids),
        counts={**sizes, "parameters_trunk": 0, "parameters_head": 0, **report.counts()},
        seconds={stage: round(value, 3) for stage, value in seconds.items()}
        | {"total": round(sum(seconds.values()), 3)},
        peak_memory_mb=peak_memory_mb(),
        scores=scores,
        provenance=facts,
    )
