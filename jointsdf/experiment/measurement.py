"""Mesh and scores of a fitted field, in a run or again from a finished run's folder."""

import logging
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from jaxtyping import Float
from numpy import ndarray
from omegaconf import OmegaConf

from jointsdf.evaluation.field_scores import field_scores
from jointsdf.evaluation.held_out import held_out_scores
from jointsdf.evaluation.protocol import GroundTruth, Protocol, Scores
from jointsdf.evaluation.reference_scores import reference_scores
from jointsdf.experiment import build
from jointsdf.experiment.process import process_settings
from jointsdf.experiment.settings import settings_errors
from jointsdf.extraction.extractor import Extraction
from jointsdf.extraction.resolution import refine_until_stable
from jointsdf.model.field import JointField
from jointsdf.phases import phase, tell
from jointsdf.runs import folder as run_folder
from jointsdf.runs.records import HOLDOUT
from jointsdf.runs.row import ROW_FILE, ResultRow
from jointsdf.runs.seals import changed_files
from jointsdf.shapes.stored import stored_truth
from jointsdf.threads import large_pieces
from jointsdf.training.matrix_products import use_matmul
from jointsdf.values import LabelledMesh, Subject

log = logging.getLogger(__name__)

EXTRACTING, MEASURING = "the field's surface and its part labels", "distances and labels against the truth"


def extract(field: JointField, measures: build.Measures, *, refine: bool) -> tuple[build.Measures, LabelledMesh]:
    """Extract the field's mesh.

    Args:
        field: The fitted field.
        measures: Extraction with its initial grid, and protocols.
        refine: Whether to refine the grid until the topology is stable.

    Returns:
        The measures with the grid that was used, and the mesh in the file frame.
    """
    evaluated = 0

    def sdf(points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        nonlocal evaluated
        evaluated += len(points)
        tell(facts=f"{evaluated / 1e6:.1f} million points evaluated")
        return field.network_sdf(points)

    extraction = measures.extraction
    extraction, surface = refine_until_stable(extraction, sdf) if refine else (extraction, extraction.surface(sdf))
    mesh = extraction.label_faces(surface, field.network_part, field.normalisation, field.network_differential)
    return replace(measures, extraction=extraction), mesh


def measure(
    measures: build.Measures, shape: Subject, mesh: LabelledMesh, field: JointField, cache_dir: Path | None
) -> Scores:
    """Score mesh and field by every metric of every protocol, reference scores included.

    A point cloud is scored by its truth; one without, by its held-out points alone.

    Args:
        measures: Protocols, and the extraction whose grid bounds the reference scores.
        shape: Mesh or point cloud.
        mesh: Extracted mesh, file frame.
        field: The fitted field.
        cache_dir: Folder in which reference scores are cached; None for no cache.
    """
    if shape.truth is None:
        return {HOLDOUT: held_out_scores(shape, mesh)}
    truth = GroundTruth(shape.truth.mesh, measures.protocols)
    tell(0, 3, "reference scores")
    references = reference_scores(truth, shape.truth, measures.extraction, field.normalisation, cache_dir)
    tell(1, facts="distances away from the surface")
    of_field = field_scores(measures.protocols, shape.truth, field)
    tell(2, facts="scores")
    return {name: scores | of_field[name] | references[name] for name, scores in truth.scores(mesh).items()}


@large_pieces()
def measure_again(folder: Path, trust: Collection[str] = ()) -> tuple[ResultRow, Scores]:
    """Extract and measure a finished run again from its field.

    Args:
        folder: The run folder, whose config decides extraction and protocols.
        trust: Modules whose classes the config may name, besides those of `runs/trusted_targets.py`.

    Returns:
        The stored row, and the scores measured now.

    Raises:
        InputError: The folder holds no finished run, its config names a class that is not trusted, or its ground truth
            is no longer there.
    """
    with phase("load", str(folder)):
        settings, shape = stored_truth(folder, trust)
        row = run_folder.read_result(folder)
    field = JointField.load(folder / run_folder.FIELD)
    for name in changed_files(folder / ROW_FILE):
        log.warning("%s: changed since the run ended: its checksum is that of another file", folder / name)
    measures = _stored_measures(folder / run_folder.CONFIG, settings, run_folder.grid_of(folder, row))
    with process_settings():
        use_matmul(str(row.provenance.get("matmul", "default")))  # the last bits of the field depend on it
        with phase("extract", EXTRACTING):
            _, mesh = extract(field, measures, refine=False)
        with phase("measure", MEASURING):
            return row, measure(measures, shape, mesh, field, None)


def _stored_measures(path: Path, settings: Mapping[str, Any], resolution: int) -> build.Measures:
    """Make extraction and protocols of a stored config, whose classes are trusted."""
    built = {name: settings[name] for name in ("extraction", "evaluation")}  # and no text that a user typed
    with settings_errors(f"{path} is damaged"):
        if not isinstance(built["extraction"], dict) or not isinstance(built["evaluation"], dict):
            raise ValueError("extraction or evaluation is no mapping")
        measures = build.measures(OmegaConf.create(built), resolution)
        if not isinstance(measures.extraction, Extraction) or not _all_measure(measures.protocols):
            raise ValueError("extraction or evaluation makes another thing")
    return measures


def _all_measure(protocols: Any) -> bool:
    """True for protocols by name, all of whose metrics can be called."""
    return isinstance(protocols, Mapping) and all(
        isinstance(protocol, Protocol)
        and all(isinstance(group, Mapping) for group in (protocol.metrics, protocol.field))
        and all(map(callable, (*protocol.metrics.values(), *protocol.field.values())))
        for protocol in protocols.values()
    )
