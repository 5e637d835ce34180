"""Width of parts, of known areas and borders."""

import math

import numpy as np
import pytest
import trimesh
from solids import labelled

from jointsdf.geometry.part_widths import part_widths
from jointsdf.values import LabelledMesh


def sheet(x: list[float], y: list[float], labels: list[list[int]]) -> LabelledMesh:
    """A sheet of rectangles between the lines of x and y, with a label for each."""
    points = np.array([[a, b, 0.0] for a in x for b in y])
    faces, of_face = [], []
    for i, row in enumerate(labels):
        for j, label in enumerate(row):
            first = i * len(y) + j
            faces += [[first, first + len(y), first + len(y) + 1], [first, first + len(y) + 1, first + 1]]
            of_face += [label, label]
    return LabelledMesh(points, np.array(faces), np.array(of_face))


@pytest.mark.parametrize(("width", "height"), [(1.0, 1.0), (0.1, 3.0), (0.001, 2.0)])
def test_a_rectangle_within_another_part(width, height):
    x, y = [-5, 0, width, 5], [-5, 0, height, 5]
    mesh = sheet(x, y, [[3, 3, 3], [3, 8, 3], [3, 3, 3]])
    expected = 2 * width * height / (width + height)
    assert part_widths(mesh)[1] == pytest.approx(min(expected, math.sqrt(width * height)))
    assert part_widths(mesh)[0] > 1


def test_a_disc_has_nearly_its_diameter():
    cap = trimesh.creation.cylinder(radius=0.3, height=1.0, sections=200)
    labels = np.where(cap.face_normals[:, 2] > 0.5, 7, 2)
    found = part_widths(labelled(cap, labels))
    assert found[1] == pytest.approx(math.sqrt(math.pi) * 0.3, rel=1e-3)  # its area's square: 0.89 diameters


def test_a_piece_of_its_own_has_the_side_of_its_areas_square():
    balls = [trimesh.creation.icosphere(subdivisions=3, radius=radius) for radius in (1.0, 0.01)]
    balls[1].apply_translation((3, 0, 0))
    both = trimesh.util.concatenate(balls)
    labels = np.repeat([4, 5], [len(ball.faces) for ball in balls])
    assert part_widths(labelled(both, labels)) == pytest.approx(
        [2 * math.sqrt(math.pi) * r for r in (1.0, 0.01)], rel=0.01
    )


def test_unlabelled_faces_are_no_part_and_no_border():
    mesh = sheet([0, 1, 2, 3], [0, 1], [[5], [-1], [6]])
    assert part_widths(mesh) == pytest.approx([1.0, 1.0])
    assert len(part_widths(sheet([0, 1], [0, 1], [[-1]]))) == 0
