"""Captions that say what a table averages over, and what it had to leave out."""

import pandas as pd

from jointsdf.study.comparisons import BASELINE, Comparison
from jointsdf.study.missing_runs import listed, shortened

SOURCES = {"abc": "ABC shapes", "builtin": "built-in shapes", "file": "shapes from mesh files"}
SEVERAL = "Seconds of different machines are averaged: "
UNRANKED = "A mean over fewer shapes shows its n and is not ranked."


def caption(what: str, comparison: Comparison, *, unequal: bool, averaged: bool = True) -> str:
    """Plain text under a table.

    Args:
        what: What the table shows and what it is over: sentences without the last full stop.
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
        listed(gap for gap in comparison.group.gaps if gap.head != BASELINE or BASELINE in comparison.heads),
        empty_runs(comparison.runs),
        _changed_truth(comparison.runs),
        _changed_settings(comparison.runs),
    ]
    return " ".join(sentence for sentence in sentences if sentence)


def empty_runs(runs: pd.DataFrame) -> str:
    """Name the runs that ended without a mesh; their distances are missing, their shares 0."""
    failed = runs[runs["status"] != "ok"]
    names = [f"{run.head} on {run.shape} (seed {run.seed}, {run.status})" for run in failed.itertuples()]
    return f"Without a mesh: {shortened(names)}." if names else ""


def _seeds(runs: pd.DataFrame, *, averaged: bool) -> str:
    counts = runs.groupby(["head", "shape"])["seed"].nunique()
    if counts.empty:
        return "no common shape"
    fewest, most = int(counts.min()), int(counts.max())
    if most == 1:
        return "one seed"
    count = f"{fewest} seeds" if fewest == most else f"{fewest} to {most} seeds"
    return count + " averaged first" * averaged


def _left_out(dropped: dict[str, list[str]]) -> str:
    names = [f"{shape} (no {', '.join(heads)})" for shape, heads in dropped.items()]
    return f"Left out: {shortened(names, '; ')}." if names else ""


def _changed_truth(runs: pd.DataFrame) -> str:
    """Shapes whose runs saw different ground truths: a mesh or labels changed between two runs."""
    names: dict[str, None] = {}
    labelled = runs[runs["head"] != BASELINE]  # the baseline does not see labels
    for fact, of in (("mesh_sha256", runs), ("num_parts", labelled), ("label_provider", labelled)):
        if fact in of:
            kinds = of.groupby("shape")[fact].nunique()
            names |= dict.fromkeys(map(str, kinds[kinds > 1].index))
    return f"Ground truth changed between the runs of: {shortened(sorted(names))}." if names else ""


def _changed_settings(runs: pd.DataFrame) -> str:
    """Runs that bear one recipe's name and were made with several settings."""
    kinds = runs.groupby("variant")["settings_hash"].nunique() if "settings_hash" in runs else pd.Series(dtype=int)
    return f"Settings changed between the runs: {kinds.max()} kinds are mixed here." if (kinds > 1).any() else ""


def measured_on(runs: pd.DataFrame) -> str:
    """Where seconds and memory come from: they are of one machine or of several, which is said."""
    facts = [column for column in ("machine", "device", "threads") if column in runs]
    names = ("", "on ", "threads: ")
    kinds = runs[facts].drop_duplicates().itertuples(index=False) if facts else []
    found = ["; ".join(f"{name}{value}" for name, value in zip(names, kind, strict=False)) for kind in kinds]
    several = SEVERAL if len(found) > 1 else "Measured on: "
    return several + " | ".join(found) if found else "The machine is unknown"
