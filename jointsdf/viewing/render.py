"""Rendering of part-labelled meshes: part colours, soft light, lines at part borders, creases and outlines."""

from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray
from PIL import Image, ImageDraw, ImageFont
from scipy.ndimage import maximum_filter

from jointsdf.runs.files import replacing
from jointsdf.values import LabelledMesh
from jointsdf.viewing.palette import part_colours
from jointsdf.viewing.raycast import Hits, cast_rays, fit_camera, fit_camera_to_points

INK = np.array([28.0, 30.0, 36.0])
LIGHTS = (((-0.45, 0.65, -0.62), 0.58), ((0.75, 0.1, -0.65), 0.22))  # towards the light (right, up, away), strength
AMBIENT = 0.42
LEAST_FONT = 10.0  # pixels
OUTLINE, BORDER, CREASE = 1.0, 0.85, 0.42  # how dark each kind of line is
CREASE_COSINE = np.cos(np.radians(30.0))
JUMP = 3.0  # step in depth between neighbours from which there is an outline, pixels of the finished picture
BRIGHTEST = 1.08  # largest factor of light on a colour
AZIMUTH, ELEVATION = -52.0, 28.0  # of the viewer, degrees
FALLOFF = 1.5  # exponent of half-Lambert shading


def render(
    mesh: LabelledMesh,
    *,
    width: int = 640,
    height: int = 480,
    supersampling: int = 2,
    azimuth: float = AZIMUTH,
    elevation: float = ELEVATION,
    framed: LabelledMesh | Float[ndarray, "n 3"] | None = None,
    colours: UInt8[ndarray, "f 3"] | None = None,
) -> UInt8[ndarray, "h w 3"]:
    """Render a mesh in part colours on white; the word "empty" for a mesh without faces.

    Args:
        mesh: File frame, +z up.
        width: Pixels.
        height: Pixels.
        supersampling: Rays per pixel along each axis.
        azimuth: Of the viewer about +z, from +x, degrees.
        elevation: Of the viewer above the xy plane, degrees, inside (-90, 90).
        framed: The mesh or the points that the picture is fitted to, instead of `mesh`.
        colours: sRGB of each face, instead of its part's.
    """
    if mesh.is_empty:
        return notice("empty", width, height)
    view = (width * supersampling, height * supersampling, azimuth, elevation)
    if isinstance(framed, ndarray):
        camera = fit_camera_to_points(framed, *view)
    else:
        camera = fit_camera(mesh if framed is None or framed.is_empty else framed, *view)
    hits = cast_rays(mesh, camera)
    fine = shade(part_colours(mesh.labels) if colours is None else colours, hits)
    fine += (INK - fine) * _lines(mesh, hits, supersampling)[..., None]
    pixels = fine.reshape(height, supersampling, width, supersampling, 3).mean(axis=(1, 3))
    return np.rint(pixels).astype(np.uint8)


