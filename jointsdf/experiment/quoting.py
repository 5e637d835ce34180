"""Quotes for what a user types, so that Hydra's override grammar reads names of files as they are. Imports no torch.

The grammar (hydra-core 1.3, `OverrideLexer.g4`) gives a meaning to `, = ( ) [ ] { } : ' "` and backslashes and refuses
every letter beyond ASCII; OmegaConf then resolves `${...}`.
"""

import os
import re
from collections.abc import Callable
from functools import partial

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override, Quote, QuotedString, ValueType
from hydra.errors import HydraException

from jointsdf.errors import InputError
from jointsdf.experiment.file_patterns import matching_files
from jointsdf.user_paths import expand_home

OVERRIDE = re.compile(r"(?P<key>\+{0,2}[A-Za-z_][\w./@-]*)=(?P<value>.*)", re.DOTALL | re.ASCII)
# Keys of files and folders, besides those below `paths`.
FILES = (*("shape", "shapes", "labels", "truth", "truth_labels", "partfield_dir", "run"),)
SHAPES = "shapes"  # whose commas make a list, and not a sweep
PATHS = "paths."  # what the keys of folders begin with
NAMES = ("study", "variant")  # keys of free text, the names of folders
QUOTES = ("'", '"')
BRACKETS = re.compile(r"[()\[\]{}]")  # of lists, mappings and functions, whose typing errors Hydra explains
UNUSABLE = re.compile(r"[\x00-\x08\x0a-\x1f\x7f\x85\u2028\u2029\ud800-\udfff]")  # line breaks, controls, no UTF-8
LONGEST_NAME, LONGEST_PATH = 255, 4096  # characters: Linux's limits


def quote_override(word: str, *, sweeps: bool = False) -> str:
    """Quote the value of an override `key=value` where the grammar would refuse it or read another one.

    An existing file or folder is meant as it is called, for the keys of files; the commas of a list part the names, and
    no name. Names of new folders are text, `007` as well. Other values are quoted only where the grammar refuses them,
    and keep their interpolations.

    Args:
        word: The override; one without a value is returned as it is.
        sweeps: Whether commas may separate the values of several runs.

    Raises:
        InputError: The word holds a line break or another character that no line of a log or table can have.

    >>> quote_override("study=Gehäuse (v2)"), quote_override("variant=tap=${trunk.tap}")
    ("study='Gehäuse (v2)'", "variant='tap=${trunk.tap}'")
    >>> quote_override("head=relu,siren"), quote_override("seed=range(0,3)")
    ('head=relu,siren', 'seed=range(0,3)')
    """
    check_characters(word)
    found = OVERRIDE.fullmatch(word)
    if found is None or not found["value"]:
        return word
    key, value = found["key"], found["value"]
    name = key.lstrip("+")
    if name in FILES or name.startswith(PATHS):
        return f"{key}={_quote_files(name, value, sweeps)}"
    if name in NAMES:
        return f"{key}={_quote_text(value, sweeps)}"
    if _read(value) or BRACKETS.search(value.replace("${", "")):
        return word
    return f"{key}={','.join(map(_quote_refused, _split(value, _is_quoted)))}" if sweeps else f"{key}={quote(value)}"


def quote_path(path: str) -> str:
    r"""Quote the name of a file or folder, of which `${` is a part and no interpolation.

    >>> print(quote_path("it's ${x}.stl"))
    'it\'s \${x}.stl'
    """
    return quote(escape_interpolations(expand_home(path)))


def quote(text: str) -> str:
    """Quote a value by Hydra's rules: in single quotes, those within it and the backslashes before them escaped."""
    return QuotedString(text, Quote.single).with_quotes()


def escape_interpolations(text: str) -> str:
    r"""Escape every `${` and the backslashes before it, so that OmegaConf reads the text as it is.

    >>> print(escape_interpolations("a${b}"))
    a\${b}
    """
    return re.sub(r"(\\*)\$\{", lambda found: found[1] * 2 + r"\${", text)


