"""Booleans of primitives, and the parts of their faces."""

import numpy as np
from solids import DISC, as_trimesh

from jointsdf.shapes.builtin.construction import Construction, box, rod


def test_every_face_keeps_the_primitive_it_came_from() -> None:
    part = Construction()
    part.add("block", box((1, 2, 3), (11, 12, 8)))
    part.cut("hole", rod((6, 7, 0), 10, 2.0))
    part.add("boss", rod((3, 4, 7), 4, 1.0))
    mesh = part.mesh()
    centres = mesh.vertices[mesh.faces].mean(axis=1)
    on_hole = np.hypot(centres[:, 0] - 6, centres[:, 1] - 7) < 2.0 - 1e-5
    on_boss = (np.hypot(centres[:, 0] - 3, centres[:, 1] - 4) < 1.0) & (centres[:, 2] > 8 + 1e-9)
    np.testing.assert_array_equal(mesh.labels, np.where(on_hole, 1, np.where(on_boss, 2, 0)))
    areas = np.bincount(mesh.labels, as_trimesh(mesh).area_faces)
    disc, boss = (DISC * r * r for r in (2.0, 1.0))
    ring = [2 * 96 * r * np.sin(np.pi / 96) for r in (2.0, 1.0)]
    np.testing.assert_allclose(areas, [400 - 2 * disc - boss, 5 * ring[0], 3 * ring[1] + boss], rtol=1e-6)


def test_numbered_solids_are_parts_of_their_own() -> None:
    posts = [rod((x, 5, 0), 9, 1.0) for x in (3, 9)]
    for numbered, parts in ((True, 3), (False, 2)):
        part = Construction()
        part.add("block", box((0, 0, 0), (12, 10, 4)))
        part.add_each("post", posts, numbered=numbered)
        assert len(part.mesh().part_ids) == parts
