"""Loads files one by one as a run does, under a limit of memory: a line of JSON before and after each. Run as a script.

Its argument is a JSON file of pairs: the shape's path, and `labels`.
"""

import json
import logging
import os
import resource
import sys
from pathlib import Path

import numpy as np

from jointsdf import shapes
from jointsdf.errors import InputError
from jointsdf.shapes.mesh_report import mesh_report

ROOM = 1 << 30  # bytes beyond what the process has mapped when everything is imported


def _processor_seconds() -> float:
    """Seconds of the processor that this process and its ended children have used."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def load(path: str, labels: str) -> dict[str, object]:
    """Outcome of one file: `faces`, or the `error` of one that is refused, or the `bug`."""
    start = _processor_seconds()
    try:
        shape = shapes.load(path, labels=labels, abc_root="nowhere", segmented=False)
        mesh = shape.mesh
        assert np.isfinite(mesh.vertices).all(), "a vertex is not finite"
        assert 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices), "a face uses a vertex out of range"
        assert len(mesh.labels) == len(mesh.faces), "labels and faces differ in number"
        assert mesh.labels.min() >= -1, "a label is below -1"
        mesh_report(shape).lines(1.0)
        found: dict[str, object] = {"faces": len(mesh.faces) + shape.dropped}
    except InputError as error:
        found = {"error": str(error)}
    except BaseException as error:
        found = {"bug": f"{type(error).__name__}: {error}"}
    return {"path": path, "seconds": _processor_seconds() - start} | found


def main() -> None:
    """Load every file of the list."""
    logging.disable(logging.CRITICAL)
    mapped = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (mapped + ROOM, mapped + ROOM))
    for path, labels in json.loads(Path(sys.argv[1]).read_text()):
        for answer in ({"begun": path}, load(path, labels)):
            sys.stdout.write(json.dumps(answer) + "\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
