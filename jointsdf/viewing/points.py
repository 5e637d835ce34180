"""Pictures of what was fitted beside the fit: a ground truth, or the points of a cloud."""

from collections.abc import Callable
from functools import partial

import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray

from jointsdf.values import LabelledMesh, Scan, Subject
from jointsdf.viewing.palette import part_colours
from jointsdf.viewing.raycast import Camera, fit_camera_to_points
from jointsdf.viewing.render import AZIMUTH, ELEVATION, notice, render, render_comparison

MOST = 200_000  # points of a picture
DOT = 0.5  # half side of a point, of the mean distance between pixels of two points
MOST_DOT = 4  # pixels
DARKEST = 0.55  # factor of light on the farthest points


def draw_points(scan: Scan, camera: Camera) -> UInt8[ndarray, "h w 3"]:
    """Draw points as squares in the colours of their parts (without labels in their own), the nearest over the others.

    Args:
        scan: The points.
        camera: In the file frame.
    """
    some = slice(None, None, -(-len(scan.points) // MOST))
    own = scan.colours is not None and not len(scan.part_ids)
    colours = scan.colours[some] if own and scan.colours is not None else part_colours(scan.labels[some])
    right, up, depth = camera.project(scan.points[some]).T
    light = DARKEST + (1 - DARKEST) * (depth.max() - depth) / max(float(np.ptp(depth)), np.finfo(float).tiny)
    shaded: Float[ndarray, "n 3"] = colours * light[:, None]
    order = np.argsort(-depth, kind="stable")  # what is drawn last is seen
    column, row = np.floor(right + camera.width / 2).astype(int), np.floor(camera.height / 2 - up).astype(int)
    picture = np.full((camera.height, camera.width, 3), 255, dtype=np.uint8)
    dot = min(MOST_DOT, max(1, round(DOT * np.sqrt(camera.width * camera.height / len(order)))))
    steps = np.stack(np.meshgrid(*[np.arange(-dot, dot + 1)] * 2), axis=-1).reshape(-1, 2)
    rows = np.clip(row[order, None] + steps[:, 0], 0, camera.height - 1)
    columns = np.clip(column[order, None] + steps[:, 1], 0, camera.width - 1)
    picture[rows.ravel(), columns.ravel()] = np.repeat(np.rint(shaded[order]).astype(np.uint8), len(steps), axis=0)
    return picture


def render_beside_points(
    scan: Scan,
    mesh: LabelledMesh,
    *,
    captions: tuple[str, str] = ("points", "fit"),
    width: int = 640,
    height: int = 480,
) -> UInt8[ndarray, "h w 3"]:
    """Draw the points and the mesh fitted to them side by side, with one camera.

    Args:
        scan: The points.
        mesh: The fit, file frame.
        captions: Below the left and the right picture.
        width: Pixels of each picture.
        height: Pixels of each picture, without its caption.
    """
    camera = fit_camera_to_points(scan.points, width, height, AZIMUTH, ELEVATION)
    pictures = draw_points(scan, camera), render(mesh, width=width, height=height, framed=scan.points)
    strip = max(24, height // 15)
    below = [notice(caption, width, strip) for caption in captions]
    return np.concatenate([np.concatenate(pictures, axis=1), np.concatenate(below, axis=1)], axis=0)


def beside_fit(shape: Subject) -> Callable[..., UInt8[ndarray, "h w 3"]]:
    """The function that draws a fit beside its ground truth, or beside the points where there is none.

    Args:
        shape: Mesh or point cloud.

    Returns:
        Fit, `captions`, `width`, `height` -> picture.
    """
    if shape.truth is not None:
        return partial(render_comparison, shape.truth.mesh)
    return partial(render_beside_points, shape)


def what_is_given(shape: Subject) -> str:
    """Words for the left picture."""
    return "points" if shape.truth is None else "ground truth"
