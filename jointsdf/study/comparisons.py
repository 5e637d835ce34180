"""Which runs may share a table: same study, recipe, variant, source of shapes, kind of labels, protocol."""

import math
import re
from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass, replace

import pandas as pd

from jointsdf.runs.records import DEFAULT_PROTOCOL, source_of
from jointsdf.study.missing_runs import Gap
from jointsdf.study.statistics import common_shapes

GROUP = ["study", "recipe", "variant", "source", "label_kind", "protocol"]
BASELINE = "none"
HEAD_ORDER = (BASELINE, "relu", "siren", "hybrid", "deep_skip")  # the paper's; other heads follow by name
BUDGET = ("steps", "resolution", "parameters_trunk")
SUFFIX = "--"  # between a table's name and its group


@dataclass(frozen=True)
class Group:
    """Runs that may be compared, and where their tables go.

    Attributes:
        key: Value of each column of `GROUP`.
        suffix: Of the file names; empty for the default group.
        runs: Lines of `collect`.
        borrowed: Baseline runs of another study, where this one has none: same recipe, variant, shapes' source,
            protocol and budget.
        gaps: Runs that its study wants and does not have.
    """

    key: dict[str, str]
    suffix: str
    runs: pd.DataFrame
    borrowed: pd.DataFrame
    gaps: list[Gap]

    @property
    def borrowed_from(self) -> str:
        """The study of the borrowed runs; empty for none."""
        return "" if self.borrowed.empty else str(self.borrowed["study"].iloc[0])


@dataclass(frozen=True)
class Family:
    """The variants of a study, e.g. of an ablation, as one group whose "heads" are `<head> (<variant>)`.

    Attributes:
        group: Their runs; the suffix leaves the variant out.
        pairs: Each variant but the first, numbers by their size, and the first, of the same head.
    """

    group: Group
    pairs: list[tuple[str, str]]


@dataclass(frozen=True)
class Comparison:
    """Runs of several heads on the same shapes.

    Attributes:
        group: Where the runs come from.
        heads: In the order of the table's lines.
        shapes: Those that every head was run on.
        dropped: The other shapes, each with the heads that lack it.
        runs: Lines of `collect`, of these shapes only.
    """

    group: Group
    heads: list[str]
    shapes: list[str]
    dropped: dict[str, list[str]]
    runs: pd.DataFrame

    def of(self, head: str) -> pd.DataFrame:
        """The runs of one head."""
        return self.runs[self.runs["head"] == head]


def split(runs: pd.DataFrame, gaps: Sequence[Gap] = ()) -> list[Group]:
    """Part the runs into comparable groups, the default one first.

    The default is the group of protocol `unit` with most runs. Baseline runs (head `none`) do not use labels, so they
    join the groups of every kind of labels; where no head was run beside them, they are a group of their own.

    Args:
        runs: Lines of `collect`.
        gaps: Wanted runs without a result, of any study.
    """
    baseline = runs[runs["head"] == BASELINE]
    other = [column for column in GROUP if column != "label_kind"]
    alone = pd.Series(True, index=baseline.index)
    parts: list[tuple[tuple[str, ...], pd.DataFrame]] = []
    for key, part in runs[runs["head"] != BASELINE].groupby(GROUP):
        beside = (baseline[other] == part[other].iloc[0]).all(axis="columns")
        alone &= ~beside
        parts.append((tuple(map(str, key)), pd.concat([part, baseline[beside]])))
    rest = baseline[alone].assign(label_kind=BASELINE)
    parts += [(tuple(map(str, key)), part) for key, part in rest.groupby(GROUP)]
    parts.sort(key=lambda item: (item[0][-1] != DEFAULT_PROTOCOL, -len(item[1]), item[0]))
    suffixes = _suffixes([key for key, _ in parts])
    return [
        Group(dict(zip(GROUP, key, strict=True)), suffix, part, _borrowed(part, baseline), _gaps_of(key, gaps))
        for (key, part), suffix in zip(parts, suffixes, strict=True)
    ]


def families(groups: Sequence[Group]) -> list[Family]:
    """Put the groups together that differ in the variant alone; heads that only one variant has are left out."""
    by_key: dict[tuple[str, ...], list[Group]] = {}
    for group in groups:
        by_key.setdefault(tuple(value for name, value in group.key.items() if name != "variant"), []).append(group)
    families = []
    for key, members in by_key.items():
        members.sort(key=lambda group: natural(group.key["variant"]))
        variants_of: dict[str, list[str]] = {}
        for group in members:
            for head in sorted(set(group.runs["head"]) - {BASELINE}):
                variants_of.setdefault(head, []).append(group.key["variant"])
        variants_of = {head: variants for head, variants in variants_of.items() if len(variants) > 1}
        if variants_of:
            arms = {head: [_arm(head, variant) for variant in variants] for head, variants in variants_of.items()}
            pairs = [(other, first) for first, *others in arms.values() for other in others]
            families.append(Family(_joined(key, members, {arm for line in arms.values() for arm in line}), pairs))
    return families


