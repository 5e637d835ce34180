"""Draw docs/package_graph.svg from the import statements of the package: `python docs/package_graph.py`."""

import ast
import re
import tomllib
from collections import Counter
from collections.abc import Iterator
from html import escape
from pathlib import Path

DOCS = Path(__file__).parent
PACKAGE = DOCS.parent / "jointsdf"
SKIPPED = {"__init__", "moved_names"}  # aliases of names that moved: no part of the architecture
WIDE, HIGH, GAP, ROW, MARGIN = 118, 34, 16, 92, 24
STYLE = """
    text { font: 13px sans-serif; text-anchor: middle; dominant-baseline: central; fill: #1f2937 }
    .box { fill: #e8eef7; stroke: #5b7aa8 }
    .module { fill: #f5f1e6; stroke: #b09a5b }
    .arrow { stroke: #64748b; fill: none; opacity: .55 }
"""


def imported(tree: ast.AST) -> Iterator[str]:
    """Places of the package that a module imports, once for each statement."""
    for node in ast.walk(tree):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names = [f"jointsdf.{a.name}" for a in node.names] if node.module == "jointsdf" else [node.module]
        for name in names:
            top, *rest = name.split(".")
            if top == "jointsdf" and rest:
                yield rest[0]


def import_graph() -> dict[str, Counter[str]]:
    """What each place (a folder, or a module in none) imports, with the number of import statements."""
    graph: dict[str, Counter[str]] = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        place = parts[0]
        if place in SKIPPED:
            continue
        found = graph.setdefault(place, Counter())
        found.update(to for to in imported(ast.parse(path.read_text(encoding="utf-8"))) if to != place)
    return {place: Counter({to: n for to, n in found.items() if to in graph}) for place, found in graph.items()}


def levels() -> list[list[str]]:
    """Places of each level, top to bottom, from the import contract in pyproject.toml."""
    settings = tomllib.loads((PACKAGE.parent / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = settings["tool"]["importlinter"]["contracts"]
    layers = next(contract["layers"] for contract in contracts if contract["type"] == "layers")
    return [re.split(r"\s*[|:]\s*", layer) for layer in layers]


def drawing(graph: dict[str, Counter[str]]) -> str:
    """The graph as SVG: an arrow goes from a place to one that it imports, the wider the more statements do."""
    rows = [[place for place in level if place in graph] for level in levels()]
    width = 2 * MARGIN + max(len(row) * (WIDE + GAP) - GAP for row in rows)
    centre: dict[str, tuple[float, float]] = {}
    for i, row in enumerate(rows):
        left = (width - len(row) * (WIDE + GAP) + GAP) / 2
        for j, place in enumerate(row):
            centre[place] = (left + j * (WIDE + GAP) + WIDE / 2, MARGIN + i * ROW + HIGH / 2)
    height = 2 * MARGIN + (len(rows) - 1) * ROW + 2 * HIGH
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}">',
        f"  <style>{STYLE}  </style>",
        '  <defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto"'
        ' markerUnits="userSpaceOnUse"><path d="M0 0 L8 4 L0 8 z" fill="#64748b"/></marker></defs>',
        f'  <rect width="{width:g}" height="{height:g}" fill="#ffffff"/>',
    ]
    for place in sorted(graph):
        for to, count in sorted(graph[place].items()):
            (x, y), (u, v) = centre[place], centre[to]
            if v == y:  # beside each other: an arc below
                bend = HIGH
                y, v = y + HIGH / 2, v + HIGH / 2
                shape = f"M{x:g} {y:g} C{x:g} {y + bend:g} {u:g} {v + bend:g} {u:g} {v:g}"
            else:
                y, v = y + HIGH / 2, v - HIGH / 2
                bend = (v - y) / 2
                shape = f"M{x:g} {y:g} C{x:g} {y + bend:g} {u:g} {v - bend:g} {u:g} {v:g}"
            lines.append(
                f'  <path class="arrow" d="{shape}" marker-end="url(#tip)"'
                f' stroke-width="{min(0.8 + 0.15 * count, 4):.2f}"/>'
            )
    for place, (x, y) in sorted(centre.items()):
        kind = "box" if (PACKAGE / place).is_dir() else "module"
        name = place + ("/" if kind == "box" else ".py")
        lines.append(
            f'  <rect class="{kind}" x="{x - WIDE / 2:g}" y="{y - HIGH / 2:g}" width="{WIDE}" height="{HIGH}" rx="5"/>'
        )
        lines.append(f'  <text x="{x:g}" y="{y:g}">{escape(name)}</text>')
    return "\n".join([*lines, "</svg>"]) + "\n"


if __name__ == "__main__":
    (DOCS / "package_graph.svg").write_text(drawing(import_graph()), encoding="utf-8")