def render_comparison(
    truth: LabelledMesh,
    predicted: LabelledMesh,
    *,
    captions: tuple[str, ...] = ("ground truth", "prediction", "error"),
    width: int = 640,
    height: int = 480,
    supersampling: int = 2,
    azimuth: float = AZIMUTH,
    elevation: float = ELEVATION,
    errors: UInt8[ndarray, "f 3"] | None = None,
) -> UInt8[ndarray, "h w 3"]:
    """Render ground truth and prediction side by side with one camera, fitted to the ground truth.

    Args:
        truth: Left picture, file frame.
        predicted: Right picture, file frame.
        captions: Below each picture.
        width: Pixels of each picture.
        height: Pixels of each picture, without its caption.
        supersampling: Rays per pixel along each axis.
        azimuth: Of the viewer about +z, from +x, degrees.
        elevation: Of the viewer above the xy plane, degrees, inside (-90, 90).
        errors: sRGB of each predicted face, for a third picture; None for no such picture.
    """
    shown = [(truth, None), (predicted, None), *([(predicted, errors)] if errors is not None else [])]
    panels = [
        render(
            mesh,
            width=width,
            height=height,
            supersampling=supersampling,
            azimuth=azimuth,
            elevation=elevation,
            framed=truth,
            colours=colours,
        )
        for mesh, colours in shown
    ]
    strip = max(24, height // 15)
    below = [notice(caption, width, strip) for caption in captions[: len(panels)]]
    return np.concatenate([np.concatenate(panels, axis=1), np.concatenate(below, axis=1)], axis=0)


def write_png(path: Path, image: UInt8[ndarray, "h w 3"], colours: int | None = None) -> None:
    """Write a picture atomically.

    Args:
        path: Of the PNG file.
        image: sRGB.
        colours: Size of a palette that the picture is rounded to, at most 256; None keeps every colour.
    """
    picture = Image.fromarray(image)
    if colours is not None:
        picture = picture.quantize(colours, dither=Image.Dither.NONE)
    with replacing(path) as temporary:
        picture.save(temporary, format="png", optimize=colours is not None)


def shade(colours: UInt8[ndarray, "f 3"], hits: Hits) -> Float[ndarray, "h w 3"]:
    """Half-Lambert shading (Mitchell et al., "Shading in Valve's Source engine", 2006) under `LIGHTS`."""
    normals = hits.normals[hits.seen]
    light = np.full(len(normals), AMBIENT)
    for direction, strength in LIGHTS:
        towards = normals @ (np.array(direction) / np.linalg.norm(direction))
        light += strength * (0.5 + 0.5 * towards) ** FALLOFF
    picture = np.full((*hits.faces.shape, 3), 255.0)
    picture[hits.seen] = np.minimum(colours[hits.faces[hits.seen]] * np.minimum(light, BRIGHTEST)[:, None], 255.0)
    return picture


def _lines(mesh: LabelledMesh, hits: Hits, width: int) -> Float[ndarray, "h w"]:
    """Ink of each pixel, 0..1, by edge detection: differences of part, normal and depth between neighbouring pixels.

    Args:
        mesh: The mesh of the hits.
        hits: First hit of each pixel.
        width: Pixels by which lines grow from the two pixels that they separate.
    """
    ink = np.zeros(hits.faces.shape)
    labels = mesh.labels[hits.faces]
    for axis, slope in ((0, hits.slopes[..., 1]), (1, hits.slopes[..., 0])):
        seen, part, normal, depth, rise = (
            np.swapaxes(values, 0, axis) for values in (hits.seen, labels, hits.normals, hits.depths, slope)
        )
        both, step = seen[:-1] & seen[1:], np.diff(depth, axis=0)
        jump = np.minimum(np.abs(step - rise[:-1]), np.abs(step - rise[1:])) > JUMP * width
        strength = np.where(both & (np.sum(normal[:-1] * normal[1:], axis=2) < CREASE_COSINE), CREASE, 0.0)
        strength[both & (part[:-1] != part[1:])] = BORDER
        strength[(seen[:-1] != seen[1:]) | (both & jump)] = OUTLINE
        lines = np.swapaxes(ink, 0, axis)
        for side in (lines[:-1], lines[1:]):
            np.maximum(side, strength, out=side)
    grown: ndarray = maximum_filter(ink, size=width)
    return grown


def notice(text: str, width: int, height: int) -> UInt8[ndarray, "h w 3"]:
    """Text in the middle of a white picture."""
    image = Image.new("RGB", (width, height), "white")
    size = min(height * 0.75, max(width / 20, LEAST_FONT))
    font = ImageFont.load_default(size)
    if (length := font.getlength(text)) > 0.96 * width:
        font = ImageFont.load_default(size * 0.96 * width / length)
    ink = tuple(INK.astype(int))
    ImageDraw.Draw(image).text((width / 2, height / 2), text, fill=ink, font=font, anchor="mm")
    return np.array(image)