def compare(group: Group, *, baseline: bool) -> Comparison:
    """Keep the shapes that every head of the group was run on.

    Args:
        group: Runs that may be compared.
        baseline: Whether the head `none` takes part.
    """
    runs = group.runs if baseline else group.runs[group.runs["head"] != BASELINE]
    shapes, dropped = common_shapes(runs)
    heads = sorted(set(runs["head"]), key=lambda head: (head not in HEAD_ORDER, _place(head), natural(head)))
    return Comparison(group, heads, shapes, dropped, runs[runs["shape"].isin(shapes)])


def shown_alone(groups: Sequence[Group], related: Sequence[Family]) -> list[Group]:
    """The groups with tables and figures of their own: variants stand beside each other, in their family's, instead.

    The default group always has its own; so has one with a head that no other variant has, or without a shape that all
    variants have.

    Args:
        groups: From `split`.
        related: Their `families`.
    """
    joined = [family.group for family in related if compare(family.group, baseline=True).shapes]
    return [group for group in groups if not group.suffix or not any(_covers(family, group) for family in joined)]


def with_borrowed_baseline(group: Group) -> Group:
    """The group with the borrowed baseline runs among its own."""
    return group if group.borrowed.empty else replace(group, runs=pd.concat([group.runs, group.borrowed]))


def natural(text: str) -> list[tuple[float, str]]:
    """Key to sort by: numbers in a text count by their size."""
    parts = re.split(r"(\d+(?:\.\d+)?)", text)
    return [(float(part), "") if place % 2 else (math.inf, part) for place, part in enumerate(parts)]


def _covers(family: Group, group: Group) -> bool:
    alike = all(family.key[name] == group.key[name] for name in GROUP if name != "variant")
    arms = {_arm(head, group.key["variant"]) for head in set(group.runs["head"]) - {BASELINE}}
    return alike and arms <= set(family.runs["head"])


def _arm(head: str, variant: str) -> str:
    return f"{head} ({variant})"


def _joined(key: tuple[str, ...], members: Sequence[Group], arms: Set[str]) -> Group:
    """One group of several variants' runs, a head per arm."""
    runs = pd.concat([group.runs for group in members])
    runs = runs.assign(head=[_arm(head, variant) for head, variant in zip(runs["head"], runs["variant"], strict=True)])
    gaps = [replace(gap, head=_arm(gap.head, gap.variant)) for group in members for gap in group.gaps]
    runs = runs[runs["head"].isin(arms)]
    named = members[0].key | {"variant": "; ".join(runs["variant"].unique())}
    return Group(named, SUFFIX + _words(key), runs, runs[:0], gaps)


def _gaps_of(key: tuple[str, ...], gaps: Sequence[Gap]) -> list[Gap]:
    study, _, variant, source, *_ = key
    wanted = (study, variant, source)
    return [gap for gap in gaps if (gap.study, gap.variant, source_of(gap.shape)) == wanted]


def _borrowed(part: pd.DataFrame, baseline: pd.DataFrame) -> pd.DataFrame:
    same = [name for name in ("recipe", "variant", "source", "protocol", *BUDGET) if name in part]
    usable = baseline[baseline["study"] != part["study"].iloc[0]]
    if (part["head"] == BASELINE).any():
        return usable[:0]
    wanted = set(part[["shape", *same]].itertuples(index=False, name=None))
    offered = usable[["shape", *same]].itertuples(index=False, name=None)
    usable = usable[pd.Series([run in wanted for run in offered], index=usable.index, dtype=bool)]
    studies = usable.groupby("study")["shape"].nunique()
    return usable if studies.empty else usable[usable["study"] == studies.idxmax()]


def _place(head: str) -> int:
    return HEAD_ORDER.index(head) if head in HEAD_ORDER else 0


def _suffixes(keys: list[tuple[str, ...]]) -> Iterator[str]:
    used: set[str] = set()
    for position, key in enumerate(keys):
        suffix = SUFFIX + _words(key) if position else ""
        yield suffix if suffix not in used else f"{suffix}-{position}"
        used.add(suffix)


def _words(key: tuple[str, ...]) -> str:
    """A group's key as part of a file's name."""
    return "-".join(dict.fromkeys(re.sub(r"[^A-Za-z0-9_=+.]+", "-", word) for word in key))  # study = recipe: said once
