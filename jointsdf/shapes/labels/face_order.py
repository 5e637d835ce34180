"""The record beside a file of labels that says which mesh's faces they follow, in which order."""

import hashlib
import json
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from jointsdf.runs.stored_json import read_json
from jointsdf.shapes.labels.face_matching import TOLERANCE, in_box

FORMAT = "jointsdf labels"
SAMPLES = 512  # faces of the fingerprint at most: of larger meshes, evenly spaced ones


def order_record(mesh: str, labels: str, content: bytes, corners: Float[ndarray, "f 3 3"]) -> str:
    """The content of a record: a fingerprint of the faces' order, which holds for the same faces in any format.

    Args:
        mesh: Name of the mesh file.
        labels: Name of the file of labels beside it.
        content: Of that file.
        corners: Of the mesh's faces.
    """
    record = {
        "format": FORMAT,
        "labels": labels,
        "sha256": hashlib.sha256(content).hexdigest(),
        "mesh": mesh,
        "faces": len(corners),
        "centroids": sample_centroids(corners).round(6).tolist(),  # middle of the box 0, its longest side 1
    }
    return json.dumps(record) + "\n"


def find_other_mesh(labels: Path, corners: Float[ndarray, "f 3 3"]) -> str | None:
    """Find the mesh file that a file of labels belongs to, where that has other faces or another order than ours.

    Args:
        labels: File of labels; its record has the same name with the ending `.json`.
        corners: Of our faces.

    Returns:
        Name of the other mesh file. None where the labels fit, or have no record, or are not those of the record.
    """
    try:
        record = read_json(labels.with_suffix(".json"))
        if record["format"] != FORMAT or record["labels"] != labels.name:
            return None
        if record["sha256"] != hashlib.sha256(labels.read_bytes()).hexdigest():
            return None
        mesh, count = str(record["mesh"]), int(record["faces"])
        known = np.array(record["centroids"], dtype=np.float64).reshape(-1, 3)
    except (OSError, ValueError, TypeError, KeyError):
        return None  # no record of ours
    ours = sample_centroids(corners)
    fits = count == len(corners) and known.shape == ours.shape and bool((np.abs(known - ours) <= TOLERANCE).all())
    return None if fits else mesh


def sample_centroids(corners: Float[ndarray, "f 3 3"]) -> Float[ndarray, "s 3"]:
    """Centroids of up to 512 evenly spaced faces, where the middle of the box is the origin and its longest side 1."""
    if len(corners) == 0:
        return np.zeros((0, 3))
    index = np.linspace(0, len(corners) - 1, min(SAMPLES, len(corners))).astype(np.int64)
    centroids: Float[ndarray, "s 3"] = in_box(corners)[index].mean(axis=1)
    return centroids
