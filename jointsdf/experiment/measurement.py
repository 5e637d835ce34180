"""Mesh and scores of a fitted field, in a run or again from a finished run's folder."""

from dataclasses import replace
from pathlib import Path

from jaxtyping import Float
from numpy import ndarray
from omegaconf import OmegaConf

from jointsdf.evaluation.field_scores import field_scores
from jointsdf.evaluation.protocol import GroundTruth, Scores
from jointsdf.evaluation.reference_scores import reference_scores
from jointsdf.experiment import build
from jointsdf.experiment.process import process_settings
from jointsdf.experiment.settings import settings_errors
from jointsdf.extraction.resolution import refine_until_stable
from jointsdf.model.field import JointField
from jointsdf.phases import phase, tell
from jointsdf.runs import folder as run_folder
from jointsdf.runs.row import ResultRow
from jointsdf.shapes.stored import stored_truth
from jointsdf.threads import large_pieces
from jointsdf.training.matrix_products import use_matmul
from jointsdf.values import LabelledMesh, Shape

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
    mesh = extraction.label_faces(surface, field.network_part, field.normalisation)
    return replace(measures, extraction=extraction), mesh


def measure(
    measures: build.Measures, shape: Shape, mesh: LabelledMesh, field: JointField, cache_dir: Path | None
) -> Scores:
    """Score mesh and field by every metric of every protocol, reference scores included.

    Args:
        measures: Protocols, and the extraction whose grid bounds the reference scores.
        shape: Ground truth.
        mesh: Extracted mesh, file frame.
        field: The fitted field.
        cache_dir: Folder in which reference scores are cached; None for no cache.
    """
    truth = GroundTruth(shape.mesh, measures.protocols)
    tell(0, 3, "reference scores")
    references = reference_scores(truth, shape, measures.extraction, field.normalisation, cache_dir)
    tell(1, facts="distances away from the surface")
    of_field = field_scores(measures.protocols, shape, field)
    tell(2, facts="scores")
    return {name: scores | of_field[name] | references[name] for name, scores in truth.scores(mesh).items()}


@large_pieces()
def measure_again(folder: Path) -> tuple[ResultRow, Scores]:
    """Extract and measure a finished run again from its field.

    Args:
        folder: The run folder.

    Returns:
        The stored row, and the scores measured now.

    Raises:
        InputError: The folder holds no finished run, or its ground truth is no longer there.
    """
    with phase("load", str(folder)):
        settings, shape = stored_truth(folder)
        cfg, row = OmegaConf.create(settings), run_folder.read_result(folder)
    field = JointField.load(folder / run_folder.FIELD)
    resolution = row.provenance["resolution"]
    assert isinstance(resolution, int), "a row without its grid"
    with settings_errors(f"{folder / run_folder.CONFIG} is damaged"):
        measures = build.measures(cfg, resolution)
    with process_settings():
        use_matmul(str(row.provenance.get("matmul", "default")))  # the last bits of the field depend on it
        with phase("extract", EXTRACTING):
            _, mesh = extract(field, measures, refine=False)
        with phase("measure", MEASURING):
            return row, measure(measures, shape, mesh, field, None)
