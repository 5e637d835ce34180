"""`python -m jointsdf.shapes.abc prepare`: the catalogue's ABC shapes by one command."""

import argparse
import errno
import importlib.util
import logging
import os
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from jointsdf import abc_dataset as preparation
from jointsdf.abc_dataset import archive, chunks, download, members
from jointsdf.abc_dataset.progress import bars
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
        prog="python -m jointsdf.shapes.abc", description="The ABC shapes of the catalogue."
    )
    commands = parser.add_subparsers(dest="command", required=True)
    prepare = commands.add_parser(
        "prepare",
        help="write ROOT/abc_0001/mesh.ply, patches.npy and so on",
        description="Prepare the catalogue's shapes from files or archives of the ABC dataset, or download these.",
    )
    root = os.environ.get("JOINTSDF_ABC") or "data/abc"
    prepare.add_argument("--root", type=Path, default=Path(root), help=f"folder of the shapes ({root})")
    prepare.add_argument(
        "--from",
        dest="sources",
        type=Path,
        action="append",
        default=[],
        metavar="PATH",
        help="a folder of ABC files (obj and features yml, step, stl) or of abc_NNNN_*_v00.7z archives, or one "
        "archive; nothing is downloaded. May be repeated",
    )
    prepare.add_argument("--shapes", nargs="+", default=[], metavar="NAME", help="only these, e.g. abc_0001 abc_0050")
    prepare.add_argument(
        "--format",
        choices=FORMATS,
        help="what to download: step (1.6 GB, the default) or obj, with its features (12.5 GB); with --from, what to "
        "take where a model is there in both (obj)",
    )
    prepare.add_argument(
        "--urls", type=Path, metavar="FILE", help="other addresses: a table as abc_chunks.csv, or ABC's list"
    )
    prepare.add_argument("--yes", action="store_true", help="download without asking")
    return parser


def _prepare(options: argparse.Namespace) -> int:
    """Get what is missing, make the shapes, and say of each what became of it."""
    root, sources = options.root.expanduser(), [path.expanduser() for path in options.sources]
    members.check(sources)
    unknown = [name for name in options.shapes if name not in abc.catalogue()]
    if unknown:
        raise InputError(f"unknown shape {unknown[0]!r}: the catalogue has abc_0001 .. abc_{len(abc.catalogue()):04d}")
    names = list(dict.fromkeys(options.shapes)) or list(abc.catalogue())
    preferred = options.format or ("obj" if sources else "step")
    if not sources:
        _download(options, names, root, preferred)
    counts: Counter[str] = Counter()
    for outcome in preparation.prepare(names, root, sources, preferred=preferred, progress=bars):
        counts[outcome.status] += 1
        level = logging.ERROR if outcome.status == preparation.FAILED else logging.INFO
        log.log(level, "%s  %s: %s", outcome.name, outcome.status, outcome.detail)
    log.info("%s, in %s", ", ".join(f"{count} {status}" for status, count in counts.items()), root)
    if counts[preparation.DONE] and not counts[preparation.FAILED] and preparation.source_folder(root).is_dir():
        log.info("%s is not needed for them any more and may be deleted", preparation.source_folder(root))
    if counts[preparation.DONE] + counts[preparation.THERE] == 0:
        places = ", ".join(map(str, sources)) or str(preparation.source_folder(root))
        raise InputError(f"no shape could be prepared from {places}: give a folder of ABC files or its 7z archives")
    return 2 if counts[preparation.FAILED] else 0


def _download(options: argparse.Namespace, names: Sequence[str], root: Path, preferred: str) -> None:
    """Get the archives of the shapes that are still to be made, once the user has agreed."""
    folder = preparation.source_folder(root)
    kinds = preparation.FORMATS[preferred]
    here = members.index([folder])
    lacking = [
        entry
        for entry in (abc.catalogue()[name] for name in names)
        if not preparation.is_prepared(entry.name, root)
        and any(members.find(here, entry, kind) is None for kind in kinds)
    ]
    numbers = {chunks.chunk_of(entry.abc_id) for entry in lacking}
    if not options.shapes:
        numbers &= {chunks.MAIN}
    wanted = [
        chunk
        for chunk in chunks.needed(chunks.table(options.urls), kinds, numbers)
        if not (folder / chunk.name).is_file()
    ]
    for entry in lacking:
        if chunks.chunk_of(entry.abc_id) not in numbers:
            log.info(
                "%s alone needs chunk %s: --shapes %s gets it", entry.name, chunks.chunk_of(entry.abc_id), entry.name
            )
    if not wanted:
        return
    archive.needs_reader()
    if preferred == "step" and importlib.util.find_spec("cascadio") is None:
        raise InputError(
            "STEP files need cascadio: pip install 'jointsdf[abc]' (in a checkout '.[abc]'), or --format obj"
        )
    _confirm(wanted, folder, options.yes)
    for chunk in wanted:
        download.fetch(chunk, folder, bars)


def _confirm(wanted: Sequence[chunks.Chunk], folder: Path, is_agreed: bool) -> None:
    """Show what would be downloaded, and ask."""
    missing = sum(chunk.bytes - min(download.bytes_here(chunk, folder), chunk.bytes) for chunk in wanted)
    for chunk in wanted:
        here = download.bytes_here(chunk, folder)
        log.info("%s  %s%s  %s", chunk.name, size(chunk.bytes), f" ({size(here)} here)" if here else "", chunk.url)
    log.info(
        "To download: %s, into %s. The models belong to their creators (Onshape terms of use).", size(missing), folder
    )
    if is_agreed:
        return
    if not sys.stdin.isatty():
        raise InputError(f"a download of {size(missing)} is to be confirmed, and this is no terminal: add --yes")
    try:
        answer = input("Go on? [y/N] ").strip().lower()
    except EOFError:
        answer = ""
    if answer not in ("y", "yes"):
        raise InputError("nothing is downloaded; --from takes files or archives that are here already")


def size(count: int) -> str:
    """A number of bytes as people write it."""
    unit, name = next(
        ((unit, name) for unit, name in ((1e9, "GB"), (1e6, "MB"), (1e3, "kB")) if count >= unit), (1, "bytes")
    )
    return f"{count / unit:.4g} {name}" if unit == 1 else f"{count / unit:.1f} {name}"
