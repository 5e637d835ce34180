"""Files of run folders and studies as crashes, editors, disks and strangers leave them: a table by name of the case."""

import json
import os
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

Plant = Callable[[Path, dict[str, Any]], None]  # makes the file at a path, from what a run would have written there
DEEP = 100_000
LONG = 5_000


def holding(make: Callable[[dict[str, Any]], str | bytes]) -> Plant:
    """A file of this content."""

    def plant(path: Path, content: dict[str, Any]) -> None:
        made = make(content)
        path.write_bytes(made if isinstance(made, bytes) else made.encode("utf-8", errors="surrogatepass"))

    return plant


def with_value(key: str, value: Any) -> Plant:
    """The file with a value at a dotted key; `...` removes it. A key in a key is written with `|` for its dot."""

    def change(content: dict[str, Any]) -> str:
        changed = deepcopy(content)
        inner = changed
        *names, last = (name.replace("|", ".") for name in key.split("."))
        for name in names:
            inner = inner[name]
        if value is ...:
            del inner[last]
        else:
            inner[last] = value
        return json.dumps(changed).replace('"1e400"', "1e400")

    return holding(change)


def _repeat_a_key(content: dict[str, Any]) -> str:
    name = next(iter(content))
    return f'{{"{name}": {json.dumps(content[name])}, {json.dumps(content)[1:]}'


def _sparse(path: Path, _: dict[str, Any]) -> None:
    with path.open("wb") as file:
        file.truncate(100_000_000)


