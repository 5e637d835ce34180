"""Command line `python -m jointsdf.shapes.abc prepare`: prepare the catalogue's ABC shapes."""

import argparse
import errno
import importlib.util
import logging
import os
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from jointsdf.abc_dataset import archive, chunks, download, members, prepare
from jointsdf.abc_dataset.progress import bars
from jointsdf.cli_logging import program_name
from jointsdf.errors import InputError
from jointsdf.shapes import abc

FORMATS = ("step", "obj")

log = logging.getLogger("jointsdf.abc_dataset")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code, 2 for what the user can mend."""
    options = _parser().parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    logging.getLogger("trimesh").setLevel(logging.ERROR)
    try:
        return _prepare(options)
    except KeyboardInterrupt:
        log.warning("stopped; the same command goes on from here")
        return 130
    except InputError as error:
        log.error("error: %s", " ".join(str(error).split()))
    except OSError as error:
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        advice = "the disk is full: free some space" if full else "give a --root that can be written"
        log.error("error: %s; %s, and run it again", " ".join(str(error).split()), advice)
    return 2


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program_name("jointsdf.shapes.abc"), description="The ABC shapes of the catalogue."
    )
    commands = parser.add_subparsers(dest="command", required=True)
    command = commands.add_parser(
        "prepare",
        help="write ROOT/abc_0001/mesh.ply, patches.npy and so on",
        description="Prepare the catalogue's shapes from files or archives of the ABC dataset, or download these.",
    )
    root = os.environ.get("JOINTSDF_ABC") or "data/abc"
    command.add_argument("--root", type=Path, default=Path(root), help=f"folder of the shapes ({root})")
    command.add_argument(
        "--from",
        dest="sources",
        type=Path,
        action="append",
        default=[],
        metavar="PATH",
        help="a folder of ABC files (obj and features yml, step, stl) or of abc_NNNN_*_v00.7z archives, or one "
        "archive; nothing is downloaded. May be repeated",
    )
    command.add_argument("--shapes", nargs="+", default=[], metavar="NAME", help="only these, e.g. abc_0001 abc_0050")
    command.add_argument(
        "--format",
        choices=FORMATS,
        help="what to download: step (1.6 GB, the default) or obj, with its features (12.5 GB); with --from, what to "
        "take where a model is there in both (obj)",
    )
    command.add_argument(
        "--urls", type=Path, metavar="FILE", help="other addresses: a table as abc_chunks.csv, or ABC's list"
    )
    command.add_argument("--yes", action="store_true", help="download without asking")
    return parser


def _prepare(options: argparse.Namespace) -> int:
    """Download what is missing, prepare the shapes, and log the outcome of each."""
    root, sources = options.root.expanduser(), [path.expanduser() for path in options.sources]
    members.check_sources(sources)
    unknown = [name for name in options.shapes if name not in abc.catalogue()]
    if unknown:
        raise InputError(f"unknown shape {unknown[0]!r}: the catalogue has abc_0001 .. abc_{len(abc.catalogue()):04d}")
    names = list(dict.fromkeys(options.shapes)) or list(abc.catalogue())
    preferred = options.format or ("obj" if sources else "step")
    if not sources:
        _download(options, names, root, preferred)
    counts: Counter[str] = Counter()
    for outcome in prepare.prepare(names, root, sources, preferred=preferred, progress=bars):
        counts[outcome.status] += 1
        level = logging.ERROR if outcome.status == prepare.FAILED else logging.INFO
        log.log(level, "%s  %s: %s", outcome.name, outcome.status, outcome.detail)
    log.info("%s, in %s", ", ".join(f"{count} {status}" for status, count in counts.items()), root)
    if counts[prepare.DONE] and not counts[prepare.FAILED] and prepare.source_folder(root).is_dir():
        log.info("%s is not needed for them any more and may be deleted", prepare.source_folder(root))
    if counts[prepare.DONE] + counts[prepare.THERE] == 0:
        places = ", ".join(map(str, sources)) or str(prepare.source_folder(root))
        raise InputError(f"no shape could be prepared from {places}: give a folder of ABC files or its 7z archives")
    return 2 if counts[prepare.FAILED] else 0


def _download(options: argparse.Namespace, names: Sequence[str], root: Path, preferred: str) -> None:
    """Download the archives of the shapes that are not prepared, once the user has agreed."""
    folder = prepare.source_folder(root)
    kinds = prepare.FORMATS[preferred]
    here = members.index_files([folder])
    lacking = [
        entry
        for entry in (abc.catalogue()[name] for name in names)
        if not prepare.is_prepared(entry.name, root)
        and any(members.find_file(here, entry, kind) is None for kind in kinds)
    ]
    numbers = {chunks.chunk_of(entry.abc_id) for entry in lacking}
    if not options.shapes:
        numbers &= {chunks.MAIN}
    wanted = [
        chunk
        for chunk in chunks.select_chunks(chunks.read_table(options.urls), kinds, numbers)
        if not (folder / chunk.name).is_file()
    ]
    for entry in lacking:
        if chunks.chunk_of(entry.abc_id) not in numbers:
            log.info(
                "%s alone needs chunk %s: --shapes %s gets it", entry.name, chunks.chunk_of(entry.abc_id), entry.name
            )
    if not wanted:
        return
    archive.require_py7zr()
    if preferred == "step" and importlib.util.find_spec("cascadio") is None:
        raise InputError(
            "STEP files need cascadio: pip install 'jointsdf[abc]' (in a checkout '.[abc]'), or --format obj"
        )
    _confirm(wanted, folder, options.yes)
    for chunk in wanted:
        download.fetch(chunk, folder, bars)


def _confirm(wanted: Sequence[chunks.Chunk], folder: Path, is_agreed: bool) -> None:
    """List the downloads, and ask the user."""
    missing = sum(chunk.bytes - min(download.bytes_here(chunk, folder), chunk.bytes) for chunk in wanted)
    for chunk in wanted:
        here = download.bytes_here(chunk, folder)
        present = f" ({format_size(here)} here)" if here else ""
        log.info("%s  %s%s  %s", chunk.name, format_size(chunk.bytes), present, chunk.url)
    terms = "The models belong to their creators (Onshape terms of use)."
    log.info("To download: %s, into %s. %s", format_size(missing), folder, terms)
    if is_agreed:
        return
    if not sys.stdin.isatty():
        raise InputError(f"a download of {format_size(missing)} is to be confirmed, and this is no terminal: add --yes")
    try:
        answer = input("Go on? [y/N] ").strip().lower()
    except EOFError:
        answer = ""
    if answer not in ("y", "yes"):
        raise InputError("nothing is downloaded; --from takes files or archives that are here already")


def format_size(count: int) -> str:
    """A number of bytes in a readable unit.

    >>> format_size(12_500_000_000)
    '12.5 GB'
    """
    unit, name = next(
        ((unit, name) for unit, name in ((1e9, "GB"), (1e6, "MB"), (1e3, "kB")) if count >= unit), (1, "bytes")
    )
    return f"{count / unit:.4g} {name}" if unit == 1 else f"{count / unit:.1f} {name}"
