"""Captions: the runs that a table averages over, and those that it leaves out."""

import pandas as pd

from jointsdf.study.comparisons import Comparison
from jointsdf.study.groups import BASELINE
from jointsdf.study.missing_runs import name_missing, shorten

SOURCES = {"abc": "ABC shapes", "builtin": "built-in shapes", "file": "shapes from mesh files"}
SEVERAL = "Seconds of different machines are averaged: "
UNRANKED = "A mean over fewer shapes shows its n and is not ranked."


def caption(what: str, comparison: Comparison, *, unequal: bool, averaged: bool = True) -> str:
    """Plain text under a table.

    Args:
        what: First sentences, on the content of the table, without the last full stop.
        comparison: The runs in it.
        unequal: Whether some mean is over fewer shapes than the others.
        averaged: Whether the seeds of a shape are averaged first.
    """
    key = comparison.group.key
    labels = "no labels" if key["label_kind"] == BASELINE else f"{key['label_kind']} labels"
    sentences = [
        f"{what}.",
        f"Study {key['study']}, recipe {key['recipe']}, variant {key['variant']}, {SOURCES[key['source']]}, {labels}, "
        f"protocol {key['protocol']}, {_seeds(comparison.runs, averaged=averaged)}.",
        UNRANKED if unequal else "",
        _left_out(comparison.dropped),
        name_missing(run for run in comparison.group.missing if run.head != BASELINE or BASELINE in comparison.heads),
        _count_passed_over(comparison.group.passed_over),
        name_corruptions(comparison.runs),
        name_empty_runs(comparison.runs),
        _name_changed_truth(comparison.runs),
        _changed_settings(comparison.runs),
    ]
    return " ".join(sentence for sentence in sentences if sentence)


def name_corruptions(runs: pd.DataFrame) -> str:
    """Name what the training clouds of the runs suffer."""
    if "corruption" not in runs or runs["corruption"].isna().all():
        return ""
    kinds = sorted(map(str, runs["corruption"].fillna("none").unique()))
    return f"Corruption of the training cloud: {'; '.join(kinds)}."


def name_empty_runs(runs: pd.DataFrame) -> str:
    """Name the runs without a mesh, whose distances are missing and whose shares are 0."""
    failed = runs.loc[runs["status"] != "ok", ["head", "shape", "seed", "status"]]
    names = [f"{run.head} on {run.shape} (seed {run.seed}, {run.status})" for run in failed.itertuples()]
    return f"Without a mesh: {shorten(names)}." if names else ""


def _seeds(runs: pd.DataFrame, *, averaged: bool) -> str:
    """Number of seeds of a head and shape."""
    counts = runs.groupby(["head", "shape"])["seed"].nunique()
    if counts.empty:
        return "no common shape"
    fewest, most = int(counts.min()), int(counts.max())
    if most == 1:
        return "one seed"
    count = f"{fewest} seeds" if fewest == most else f"{fewest} to {most} seeds"
    return count + " averaged first" * averaged


def _left_out(dropped: dict[str, list[str]]) -> str:
    """Name the dropped shapes with the heads that lack them."""
    names = [f"{shape} (no {', '.join(heads)})" for shape, heads in dropped.items()]
    return f"Left out: {shorten(names, '; ')}." if names else ""


def _count_passed_over(passed_over: int) -> str:
    """Count the files that were passed over; the command that made the table has named them."""
    return f"Files that cannot be read or repeat a run, and are left out: {passed_over}." if passed_over else ""


def _name_changed_truth(runs: pd.DataFrame) -> str:
    """Name the shapes whose mesh or labels differ between two runs."""
    names: dict[str, None] = {}
    labelled = runs[runs["head"] != BASELINE]  # the baseline does not see labels
    for fact, of in (("mesh_sha256", runs), ("num_parts", labelled), ("label_provider", labelled)):
        if fact in of:
            kinds = of.groupby("shape")[fact].nunique()
            names |= dict.fromkeys(map(str, kinds[kinds > 1].index))
    return f"Ground truth changed between the runs of: {shorten(sorted(names))}." if names else ""


def _changed_settings(runs: pd.DataFrame) -> str:
    """Count the settings that one recipe's runs were made with, where they are several."""
    kinds = runs.groupby("variant")["settings_hash"].nunique() if "settings_hash" in runs else pd.Series(dtype=int)
    return f"Settings changed between the runs: {kinds.max()} kinds are mixed here." if (kinds > 1).any() else ""


def describe_machines(runs: pd.DataFrame) -> str:
    """Name the machines that seconds and memory were measured on; the first words tell one from several."""
    facts = [column for column in ("machine", "device", "threads") if column in runs]
    names = ("", "on ", "threads: ")
    kinds = runs[facts].drop_duplicates().itertuples(index=False) if facts else []
    found = ["; ".join(f"{name}{value}" for name, value in zip(names, kind, strict=False)) for kind in kinds]
    several = SEVERAL if len(found) > 1 else "Measured on: "
    return several + " | ".join(found) if found else "The machine is unknown"
