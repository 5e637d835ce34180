"""Distances between the colours of the palette."""

import numpy as np
from skimage.color import rgb2lab

from jointsdf.viewing.palette import COLOURS, UNLABELLED_COLOUR, part_colours


def test_palette_colours_differ_for_normal_and_colour_blind_sight() -> None:
    assert len(COLOURS) >= 20
    colours = np.vstack([COLOURS, UNLABELLED_COLOUR, [255, 255, 255]]) / 255
    linear = np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)
    # Machado, Oliveira, Fernandes 2009, severity 1: normal, deuteranopia, protanopia.
    sights = [
        (np.eye(3), 20),
        ([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]], 9),
        ([[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]], 9),
    ]
    for matrix, least in sights:
        seen = np.clip(linear @ np.array(matrix).T, 0, 1)
        seen = np.where(seen <= 0.0031308, seen * 12.92, 1.055 * seen ** (1 / 2.4) - 0.055)
        lab = rgb2lab(seen[None])[0]
        distances = np.linalg.norm(lab[:, None] - lab[None], axis=2)[np.triu_indices(len(lab), k=1)]
        assert np.delete(distances, -1).min() > least  # the last: unlabelled against white


def test_colours_are_of_the_id_alone_and_repeat_shifted() -> None:
    labels = np.array([3, -1, 0, 3, 27, 51, 75])
    colours = part_colours(labels)
    assert colours.dtype == np.uint8
    np.testing.assert_array_equal(colours[1], UNLABELLED_COLOUR)
    np.testing.assert_array_equal(colours[0], colours[3])
    np.testing.assert_array_equal(colours[:1], part_colours(labels[:1]))
    assert len(np.unique(part_colours(np.arange(5 * len(COLOURS))), axis=0)) == 5 * len(COLOURS)
