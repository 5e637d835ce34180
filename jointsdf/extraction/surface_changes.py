"""What is wrong with a changed surface: parts beyond a bound from what they were, faces that are no sound surface."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int
from numpy import ndarray

from jointsdf.geometry.distance import ClosestPoint
from jointsdf.geometry.face_graph import face_graph
from jointsdf.geometry.hausdorff import faces_beyond
from jointsdf.geometry.piercings import find_piercings
from jointsdf.values import LabelledMesh

LOW = 1e-8  # height of a face that counts as none, of the longest side
FOLDED = np.radians(170.0)  # between the normals of two faces at an edge


@dataclass(frozen=True)
class Checked:
    """A changed surface, and what is wrong with it.

    Attributes:
        merged: The changed surface, of the vertices of the surface it was.
        lost: Marks faces of the surface it was that are beyond the bound of the same part of it.
        wrong: Marks its faces that are beyond the bound of the same part of what it was, or unsound.
    """

    merged: LabelledMesh
    lost: Bool[ndarray, " f"]
    wrong: Bool[ndarray, " g"]


def check(mesh: LabelledMesh, merged: LabelledMesh, allowed: float, last: Checked) -> Checked:
    """Find what is wrong with a changed surface.

    What an earlier check has certified is not asked again: new faces that were there then, and faces of the surface it
    was from which no merged face has vanished since within the bound.

    Args:
        mesh: The surface it was.
        merged: The changed surface, of the same vertices.
        allowed: Largest distance of each surface from the other, mesh units.
        last: An earlier check of the same surface.
    """
    new = faces_lacking(merged, mesh)
    right = LabelledMesh(mesh.vertices, last.merged.faces[~last.wrong], last.merged.labels[~last.wrong])
    asked = new & faces_lacking(merged, right)
    gone = faces_lacking(mesh, merged)
    doubtful = gone & (last.lost | _near(mesh, last.merged, faces_lacking(last.merged, merged), allowed))
    lost, wrong = np.zeros(len(mesh.faces), dtype=bool), unsound_faces(merged, new)
    for label in np.unique(mesh.labels):
        before, after = mesh.labels == label, merged.labels == label
        if not after.any():
            lost |= before
            continue
        for surface, other, own, chosen, result in (
            (mesh, merged, after, before & doubtful, lost),
            (merged, mesh, before, after & asked, wrong),
        ):
            if chosen.any():
                part = LabelledMesh(other.vertices, other.faces[own], other.labels[own])
                result[chosen] |= faces_beyond(surface.vertices, surface.faces[chosen], ClosestPoint(part), allowed)
    return Checked(merged, lost, wrong)


def unsound_faces(mesh: LabelledMesh, asked: Bool[ndarray, " f"]) -> Bool[ndarray, " f"]:
    """Of the asked faces, those without height, folded back over a neighbour, or passing through another face."""
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    sides = np.roll(corners, -1, axis=1) - corners
    doubled = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    size = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    low = doubled <= LOW * size * np.linalg.norm(sides, axis=2).max(axis=1)
    solid = np.flatnonzero(~low)
    unsound = low & asked
    if not len(solid):
        return unsound
    sound = LabelledMesh(mesh.vertices.astype(np.float64), mesh.faces[solid].astype(np.int64), mesh.labels[solid])
    graph, found = face_graph(sound), find_piercings(sound.vertices, sound.faces)
    folded = graph.pairs[np.abs(graph.angles) > FOLDED]
    for pair in (folded, np.stack([found.face, found.pierced], axis=1)):
        unsound[solid[pair]] = True
    return unsound & asked


def faces_lacking(mesh: LabelledMesh, other: LabelledMesh) -> Bool[ndarray, " f"]:
    """Faces that another mesh of the same vertices has not, or with another label."""
    rows = np.concatenate([_turned(mesh), _turned(other)])
    number = np.unique(rows, axis=0, return_inverse=True)[1].reshape(-1)
    return np.asarray(~np.isin(number[: len(mesh.faces)], number[len(mesh.faces) :]))


def _turned(mesh: LabelledMesh) -> Int[ndarray, "f 4"]:
    """Faces from their lowest vertex on, and their labels."""
    turn = (mesh.faces.argmin(axis=1)[:, None] + np.arange(3)) % 3
    return np.column_stack([np.take_along_axis(mesh.faces, turn, 1), mesh.labels])


def _near(
    mesh: LabelledMesh, merged: LabelledMesh, vanished: Bool[ndarray, " g"], allowed: float
) -> Bool[ndarray, " f"]:
    """Faces of the surface that may have a point within the bound of a vanished face."""
    if not vanished.any():
        return np.zeros(len(mesh.faces), dtype=bool)
    corners = mesh.vertices[mesh.faces]
    centres = corners.mean(axis=1)
    reach = np.linalg.norm(corners - centres[:, None], axis=2).max(axis=1)
    closest = ClosestPoint(LabelledMesh(merged.vertices, merged.faces[vanished], merged.labels[vanished]))
    return np.asarray(closest.query(centres)[0] <= allowed + reach)
