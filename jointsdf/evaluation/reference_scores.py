"""What scores are read against, floors and ceilings: measured once per shape and grid, kept for its other runs."""

import json
from dataclasses import replace
from importlib import metadata
from pathlib import Path

from jointsdf.evaluation.protocol import GroundTruth, Scores
from jointsdf.extraction.extractor import Extraction
from jointsdf.geometry.distance import network_distance
from jointsdf.runs.files import write_atomically
from jointsdf.runs.provenance import code_state
from jointsdf.runs.row import config_hash
from jointsdf.values import LabelledMesh, Normalisation, Shape

CHUNK = 1 << 18  # points asked of the exact distance at once: libigl makes a search tree in every call
LIBRARIES = ("numpy", "scipy", "libigl", "scikit-image")


def reference_scores(
    truth: GroundTruth, shape: Shape, extraction: Extraction, normalisation: Normalisation, cache_dir: Path | None
) -> Scores:
    """Floors and ceilings of every protocol.

    Args:
        truth: How the shape is measured.
        shape: Ground truth.
        extraction: What makes the prediction's mesh.
        normalisation: File frame -> network frame, of the prediction.
        cache_dir: Folder where they are kept from run to run; None measures them anew.
    """
    if cache_dir is None:
        return truth.references(ceiling_mesh(shape, extraction, normalisation))
    facts = {
        "shape": [shape.mesh_sha256, shape.labels_sha256, shape.watertight],
        "measures": [repr(extraction), repr(dict(truth.protocols))],
        "frame": [*normalisation.centre.tolist(), normalisation.scale],
        "code": [code_state().sha256, *map(metadata.version, LIBRARIES)],
    }
    path = cache_dir / f"{config_hash(facts)}.json"
    if path.is_file():
        known: Scores = json.loads(path.read_text(encoding="utf-8"))
        return known
    found = truth.references(ceiling_mesh(shape, extraction, normalisation))
    write_atomically(path, json.dumps(found))
    return found


def ceiling_mesh(shape: Shape, extraction: Extraction, normalisation: Normalisation) -> LabelledMesh:
    """The mesh of the exact distance on the prediction's grid with the closest true labels, file frame."""
    exact = network_distance(shape, normalisation)
    return replace(extraction, chunk=CHUNK).labelled_mesh(
        exact.signed, lambda points: shape.mesh.labels[exact.closest_face(points)], normalisation
    )
