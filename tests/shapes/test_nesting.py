"""Depth of bodies within others, against balls whose nesting their radii and middles say."""

import numpy as np
import trimesh
from damaged_meshes import box, joined

from jointsdf.shapes.nesting import nesting_depth


def depths(*bodies: trimesh.Trimesh) -> list[int]:
    vertices, faces = joined(*bodies)
    number = np.repeat(np.arange(len(bodies)), [len(body.faces) for body in bodies])
    return nesting_depth(vertices, faces, number, np.array([body.volume for body in bodies])).tolist()


def test_random_balls_that_do_not_touch_are_in_those_that_hold_them() -> None:
    generator = np.random.default_rng(3)
    middles, radii = np.zeros((1, 3)), np.array([0.9])
    for radius in np.repeat([0.4, 0.2, 0.1, 0.05], 60):
        middle = generator.uniform(-1, 1, 3)
        apart = np.linalg.norm(middles - middle, axis=1)
        if ((apart > 1.05 * (radii + radius)) | (apart < 0.95 * radii - radius)).all():
            middles, radii = np.concatenate([middles, [middle]]), np.append(radii, radius)
    order = generator.permutation(len(radii))
    middles, radii = middles[order], radii[order]
    balls = [
        trimesh.creation.icosphere(3, radius).apply_translation(at) for radius, at in zip(radii, middles, strict=True)
    ]
    holds = np.linalg.norm(middles[:, None] - middles, axis=2) < radii - radii[:, None]
    assert set(holds.sum(axis=1)) >= {0, 1, 2}
    assert depths(*balls) == holds.sum(axis=1).tolist()


def test_a_box_in_anothers_box_but_outside_of_it_is_not_nested() -> None:
    ring = trimesh.creation.annulus(1.0, 2.0, 1.0)
    assert depths(ring, box(0.5)) == [0, 0]


def test_bodies_that_pass_through_each_other_are_not_nested() -> None:
    ball = trimesh.creation.icosphere(4)
    assert depths(ball, box(1.3)) == [0, 0], "only the corners stick out"
    assert depths(ball, box(1.1)) == [0, 1]


def test_a_body_that_is_there_twice_is_no_cavity_of_itself() -> None:
    assert depths(box(1.0), box(1.0).subdivide()) == [0, 0]
    assert depths(box(2.0), box(1.0), box(1.0).subdivide()) == [0, 1, 1]
    assert depths(box(1.0), box(0.9999)) == [0, 1], "a thin wall"


def test_a_body_in_an_open_one_is_nested_in_it() -> None:
    lid_off = trimesh.creation.icosphere(3)
    lid_off.update_faces(np.arange(len(lid_off.faces)) > 5)
    vertices, faces = joined(lid_off, box(0.5))
    number = np.where(np.arange(len(faces)) < len(lid_off.faces), -1, 0)
    assert nesting_depth(vertices, faces, number, np.array([0.125])).tolist() == [1]
