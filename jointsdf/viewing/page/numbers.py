"""Numbers of result rows in words, each beside what it is read against: a floor, a ceiling or the exact value."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from jointsdf.runs.row import ResultRow, score_of


@dataclass(frozen=True)
class Measure:
    """A score in words.

    Attributes:
        metric: Its name in a row.
        words: Its name for people.
        beside: Words before the number that it is read against.
        reference: Name of that number's score; empty for none.
        kind: `length` (shares of the longest side), `share`, `count` or `number`.
    """

    metric: str
    words: str
    beside: str
    reference: str = ""
    kind: str = "number"


FLOOR, CEILING, TRUTH = (
    "floor: two samplings of the truth itself give",
    "ceiling: the exact distance on this grid gives",
    "the truth has",
)
MEASURES = (
    Measure("surface_p99", "99% of both surfaces are nearer to the other than", "exact: 0", kind="length"),
    Measure("surface_mean", "mean distance between the surfaces", "exact: 0", kind="length"),
    Measure("surface_max", "largest distance found between the surfaces", "exact: 0", kind="length"),
    Measure("cd_l1", "Chamfer distance of samples (cd_l1, hundredths of the longest side)", FLOOR, "cd_l1_floor"),
    Measure("nc", "agreement of normals (nc)", FLOOR, "nc_floor"),
    Measure("f1", "samples within 0.5% of the longest side (F1)", FLOOR, "f1_floor", "share"),
    Measure("edge_f1_fine", "creases found within 0.2% (F1)", CEILING, "edge_f1_fine_ceiling", "share"),
    Measure("miou_exact", "overlap of part labels, mean over the parts (mIoU exact)", CEILING, "miou_exact_ceiling"),
    Measure("acc_exact", "right labels, share of the surface", CEILING, "acc_exact_ceiling", "share"),
    Measure("boundary_f1", "borders between parts found within 1% (F1)", CEILING, "boundary_f1_ceiling", "share"),
    Measure("parts_pred", "parts", TRUTH, "parts_gt", "count"),
    Measure("components", "pieces", TRUTH, "components_gt", "count"),
    Measure("euler", "Euler number (2 less 2 for each hole)", TRUTH, "euler_gt", "count"),
    Measure(
        "sdf_relative_mean",
        "field away from the surface, mean relative error of its distance",
        "exact: 0",
        kind="share",
    ),
    Measure("held_out_mean", "mean distance of held-out points from the surface", "exact: 0", kind="length"),
    Measure("held_out_p99", "99% of held-out points are nearer to the surface than", "exact: 0", kind="length"),
    Measure("held_out_acc", "right labels at held-out points", "exact: 100%", kind="share"),
    Measure("to_cloud_mean", "mean distance of the surface from the points", "", kind="length"),
    Measure("uncovered", "share of the surface away from all points", "exact: 0", kind="share"),
)


@dataclass(frozen=True)
class Line:
    """A line of the table of numbers: a cell per run, blank where a number is missing."""

    name: str
    cells: list[str]
    beside: str


def lines(rows: Sequence[ResultRow], protocol: str, size: float, unit: str) -> list[Line]:
    """The measures that some row has, then the seconds.

    Args:
        rows: Of one shape.
        protocol: Whose scores are quoted.
        size: Longest side, file units.
        unit: Symbol of the file unit.
    """
    found = []
    for measure in MEASURES:
        show = _format(measure.kind, size, unit)
        values = [score_of(row, protocol, measure.metric) for row in rows]
        if all(map(math.isnan, values)):
            continue
        references = (
            dict.fromkeys(show(score_of(row, protocol, measure.reference)) for row in rows) if measure.reference else {}
        )
        beside = " ".join(part for part in (measure.beside, " or ".join(filter(None, references))) if part)
        found.append(
            Line(
                measure.words,
                [show(value) for value in values],
                beside if any(references) or not measure.reference else "",
            )
        )
    for stage, words in (("fit", "seconds of the fit"), ("total", "seconds of the whole run")):
        seconds = [row.seconds.get(stage, math.nan) for row in rows]
        if not all(map(math.isnan, seconds)):
            found.append(
                Line(
                    words,
                    [plain(value, 3) for value in seconds],
                    f"on {rows[0].provenance.get('machine', 'an unknown machine')}",
                )
            )
    return found


def plain(value: float, digits: int = 4) -> str:
    """A number with some digits; blank for NaN.

    >>> plain(0.98765), plain(12345.0, 3), plain(0.5), plain(0.0000123, 2), plain(float("nan"))
    ('0.9877', '12,300', '0.5', '1.2e-05', '')
    """
    if math.isnan(value):
        return ""
    rounded = float(f"{value:.{digits}g}")
    if rounded != 0 and not 1e-4 <= abs(rounded) < 1e7:
        return f"{value:.{digits}g}"
    text = f"{rounded:,.10f}".rstrip("0")
    return text.removesuffix(".")


def _format(kind: str, size: float, unit: str) -> Callable[[float], str]:
    """Function that prints a score; blank for NaN."""
    shown: dict[str, Callable[[float], str]] = {
        "length": lambda value: f"{plain(value * size, 3)} {unit} ({plain(100 * value, 2)}% of the longest side)",
        "share": lambda value: f"{plain(100 * value, 4)}%",
        "count": lambda value: f"{value:.0f}",
        "number": plain,
    }
    return lambda value: "" if math.isnan(value) else shown[kind](value)
