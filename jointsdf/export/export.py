"""Export of a fitted field to a file of another kind."""

import logging
from collections.abc import Callable
from pathlib import Path

from jointsdf.errors import InputError, require_one_of
from jointsdf.export.about import describe, load_source
from jointsdf.export.arrays import write_arrays
from jointsdf.export.onnx_file import write_onnx
from jointsdf.export.rounding import round_to_half, rounding_error
from jointsdf.model.field import JointField
from jointsdf.runs.files import replacing
from jointsdf.runs.folder import FIELD
from jointsdf.user_paths import expand_home

log = logging.getLogger(__name__)


def _write_field(field: JointField, path: Path, *, half: bool) -> None:
    field.about = describe(field)
    with replacing(path) as temporary:
        field.save(temporary, half=half)


WRITERS: dict[str, tuple[str, Callable[..., None]]] = {  # kind: ending, writer of field, path
    "onnx": (".onnx", lambda field, path, **_: write_onnx(field, path)),
    "npz": (".npz", lambda field, path, **_: write_arrays(field, path)),
    "field": (".ckpt", _write_field),
}


def export_field(
    source: JointField | str | Path, to: str, *, half: bool = False, out: str | Path | None = None
) -> Path:
    """Write a fitted field as an ONNX model, as numpy arrays, or as a field file again.

    Args:
        source: A run folder, a `field.ckpt`, or a field.
        to: `onnx`, `npz` or `field`.
        half: Whether to round the large matrices to float16; the error that this makes is measured and logged.
        out: The file to write, whole or not at all; None: `field.<ending>` in the run folder, with `half`
            `field_half.<ending>`.

    Returns:
        The file.

    Raises:
        InputError: There is no field at the source, it cannot be read, `to` is unknown, or the package onnx is missing.
        OSError: The file cannot be written.
    """
    require_one_of("--to", to, WRITERS)
    ending, write = WRITERS[to]
    folder = None if isinstance(source, JointField) else Path(expand_home(str(source)))
    path = _target(folder, out, ("field_half" if half else "field") + ending)
    field = source if isinstance(source, JointField) else load_source(Path(expand_home(str(source))))
    exported = round_to_half(field) if half else field
    write(exported, path, half=half)
    if half:
        log.info(rounding_error(field, exported))
    log.info("%s: %.2f MB", path, path.stat().st_size / 1e6)
    return path


def _target(source: Path | None, out: str | Path | None, name: str) -> Path:
    """The file to write, which is not the one that is read.

    Raises:
        InputError: None is named, or the field's own file, or a folder.
    """
    if out is None:
        if source is None:
            raise InputError("out=: name the file to write; a field alone has no folder")
        path = (source if source.is_dir() else source.parent) / name
    else:
        path = Path(expand_home(str(out)))
    if path.is_dir():
        raise InputError(f"{path}: a folder; name the file to write, e.g. {path / name}")
    read = None if source is None else source / FIELD if source.is_dir() else source
    if read is not None and path.resolve() == read.resolve():
        raise InputError(f"{path}: the field itself; name another file to write, or round it to half precision")
    return path
