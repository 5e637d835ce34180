"""Contact sheet of shapes in part colours: `python -m jointsdf.viewing.sheet abc docs/benchmark.png`."""

import argparse
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import UInt8
from numpy import ndarray
from PIL import Image, ImageDraw, ImageFont

from jointsdf import shapes
from jointsdf.shapes import abc, builtin
from jointsdf.values import Shape
from jointsdf.viewing.render import render, write_png

COLUMNS, WIDTH, HEIGHT, CAPTION = 10, 184, 136, 18
CATALOGUES = {"abc": lambda: list(abc.catalogue()), "part": builtin.part_names}


def contact_sheet(shown: Sequence[Shape]) -> UInt8[ndarray, "h w 3"]:
    """Draw thumbnails of shapes, row by row, each under its name and number of parts."""
    rows = -(-len(shown) // COLUMNS)
    sheet = Image.new("RGB", (WIDTH * COLUMNS, (HEIGHT + CAPTION) * rows), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(12)
    for place, shape in enumerate(shown):
        x, y = place % COLUMNS * WIDTH, place // COLUMNS * (HEIGHT + CAPTION)
        sheet.paste(Image.fromarray(render(shape.mesh, width=WIDTH, height=HEIGHT)), (x, y + CAPTION))
        draw.text((x + 4, y + 2), f"{shape.name}   {len(shape.mesh.part_ids)} parts", fill="black", font=font)
    return np.asarray(sheet)


def main() -> None:
    """Draw a catalogue of shapes with their default labels."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("catalogue", choices=sorted(CATALOGUES))
    parser.add_argument("picture", type=Path, help="PNG to write")
    parser.add_argument("--root", default=os.environ.get("JOINTSDF_ABC", "data/abc"), help="folder of the ABC meshes")
    arguments = parser.parse_args()
    names = CATALOGUES[arguments.catalogue]()
    shown = [shapes.load(name, abc_root=arguments.root, abc_missing="error") for name in names]
    write_png(arguments.picture, contact_sheet(shown))


if __name__ == "__main__":
    main()
