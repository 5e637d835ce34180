"""3D pages and thumbnails of the shapes of a study, heads side by side; those that are up to date stay as they are."""

import hashlib
import logging
import re
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.runs.files import make_folder, write_atomically
from jointsdf.runs.row import ROW_FILE, ResultRow
from jointsdf.threads import large_pieces
from jointsdf.values import LabelledMesh, Subject
from jointsdf.viewing.page.document import library_script
from jointsdf.viewing.page.run_page import write_run_page
from jointsdf.viewing.page.scene import Detail
from jointsdf.viewing.page.stored_runs import load_runs, stored_warnings
from jointsdf.viewing.points import draw_points
from jointsdf.viewing.raycast import fit_camera_to_points
from jointsdf.viewing.render import AZIMUTH, ELEVATION, render, write_png

DETAIL = Detail(faces=8_000, grid=28, truth_grid=24, points=12_000)  # 50 shapes by 5 heads in 60 MB
LIBRARY, SHAPES, PICTURES = "library.js", "shapes", "pictures"
WIDTH, HEIGHT, SHADES = 128, 96, 48  # of a thumbnail: pixels, colours
MOST_NAME = 60  # characters of a shape in the name of its page

log = logging.getLogger(__name__)


class ShapePage(NamedTuple):
    """Files of a shape, as paths from the study's page; None for those that cannot be made.

    Attributes:
        page: Its 3D page.
        truth: Thumbnail of its ground truth.
        fits: Thumbnail of each fit, by its column.
    """

    page: str | None
    truth: str | None
    fits: dict[str, str]


def run_folder(outputs: Path, row: ResultRow) -> Path:
    """Folder of a run's files."""
    return outputs / row.study / row.variant / row.head / row.shape / f"seed{row.seed}"


@large_pieces()
def write_shape_page(
    folder: Path, outputs: Path, shape: str, runs: Mapping[str, ResultRow], trust: Collection[str]
) -> ShapePage:
    """Write 3D page and thumbnails of a shape whose run folders are there.

    Args:
        folder: Of the study's page.
        outputs: Folder of the studies.
        shape: Its name.
        runs: A row by each column of the study's page.
        trust: Modules whose classes the folders' configs may name.
    """
    there = [(column, row) for column, row in runs.items() if (run_folder(outputs, row) / ROW_FILE).is_file()]
    if not there:
        return ShapePage(None, None, {})
    name, folders = file_name(shape), [run_folder(outputs, row) for _, row in there]
    page, mark = folder / SHAPES / f"{name}.html", folder / SHAPES / f"{name}.made"
    pictures = [folder / PICTURES / f"{name}-{place}.png" for place in range(len(there) + 1)]
    made = _digest(folders)
    if not (
        mark.is_file()
        and mark.read_text(encoding="utf-8") == made
        and all(path.is_file() for path in (page, *pictures))
    ):
        try:
            subject, fits = load_runs(folders, trust)
        except InputError as error:
            log.warning("%s: without its 3D page: %s", shape, error)
            return ShapePage(None, None, {})
        warnings = [line for path in folders for line in stored_warnings(path)]
        library, back = f"../{LIBRARY}", "../index.html"
        write_run_page(page, subject, fits, warnings=warnings, detail=DETAIL, shared=library, back=back)
        _write_thumbnails(pictures, subject, [fit.mesh for fit, _ in fits])
        write_atomically(mark, made, durable=False)
    paths = [path.relative_to(folder).as_posix() for path in pictures]
    columns = [column for column, _ in there]
    return ShapePage(page.relative_to(folder).as_posix(), paths[0], dict(zip(columns, paths[1:], strict=True)))


def file_name(shape: str) -> str:
    """Name of a shape's files: letters that any address may hold, and a hash that tells shapes apart.

    >>> file_name("a b#c")
    'a-b-c-c399b5'
    """
    plain = re.sub(r"[^A-Za-z0-9_.-]+", "-", shape)[:MOST_NAME]
    return f"{plain}-{hashlib.sha256(shape.encode()).hexdigest()[:6]}"


def _digest(folders: Sequence[Path]) -> str:
    """Hash of the rows that a page shows and of what makes it."""
    content = hashlib.sha256(library_script().encode() + repr(DETAIL).encode())
    for folder in folders:
        content.update(str(folder).encode() + (folder / ROW_FILE).read_bytes())
    return content.hexdigest()


def _write_thumbnails(paths: Sequence[Path], shape: Subject, meshes: Sequence[LabelledMesh]) -> None:
    """Pictures of what was fitted and of the fits, by one camera."""
    if shape.truth is not None:
        framed: LabelledMesh | ndarray = shape.truth.mesh
        pictures = [render(shape.truth.mesh, width=WIDTH, height=HEIGHT)]
    else:
        framed = shape.points
        pictures = [draw_points(shape, fit_camera_to_points(shape.points, WIDTH, HEIGHT, AZIMUTH, ELEVATION))]
    pictures += [render(mesh, framed=framed, width=WIDTH, height=HEIGHT) for mesh in meshes]
    make_folder(paths[0].parent)
    for path, picture in zip(paths, pictures, strict=True):
        write_png(path, picture, SHADES)
