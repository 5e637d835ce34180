"""Sentences of a page of runs: how good the fits are, how exact what is shown is, where the numbers come from."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from jointsdf.runs.records import DEFAULT_PROTOCOL, HOLDOUT
from jointsdf.runs.row import ResultRow, score_of
from jointsdf.viewing.page.numbers import lines, plain
from jointsdf.viewing.page.scene import Scene


def about(scene: Scene, rows: Sequence[ResultRow]) -> dict[str, Any]:
    """Title, first lines and table of numbers."""
    first, unit = rows[0], scene.shape.unit
    protocol = quoted_protocol(first)
    known = "" if unit.known else " (assumed: the file names no unit)"
    runs = ", ".join(dict.fromkeys(f"study {row.study}, recipe {row.recipe}" for row in rows))
    labels = first.provenance.get("label_provider", "unknown")
    size = f"Longest side {plain(scene.size)} {unit.name}{known}"
    found = [_quality(row, protocol, scene.size, unit.name) for row in rows]
    return {
        "title": first.shape,
        "lead": f"{runs}. {size}; {first.num_parts} parts, labels {labels}.",
        "sentences": [f"{fit.name}: {text}." for fit, text in zip(scene.fits, found, strict=True) if text],
        "numbers": {
            "caption": f"Protocol {protocol or 'none'}; blank where there is no number.",
            "lines": lines(rows, protocol, scene.size, unit.name),
        },
    }


def quoted_protocol(row: ResultRow) -> str:
    """The protocol whose scores a page shows: by held-out points where there are no others."""
    named = [name for name in (HOLDOUT, DEFAULT_PROTOCOL) if name in row.scores]
    return named[0] if named else next(iter(row.scores), "")


def _quality(row: ResultRow, protocol: str, size: float, unit: str) -> str:
    """How good a fit is, in words."""
    if row.status != "ok":
        return "the field has no surface in the box"
    what, metric = ("held-out points", "held_out_p99") if protocol == HOLDOUT else ("the surface", "surface_p99")
    p99, exact = score_of(row, protocol, metric), score_of(row, protocol, "acc_exact")
    facts = []
    if not math.isnan(p99):
        length = f"{plain(p99 * size, 2)} {unit} ({plain(100 * p99, 2)}% of the longest side)"
        facts.append(f"99% of {what} within {length}")
    if not math.isnan(exact):
        facts.append(f"{plain(100 * exact, 3)}% of the surface has the right part")
    return ", ".join(facts)


def facts(row: ResultRow) -> list[tuple[str, str]]:
    """Run, sizes, seconds and provenance of a row."""
    names = ("study", "variant", "recipe", "head", "seed", "steps", "status")
    flat: dict[str, Any] = {name: getattr(row, name) for name in names}
    seconds = ", ".join(f"{stage} {plain(value)}" for stage, value in row.seconds.items() if not math.isnan(value))
    flat |= row.counts | {"seconds": seconds, "peak_memory_mb": row.peak_memory_mb}
    for name, value in row.provenance.items():
        flat |= {f"{name}.{key}": item for key, item in value.items()} if isinstance(value, Mapping) else {name: value}
    given = [(name, value) for name, value in flat.items() if value is not None]
    return [(name, plain(value, 6) if isinstance(value, float) else str(value)) for name, value in given]


def size_note(surface: Mapping[str, Any]) -> str:
    """Size of the full surface."""
    count, what = surface["full_faces"], "points" if surface["kind"] == "points" else "faces"
    return f"{count:,} {what}" if count else "no surface"


def accuracy(surface: Mapping[str, Any], scene: Scene) -> str:
    """How far what is shown is from the full surface, and the field's grid from the field."""
    unit, count = scene.shape.unit.name, f"{surface['full_faces']:,}"
    if not surface["faces"]:
        return "the field has no surface in the box."
    if surface["kind"] == "points":
        return f"{surface['faces']:,} of {count} points."
    text = f"all {count} faces."
    if surface["moved"] > 0:
        moved, share = plain(surface["moved"], 2), plain(100 * surface["moved"] / scene.size, 2)
        text = (
            f"{count} faces merged for this page, no place found farther than {moved} {unit} ({share}% of the longest"
        )
        text += " side) from the full mesh, mesh.ply. Errors are distances of the full mesh."
    grid = surface["field"]
    text += f" Errors are known at places up to {plain(surface['longest'], 2)} {unit} apart, and interpolated between."
    error = f"{plain(grid['near_p99'], 2)} {unit}"
    return f"{text} Isolines from {grid['count']}³ values, 99% of them within {error} near the surface."
