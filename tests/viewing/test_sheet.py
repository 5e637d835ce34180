"""The contact sheet shows every shape, in its place."""

import sys

import numpy as np
from PIL import Image

from jointsdf import shapes
from jointsdf.viewing import sheet
from jointsdf.viewing.render import render


def test_a_sheet_holds_each_thumbnail_in_its_place() -> None:
    shown = [shapes.load(f"part_{k:02d}", abc_root="nowhere") for k in range(1, 13)]
    picture = sheet.contact_sheet(shown)
    assert picture.shape == (2 * (sheet.HEIGHT + sheet.CAPTION), sheet.COLUMNS * sheet.WIDTH, 3)
    second_row = picture[sheet.HEIGHT + 2 * sheet.CAPTION :, sheet.WIDTH : 2 * sheet.WIDTH]
    np.testing.assert_array_equal(second_row, render(shown[11].mesh, width=sheet.WIDTH, height=sheet.HEIGHT))
    assert (picture[-sheet.HEIGHT :, 2 * sheet.WIDTH :] == 255).all()


def test_the_command_writes_a_png(tmp_path, monkeypatch) -> None:
    monkeypatch.setitem(sheet.CATALOGUES, "part", lambda: ["part_01"])
    monkeypatch.setattr(sys, "argv", ["sheet", "part", str(tmp_path / "sheet.png")])
    sheet.main()
    with Image.open(tmp_path / "sheet.png") as picture:
        assert picture.size == (sheet.COLUMNS * sheet.WIDTH, sheet.HEIGHT + sheet.CAPTION)
