"""Words of a command line as overrides that Hydra accepts: names of files in quotes, bare names of files as the shape.

Imports no torch: mistakes are reported before torch is loaded.
"""

import os
import re
from collections.abc import Iterator, Sequence

from hydra._internal.utils import get_args_parser

from jointsdf.errors import InputError
from jointsdf.experiment.file_patterns import matching_files
from jointsdf.experiment.help import CONF, GROUPS
from jointsdf.experiment.quoting import check_characters, quote_override, quote_path
from jointsdf.user_paths import expand_home

SWEEP = re.compile(r"-m|--multirun|(sweeps|hydra\.mode)=.+")  # words that make a sweep of the command
KEY = re.compile(r"\+{0,2}(\w+)[\w./@-]*=", re.ASCII)
EXAMPLE = "a value is key=value, e.g. shape=part_01"


def fit_arguments(words: Sequence[str]) -> list[str]:
    """Read the words of `train.py`: `part.stl` is `shape=part.stl`, a folder or several files are a sweep over them.

    Args:
        words: As the shell gives them.

    Raises:
        InputError: A word that is neither an option, nor `key=value`, nor a file or folder; or several shapes.
    """
    options, overrides, bare = _sort(words)
    keys = {match[1] for match in map(KEY.match, overrides) if match}
    if len(bare) + len(keys & {"shape", "shapes"}) > 1 and keys & {"shape", "shapes"}:
        raise InputError(f"{(bare or ['shape='])[0]}: the shape is given twice; leave out that, shape= or shapes=")
    given = []
    if len(bare) == 1 and not os.path.isdir(bare[0]) and os.path.lexists(bare[0]):
        given.append(f"shape={quote_path(bare[0])}")
    elif bare:
        given.append(f"shapes=[{','.join(map(quote_path, bare))}]")
    if (len(bare) and given[0].startswith("shapes=")) or "shapes" in keys:
        given += [] if "sweeps" in keys else ["sweeps=folder"]
    sweeps = any(map(SWEEP.fullmatch, [*options, *overrides, *given]))
    return [*options, *(quote_override(word, sweeps=sweeps) for word in overrides), *given]


def evaluate_arguments(words: Sequence[str]) -> list[str]:
    """Read the words of `evaluate.py`: a bare folder is `run=<folder>`.

    Args:
        words: As the shell gives them.

    Raises:
        InputError: As for `fit_arguments`.
    """
    options, overrides, bare = _sort(words)
    if len(bare) > 1:
        raise InputError(f"{bare[1]}: a second folder; measure one run at a time")
    return [*options, *map(quote_override, overrides), *(f"run={quote_path(folder)}" for folder in bare)]


def _sort(words: Sequence[str]) -> tuple[list[str], list[str], list[str]]:
    """Sort into options with their values, overrides, and bare names of files and folders with `~` expanded."""
    options, overrides, bare = [], [], []
    for word, is_option in _options(words):
        check_characters(word)
        if is_option:
            options.append(word)
        elif path := _existing(word):
            bare.append(path)
        elif "=" in word or word.startswith("~"):
            overrides.append(word)
        elif word.startswith("-"):
            options.append(word)  # an abbreviated one, or Hydra says what is wrong
        else:
            raise InputError(f"{word}: neither a file nor a folder; {EXAMPLE}")
    return options, overrides, bare


def _options(words: Sequence[str]) -> Iterator[tuple[str, bool]]:
    """Each word, and whether it is an option of Hydra's own or its value."""
    known = {name: action for action in get_args_parser()._actions for name in action.option_strings}
    takes_value = False
    for word in words:
        option = word.partition("=")[0] if word.startswith("--") else word
        is_option = option in known or (takes_value and not word.startswith("-") and "=" not in word)
        takes_value = option in known and "=" not in word and known[option].nargs != 0
        yield word, is_option


def _existing(word: str) -> str | None:
    """The file, folder or pattern of files that the whole word names; None where it is `key=value` or nothing."""
    key, path = KEY.match(word), expand_home(word)
    if key and key[1] in _keys():
        return None
    return path if os.path.lexists(path) or any(matching_files(path)) else None


def _keys() -> set[str]:
    """First names of all keys of both commands."""
    config = CONF.joinpath("config.yaml").read_text(encoding="utf-8")
    return {*re.findall(r"^(\w+):", config, re.MULTILINE), *GROUPS, "run"}