WHOLE: dict[str, Plant] = {  # of any JSON file
    "empty": holding(lambda _: ""),
    "half of it": holding(lambda content: json.dumps(content)[: len(json.dumps(content)) // 2]),
    "null": holding(lambda _: "null"),
    "a list": holding(lambda _: "[]"),
    "an empty object": holding(lambda _: "{}"),
    "text": holding(lambda _: '"text"'),
    "a number": holding(lambda _: "7"),
    "zeros after a power cut": holding(lambda content: bytes(len(json.dumps(content)))),
    "more after its end": holding(lambda content: json.dumps(content) + "}"),
    "a byte order mark": holding(lambda content: "\ufeff" + json.dumps(content)),
    "UTF-16": holding(lambda content: json.dumps(content).encode("utf-16")),
    "no UTF-8": holding(lambda content: b"\xff" + json.dumps(content).encode()),
    "deep lists": holding(lambda _: "[" * DEEP + "]" * DEEP),
    "deep objects": holding(lambda _: '{"a":' * DEEP + "1" + "}" * DEEP),
    "a key twice": holding(_repeat_a_key),
    "not a number": with_value("more", float("nan")),
    "infinity": with_value("more", float("inf")),
    "an integer of 9,000 digits": holding(lambda content: json.dumps(content)[:-1] + f', "more": {"9" * 9000}}}'),
    "100 MB": _sparse,
    "a directory": lambda path, _: path.mkdir(),
    "a pipe": lambda path, _: os.mkfifo(path),
    "a link to itself": lambda path, _: path.symlink_to(path),
    "a link to a device": lambda path, _: path.symlink_to("/dev/zero"),
}

NO_COUNT: dict[str, Any] = {
    "text": "7",
    "true": True,
    "a fraction": 1.5,
    "negative": -1,
    "null": None,
    "a list": [1],
    "of 400 digits": 10**400,
    "1e400": "1e400",
}
NO_SCORE: dict[str, Any] = {
    "text": "0.5",
    "the text NaN": "NaN",
    "true": True,
    "a list": [0.5],
    "an object": {"value": 0.5},
    "of 400 digits": 10**400,
    "1e400": "1e400",
    "1e308, whose square is infinite": 1e308,
}
NO_FOLDER: dict[str, Any] = {
    "no text": "",
    "the folder above": "..",
    "a path": "a/b",
    "two lines": "a\nb",
    "an escape sequence": "\x1b[2J",
    "a NUL": "a\0b",
    "half a surrogate pair": "\ud800",
    "300 characters": "x" * 300,
    "a number": 7,
    "null": None,
    "a list": ["main"],
    "an object": {"a": 1},
}
NO_NAME: dict[str, str] = {
    "no text": "",
    "two lines": "a\nb",
    "an escape sequence": "\x1b[2J",
    "5,000 characters": "x" * LONG,
    "a run's": "seed",
    "a fact's": "label_kind",
    "a derived score's": "cd_l1_over_floor",
    "that of the memory": "peak_memory_mb",
    "the layout's": "schema",
}


def _named(where: str, value: Any) -> dict[str, Plant]:
    return {f"{where} named by {case}": with_value(f"{where}.{name}", value) for case, name in NO_NAME.items()}


ROWS: dict[str, Plant] = {
    **WHOLE,
    **{f"{key} is {case}": with_value(key, value) for key in ("study", "shape") for case, value in NO_FOLDER.items()},
    **{f"{key} is missing": with_value(key, ...) for key in ("study", "scores", "provenance", "schema")},
    **{f"seed is {case}": with_value("seed", value) for case, value in NO_COUNT.items()},
    **{f"counts.faces_gt is {case}": with_value("counts.faces_gt", value) for case, value in NO_COUNT.items()},
    **{f"scores.unit.cd_l1 is {case}": with_value("scores.unit.cd_l1", value) for case, value in NO_SCORE.items()},
    **{f"seconds.fit is {case}": with_value("seconds.fit", value) for case, value in NO_SCORE.items()},
    **{f"peak_memory_mb is {case}": with_value("peak_memory_mb", value) for case, value in NO_SCORE.items()},
    **_named("scores.unit", 0.5),
    **_named("counts", 5),
    **_named("provenance", "a fact"),
    "an IoU of a part of 5,000 digits": with_value(f"scores.unit.iou_{'9' * LONG}", 0.5),
    "a count named like seconds": with_value("counts.seconds_fit", 5),
    "a fact with a dot in its name": with_value("provenance.a|b", "a fact"),
    "a fact named like the counts": with_value("provenance.counts", {"faces_gt": 3}),
    "a protocol without a name": with_value("scores.", {"cd_l1": 0.5}),
    "a protocol in two lines": with_value("scores.a\nb", {"cd_l1": 0.5}),
    "a protocol that is null": with_value("scores.unit", None),
    "scores in a list": with_value("scores", [{"cd_l1": 0.5}]),
    "counts in a list": with_value("counts", [3]),
    "negative seconds": with_value("seconds.fit", -1.0),
    "negative memory": with_value("peak_memory_mb", -1.0),
    "negative steps": with_value("steps", -1),
    "parts counted by true": with_value("num_parts", True),
    "an unknown status": with_value("status", "fine"),
    "a status in a list": with_value("status", ["ok"]),
    "a list as provider": with_value("provenance.label_provider", ["brep"]),
    "a number as provider": with_value("provenance.label_provider", 7),
    "an object as provider": with_value("provenance.label_provider", {"a": 1}),
    "a list as hash": with_value("provenance.mesh_sha256", ["a"]),
    "a list in a fact": with_value("provenance.versions", {"torch": [2, 13]}),
    "facts three deep": with_value("provenance.versions", {"torch": {"cpu": "2.13"}}),
    "a fact beyond float64": with_value("provenance.grid_cell", "1e400"),
    "a fact of 400 digits": with_value("provenance.threads", 10**400),
    "a fact of a million characters": with_value("provenance.device", "x" * 1_000_000),
    "facts in text": with_value("provenance", "facts"),
    "layout 0": with_value("schema", 0),
    "layout 2": with_value("schema", 2),
    "layout 1.0": with_value("schema", 1.0),
    "layout true": with_value("schema", True),
    "layout in text": with_value("schema", "1"),
    "an unknown key": with_value("colour", "red"),
}