def check_characters(name: str) -> None:
    """Refuse a name that cannot stand in a line of a log, a row or a table.

    Raises:
        InputError: One line that names it.
    """
    if UNUSABLE.search(name):
        raise InputError(
            f"{name!a}: a line break, control character or byte that is no UTF-8; rename the file or give another name"
        )


def _quote_files(key: str, value: str, sweeps: bool) -> str:
    """Quote names of files and folders that exist, with `~` expanded; of others, what the grammar refuses."""
    exists = partial(_exists, key)
    if exists(value):
        return quote_path(value)
    value = expand_home(value)
    read = _read(value)
    names = _split(value, lambda text: exists(text) or _is_quoted(text))
    if key.startswith(PATHS) and (len(names) == 1 or not sweeps):
        return _quote_text(value, sweeps)
    if len(names) == 1:
        return _quote_refused(value)
    plain = read is None or read.value_type is ValueType.SIMPLE_CHOICE_SWEEP
    if key == SHAPES and plain:
        return f"[{','.join(_quote_file(name, exists) for name in names)}]"
    if read and not any(exists(name) and ("${" in name or _meaning(name) != name) for name in names):
        return value
    if read or sweeps or any(map(exists, names)):
        return ",".join(_quote_file(name, exists) for name in names)
    return quote(value)


def _quote_text(value: str, sweeps: bool) -> str:
    """Quote free text that the grammar refuses or does not read as one text: `007`, `null`, `a,b` of one run."""
    read = _read(value)
    if sweeps and "," in value and (read is None or (read.is_choice_sweep() and not BRACKETS.search(value))):
        return ",".join(_quote_text(name, sweeps=False) for name in _split(value, _is_quoted))
    is_text = read is not None and isinstance(read._value, str | QuotedString)
    return value if is_text or (sweeps and read and read.is_sweep_override()) else quote(value)


def _quote_file(name: str, exists: Callable[[str], bool]) -> str:
    return quote_path(name) if exists(name) else _quote_refused(expand_home(name))


def _quote_refused(value: str) -> str:
    return value if _read(value) else quote(value)


def _split(value: str, is_whole: Callable[[str], bool]) -> list[str]:
    """Split at commas, but not within the longest pieces that are whole."""
    pieces, names = value.split(","), []
    while pieces:
        whole = text = pieces[0]
        for piece in pieces[1:]:
            text += f",{piece}"
            if not _may_be_whole(text):
                break
            if is_whole(text):
                whole = text
        names.append(whole)
        del pieces[: whole.count(",") + 1]
    return names


def _may_be_whole(text: str) -> bool:
    """Whether a text with commas, or a longer one that begins with it, can be in quotes or the name of a file."""
    if text.startswith(QUOTES):
        return True
    folder, _, name = expand_home(text).rpartition("/")
    known = not folder or bool(re.search(r"[*?\[]", folder)) or os.path.isdir(folder)
    return known and len(name) <= LONGEST_NAME and len(text) <= LONGEST_PATH


def _exists(key: str, name: str) -> bool:
    """Whether there is such a file or folder; also a label file before the colon of a column, files of a pattern."""
    path = expand_home(name)
    if os.path.lexists(path):
        return True
    if key in ("labels", "truth_labels"):
        return any(os.path.isfile(path[: colon.start()]) for colon in re.finditer(":", path))
    return key == SHAPES and any(matching_files(path))


def _read(value: str) -> Override | None:
    """The value as Hydra reads it; None where its grammar refuses it."""
    try:
        return OverridesParser.create().parse_override(f"key={value}")
    except HydraException:
        return None


def _meaning(value: str) -> object:
    """The single value that Hydra reads; None for any other."""
    read = _read(value)
    return None if read is None or read.is_sweep_override() else read.value()


def _is_quoted(value: str) -> bool:
    """Whether the user put the whole value in quotes."""
    if not (value.startswith(QUOTES) and value.endswith(value[0])):
        return False
    read = _read(value)
    return read is not None and isinstance(read._value, QuotedString)
