"""Reference scores (sampling floor, grid ceiling), cached per shape and grid."""

import json
import logging
from dataclasses import replace
from importlib import metadata
from pathlib import Path

from jointsdf.errors import first_line
from jointsdf.evaluation.protocol import GroundTruth, Scores
from jointsdf.extraction.extractor import Extraction
from jointsdf.geometry.distance import network_distance
from jointsdf.runs.files import write_atomically
from jointsdf.runs.provenance import code_state
from jointsdf.runs.row import config_hash
from jointsdf.runs.row_content import read_scores
from jointsdf.runs.stored_json import read_regular
from jointsdf.values import LabelledMesh, Normalisation, Shape

CHUNK = 1 << 18  # points per query of the exact distance: libigl builds a search tree in every call
LIBRARIES = ("numpy", "scipy", "libigl", "scikit-image")

log = logging.getLogger(__name__)


def reference_scores(
    truth: GroundTruth, shape: Shape, extraction: Extraction, normalisation: Normalisation, cache_dir: Path | None
) -> Scores:
    """Floors and ceilings of every protocol, read from the cache where nothing that decides them has changed.

    Args:
        truth: The shape's mesh with the protocols.
        shape: Ground truth.
        extraction: Extraction of the prediction's mesh.
        normalisation: File frame -> network frame, of the prediction.
        cache_dir: Folder of the cache, one JSON file per shape and grid; None computes them anew.

    Returns:
        Protocol -> column -> value.
    """
    if cache_dir is None:
        return truth.references(ceiling_mesh(shape, extraction, normalisation))
    facts = {
        "shape": [shape.mesh_sha256, shape.labels_sha256, shape.watertight, shape.folded],
        "measures": [repr(extraction), repr(dict(truth.protocols))],
        "frame": [*normalisation.centre.tolist(), normalisation.scale],
        "code": [code_state().sha256, *map(metadata.version, LIBRARIES)],
    }
    path = cache_dir / f"{config_hash(facts)}.json"
    if (cached := _read(path)) is not None and cached.keys() == truth.protocols.keys():
        return cached
    found = truth.references(ceiling_mesh(shape, extraction, normalisation))
    write_atomically(path, json.dumps(found))
    return found


def _read(path: Path) -> Scores | None:
    """Scores of an earlier run; None where there are none, or the file is damaged."""
    try:
        return read_scores(json.loads(read_regular(path)))
    except FileNotFoundError:
        return None
    except (ValueError, OSError, RecursionError) as error:
        log.warning("%s: damaged (%s); measured again", path, first_line(error))
        return None


def ceiling_mesh(shape: Shape, extraction: Extraction, normalisation: Normalisation) -> LabelledMesh:
    """Extract the exact distance on the prediction's grid, with the label of the closest true face; file frame."""
    exact = network_distance(shape, normalisation)
    return replace(extraction, chunk=CHUNK).labelled_mesh(
        exact.signed, lambda points: shape.mesh.labels[exact.closest_face(points)], normalisation, exact.one_sided
    )
