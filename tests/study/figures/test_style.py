"""Heads look alike in all figures, and points of one value stay visible."""

import numpy as np

from jointsdf.study.figures.style import MARKERS, dodge, head_style
from jointsdf.viewing.palette import HEAD_COLOURS


def test_heads_look_the_same_everywhere_and_differ_in_colour_and_marker() -> None:
    assert head_style("siren", ["siren"]) == head_style("siren", ["none", "relu", "siren", "mine"])
    seven = ["none", "relu", "siren", "hybrid", "deep_skip", "mine", "yours"]
    assert (
        len({head_style(head, seven)["color"] for head in seven})
        == len({head_style(head, seven)["marker"] for head in seven})
        == 7
    )
    assert len(HEAD_COLOURS) == len(MARKERS)


def test_points_of_one_value_are_moved_apart() -> None:
    shifts = dodge(np.array([0.5, 0.5, 0.5, 0.9]), 0.3)
    assert len(set(shifts[:3])) == 3
    assert np.abs(shifts).max() <= 0.3
    assert shifts[3] == 0
