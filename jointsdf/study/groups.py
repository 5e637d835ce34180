"""Groups of comparable runs: same study, recipe, variant, source of shapes, kind of labels and protocol."""

import hashlib
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import pandas as pd

from jointsdf.runs.columns import READ_FACTS, SCHEMA_COLUMN
from jointsdf.runs.records import DEFAULT_PROTOCOL, source_of
from jointsdf.study.missing_runs import MissingRun

GROUP = ["study", "recipe", "variant", "source", "label_kind", "protocol"]
BASELINE = "none"
BUDGET = ("steps", "resolution", "parameters_trunk")
SUFFIX = "--"  # between a table's name and its group
LONGEST = 160  # characters of a group in a file's name


@dataclass(frozen=True)
class Group:
    """Comparable runs, and the folder and suffix of their tables.

    Attributes:
        key: Value of each column of `GROUP`.
        suffix: Of the file names; empty for a study's first group.
        runs: Lines of `collect`.
        borrowed: Baseline runs of another study, where this one has none: same recipe, variant, shapes' source,
            protocol and budget.
        missing: Planned runs of the study that have no result.
        passed_over: Number of files of rows or plans that cannot be read, or repeat a run, of any study.
        first: Whether it is the default group, the first of all.
    """

    key: dict[str, str]
    suffix: str
    runs: pd.DataFrame
    borrowed: pd.DataFrame
    missing: list[MissingRun]
    passed_over: int = 0
    first: bool = False

    @property
    def folder(self) -> str:
        """Folder of its tables and figures: the study's."""
        return file_words((self.key["study"],)).strip(".") or "study"

    def label(self, name: str) -> str:
        """Name of one of its tables or figures that no other group's has."""
        return name + (self.suffix or ("" if self.first else SUFFIX + self.folder))

    @property
    def borrowed_from(self) -> str:
        """The study of the borrowed runs; empty for none."""
        return "" if self.borrowed.empty else str(self.borrowed["study"].iloc[0])


def group_runs(runs: pd.DataFrame, missing: Sequence[MissingRun] = (), passed_over: int = 0) -> list[Group]:
    """Group the runs that are comparable, the default group first.

    The default is the group of protocol `unit` with most runs. Baseline runs (head `none`) do not use labels, so they
    join the groups of every kind of labels; without a run of another head they are a group of their own.

    Args:
        runs: Lines of `collect`.
        missing: Planned runs without a result, of any study.
        passed_over: Number of files that `load_rows` passed over.
    """
    names = list(runs)
    unread = [name for name in names[names.index(SCHEMA_COLUMN) + 1 :] if name not in READ_FACTS]
    runs = runs.drop(columns=unread)  # a fifth of the columns, of text, which a selection copies one by one
    baseline = runs[runs["head"] == BASELINE]
    other = [column for column in GROUP if column != "label_kind"]
    alone = pd.Series(True, index=baseline.index)
    parts: list[tuple[tuple[str, ...], pd.DataFrame]] = []
    for key, part in runs[runs["head"] != BASELINE].groupby(GROUP):
        same = (baseline[other] == part[other].iloc[0]).all(axis="columns")
        alone &= ~same
        parts.append((tuple(map(str, key)), pd.concat([part, baseline[same]])))
    rest = baseline[alone].assign(label_kind=BASELINE)
    parts += [(tuple(map(str, key)), part) for key, part in rest.groupby(GROUP)]
    parts.sort(key=lambda item: (item[0][-1] != DEFAULT_PROTOCOL, -len(item[1]), item[0]))
    suffixes = _suffixes([key for key, _ in parts])
    offered = _budgets(baseline)
    return [
        Group(
            dict(zip(GROUP, key, strict=True)),
            suffix,
            part,
            _borrow_baseline(part, baseline, offered),
            _missing_of(key, missing),
            passed_over,
            first=not place,
        )
        for place, ((key, part), suffix) in enumerate(zip(parts, suffixes, strict=True))
    ]


def _missing_of(key: tuple[str, ...], missing: Sequence[MissingRun]) -> list[MissingRun]:
    study, _, variant, source, *_ = key
    wanted = (study, variant, source)
    return [run for run in missing if (run.study, run.variant, source_of(run.shape)) == wanted]


def _budgets(runs: pd.DataFrame) -> list[tuple[object, ...]]:
    """What a run must share with a baseline run that it borrows."""
    names = [name for name in ("shape", "recipe", "variant", "source", "protocol", *BUDGET) if name in runs]
    return list(zip(*(runs[name].tolist() for name in names), strict=True))


def _borrow_baseline(part: pd.DataFrame, baseline: pd.DataFrame, offered: Sequence[tuple[object, ...]]) -> pd.DataFrame:
    """Baseline runs for a group without any, from the other study that covers most of its shapes.

    Args:
        part: The group's runs.
        baseline: Those of every study.
        offered: Their `_budgets`.
    """
    if (part["head"] == BASELINE).any():
        return baseline[:0]
    wanted = set(_budgets(part))
    alike = pd.Series([run in wanted for run in offered], index=baseline.index, dtype=bool)
    usable = baseline[alike & (baseline["study"] != part["study"].iloc[0])]
    studies = usable.groupby("study")["shape"].nunique()
    return usable if studies.empty else usable[usable["study"] == studies.idxmax()]


def _suffixes(keys: list[tuple[str, ...]]) -> Iterator[str]:
    """A suffix per group, none twice but the empty one of each study's first."""
    used: set[str] = set()
    studies: set[str] = set()
    for position, key in enumerate(keys):
        if (study := file_words(key[:1])) not in studies:
            studies.add(study)
            yield ""
            continue
        suffix = SUFFIX + file_words(key)
        yield suffix if suffix not in used else f"{suffix}-{position}"
        used.add(suffix)


def file_words(key: tuple[str, ...]) -> str:
    """A group's key as part of a file's name; of a long one its beginning and a hash."""
    words = "-".join(dict.fromkeys(re.sub(r"[^A-Za-z0-9_=+.]+", "-", word) for word in key))  # no word twice
    if len(words) <= LONGEST:
        return words
    return f"{words[:LONGEST]}-{hashlib.sha256(words.encode()).hexdigest()[:8]}"
