"""Families: groups that differ in the variant alone, joined so that variants compare as heads do."""

from collections.abc import Sequence, Set
from dataclasses import dataclass, replace

import pandas as pd

from jointsdf.study.comparisons import compare, natural_key
from jointsdf.study.groups import BASELINE, GROUP, SUFFIX, Group, file_words


@dataclass(frozen=True)
class Family:
    """The variants of a study, e.g. of an ablation, as one group whose "heads" are `<head> (<variant>)`.

    Attributes:
        group: Their runs; the suffix leaves the variant out.
        pairs: (variant, first variant) of the same head, for each variant but the first in natural order.
    """

    group: Group
    pairs: list[tuple[str, str]]


def join_variants(groups: Sequence[Group]) -> list[Family]:
    """Join the groups that differ in the variant alone; a head that only one variant has is left out."""
    by_key: dict[tuple[str, ...], list[Group]] = {}
    for group in groups:
        by_key.setdefault(tuple(value for name, value in group.key.items() if name != "variant"), []).append(group)
    families = []
    for key, members in by_key.items():
        members.sort(key=lambda group: natural_key(group.key["variant"]))
        variants_of: dict[str, list[str]] = {}
        for group in members:
            for head in sorted(set(group.runs["head"].unique()) - {BASELINE}):
                variants_of.setdefault(head, []).append(group.key["variant"])
        variants_of = {head: variants for head, variants in variants_of.items() if len(variants) > 1}
        if variants_of:
            arms = {head: [_arm(head, variant) for variant in variants] for head, variants in variants_of.items()}
            pairs = [(other, first) for first, *others in arms.values() for other in others]
            families.append(Family(_join(key, members, {arm for line in arms.values() for arm in line}), pairs))
    return families


def groups_with_own_tables(groups: Sequence[Group], related: Sequence[Family]) -> list[Group]:
    """Select the groups that get tables and figures of their own; the others are in their family's.

    The default group always gets its own; so does one with a head that no other variant has, or without a shape that
    all variants have.

    Args:
        groups: From `group_runs`.
        related: From `join_variants`.
    """
    joined = [family.group for family in related if compare(family.group, baseline=True).shapes]
    return [group for group in groups if group.first or not any(_covers(family, group) for family in joined)]


def _covers(family: Group, group: Group) -> bool:
    """True if the family's group has every run of one of its variants' groups."""
    if any(family.key[name] != group.key[name] for name in GROUP if name != "variant"):
        return False
    arms = {_arm(head, group.key["variant"]) for head in group.runs["head"].unique() if head != BASELINE}
    return arms <= set(family.runs["head"].unique())


def _arm(head: str, variant: str) -> str:
    """Name of one variant's head within a family."""
    return f"{head} ({variant})"


def _join(key: tuple[str, ...], members: Sequence[Group], arms: Set[str]) -> Group:
    """One group of several variants' runs, a head per arm."""
    runs = pd.concat([group.runs for group in members])
    runs = runs.assign(head=[_arm(head, variant) for head, variant in zip(runs["head"], runs["variant"], strict=True)])
    missing = [replace(run, head=_arm(run.head, run.variant)) for group in members for run in group.missing]
    runs = runs[runs["head"].isin(arms)]
    named = members[0].key | {"variant": "; ".join(runs["variant"].unique())}
    return Group(named, SUFFIX + file_words(key), runs, runs[:0], missing, members[0].passed_over)
