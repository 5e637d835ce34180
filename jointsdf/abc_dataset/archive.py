"""Extraction of members from an untrusted 7z archive."""

import importlib.util
import io
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from jointsdf.abc_dataset.download import FULL
from jointsdf.abc_dataset.progress import Progress, silent
from jointsdf.errors import InputError

if TYPE_CHECKING:
    import py7zr

MEMBER_LIMIT = 1 << 30  # bytes; a file of a catalogue model has a few MB
ARCHIVE_LIMIT = 64 << 20  # bytes that any archive may unpack to; a large one may unpack to RATIO times its own size
RATIO = 100  # text such as ABC's compresses about tenfold
OUTSIDE = re.compile(r"[\\/]|[A-Za-z]:|(.*[\\/])?\.\.([\\/]|$)")


def require_py7zr() -> None:
    """Fail early where 7z files cannot be read.

    Raises:
        InputError: py7zr is not installed.
    """
    if importlib.util.find_spec("py7zr") is None:
        raise InputError("7z archives need py7zr: pip install 'jointsdf[abc]' (in a checkout '.[abc]')")


def extract(path: Path, is_wanted: Callable[[str], bool], folder: Path, progress: Progress = silent) -> list[Path]:
    """Extract the wanted members, each as a file without the archive's folders, whole or not at all.

    Args:
        path: The archive.
        is_wanted: Selects members by name.
        folder: Gets the files.
        progress: Shows how far the archive is read.

    Returns:
        The files.

    Raises:
        InputError: The archive cannot be read, is damaged, holds a link or a member that would lie outside the
            folder, or unpacks to too much; or the disk is full. Finished members stay.
    """
    require_py7zr()
    import py7zr

    writers = _Writers(folder)
    try:
        with _ProgressFile(path) as file, py7zr.SevenZipFile(file) as opened:
            _check_members(path, opened)
            _check_sizes(path, opened, is_wanted)
            targets = [each.filename for each in opened.files if is_wanted(each.filename) and not each.is_directory]
            if targets:
                folder.mkdir(parents=True, exist_ok=True)
                with progress(f"unpack {path.name}", path.stat().st_size) as file.show:
                    opened.extract(targets=targets, factory=writers.factory())
                writers.finish()
    except (InputError, PermissionError, FileNotFoundError):
        raise
    except py7zr.PasswordRequired as error:
        raise InputError(f"{path} is encrypted: ABC's archives are not; download it again") from error
    except Exception as error:  # on a damaged archive the reader may fail in any way
        if isinstance(error, OSError) and error.errno in FULL:
            raise InputError(f"{folder}: the disk is full: free some space, and run it again") from error
        reason = "empty (0 bytes)" if path.stat().st_size == 0 else "no 7z archive, truncated or damaged"
        raise InputError(f"{path} is {reason}: download it again") from error
    finally:
        writers.drop()
    return writers.finished


def _check_members(path: Path, opened: "py7zr.SevenZipFile") -> None:
    """Refuse members that no archive of ABC has: outside the folder, links, repeated names."""
    for each in opened.files:
        if OUTSIDE.match(each.filename):
            raise InputError(
                f"{path} holds {each.filename!r}, which lies outside it: it is no archive of ABC, nothing is taken"
            )
        if each.is_symlink or each.is_junction or each.is_socket:
            raise InputError(f"{path} holds {each.filename!r}, a link: it is no archive of ABC, nothing is taken")
    repeated = [name for name, count in Counter(each.filename for each in opened.files).items() if count > 1]
    if repeated:
        raise InputError(f"{path} holds {repeated[0]!r} twice: it is no archive of ABC, nothing is taken")


def _check_sizes(path: Path, opened: "py7zr.SevenZipFile", is_wanted: Callable[[str], bool]) -> None:
    """Refuse archives that would unpack to too much; py7zr unpacks no more than the sizes in the header."""
    for each in opened.files:
        if is_wanted(each.filename) and each.uncompressed > MEMBER_LIMIT:
            raise InputError(
                f"{path} holds {each.filename!r} of {each.uncompressed} bytes, above {MEMBER_LIMIT}: nothing is taken"
            )
    total, limit = sum(each.uncompressed for each in opened.files), max(ARCHIVE_LIMIT, RATIO * path.stat().st_size)
    if total > limit:
        raise InputError(f"{path} would unpack to {total} bytes, more than {limit}: nothing is taken")


class _ProgressFile(io.FileIO):
    """A file that reports how far it is read."""

    show: Callable[[int], None] = staticmethod(lambda done: None)  # noqa: ARG005

    def read(self, size: int | None = -1) -> bytes:
        data = super().read(-1 if size is None else size)
        self.show(self.tell())
        return data or b""


class _Writers:
    """Writes members to files, one after the other.

    py7zr checks a member's checksum only after it has closed its writer, so a file gets its final name when the next
    member begins, or at the end.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.finished: list[Path] = []
        self.open: tuple[BinaryIO, Path, Path] | None = None

    def factory(self) -> "py7zr.WriterFactory":
        """The factory that py7zr takes its writers from."""
        import py7zr
        from py7zr import io as py7zr_io

        begin = self.begin

        class Writer(py7zr_io.Py7zIO):
            def __init__(self, file: BinaryIO) -> None:
                self.file = file

            def write(self, s: bytes | bytearray) -> int:
                return self.file.write(s)

            def read(self, size: int | None = None) -> bytes:  # noqa: ARG002
                return b""

            def seek(self, offset: int, whence: int = 0) -> int:  # noqa: ARG002
                return 0

            def flush(self) -> None:
                self.file.flush()

            def size(self) -> int:
                return self.file.tell()

        class Factory(py7zr.WriterFactory):
            def create(self, filename: str) -> py7zr_io.Py7zIO:
                return Writer(begin(filename))

        return Factory()

    def begin(self, name: str) -> BinaryIO:
        """Open a file for the next member; the last one passed its checksum."""
        self.finish()
        target = self.folder / re.split(r"[\\/]", name)[-1]
        part = target.with_name(f"{target.name}.part")
        file = part.open("wb")
        self.open = file, part, target
        return file

    def finish(self) -> None:
        """Give the open file its final name."""
        if self.open:
            file, part, target = self.open
            file.close()
            part.replace(target)
            self.finished.append(target)
            self.open = None

    def drop(self) -> None:
        """Delete the open file: its member is not complete."""
        if self.open:
            file, part, _ = self.open
            file.close()
            part.unlink(missing_ok=True)
            self.open = None
