"""Configs that a stranger's run folder may hold: each would run code, show a secret or exhaust the reader.

A canary lies beside the folder: whatever a payload does, it writes, deletes or replaces that file.
"""

import atexit
import json
import os
import pickle
import shutil
import tempfile
from collections.abc import Callable
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
import yaml

from jointsdf.values import LabelledMesh
from jointsdf.viewing.export import write_mesh

STORED = Path(__file__).parent / "stored" / "finished"
CONFIG = json.loads(json.dumps(yaml.safe_load((STORED / "config.yaml").read_text())))  # without aliases
ALIVE, SECRET = "alive", "a-secret-of-the-reader"
RUN = (  # what was typed for the folder
    *("recipe=smoke", "trainer.max_steps=8", "trainer.preview_every=0", "trainer.accelerator=cpu"),
    *("trainer.matmul=default", "trainer.backward=float32", "trainer.orthogonalisation=float32"),
    *("extraction.resolution=16", "data.pool_size=300", "data.cloud_size=1000", "trunk.width=16", "head.widths=[8,8]"),
    *(f"data.counts.{name}=40" for name in ("manifold", "non_manifold", "shell", "pool")),
    *("evaluation.protocols.unit.points=300", "evaluation.protocols.flatcad.points=300"),
)


class Bomb:
    """Unpickled, it empties a file."""

    def __init__(self, victim: Path) -> None:
        self.victim = victim

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return os.truncate, (str(self.victim), 0)


@cache
def _template() -> Path:
    """The stored run with a mesh, made once: its durable writes take a while on a busy disk."""
    place = Path(tempfile.mkdtemp())
    atexit.register(shutil.rmtree, place, ignore_errors=True)
    folder = Path(shutil.copytree(STORED, place / "run"))
    box = trimesh.creation.box()
    write_mesh(folder, LabelledMesh(np.array(box.vertices), np.array(box.faces), np.zeros(12, np.int64)))
    return folder


def hostile_folder(place: Path) -> tuple[Path, Path]:
    """A finished run with a pickle and a script in it, and the canary beside it."""
    folder, canary = place / "smoke/base/siren/part_01/seed0", place / "canary"
    shutil.copytree(_template(), folder)
    canary.write_text(ALIVE)
    (folder / "bomb.pkl").write_bytes(pickle.dumps(Bomb(canary)))
    (folder / "script.py").write_text(f"open({str(canary)!r}, 'w').close()\n")
    return folder, canary


def payloads(folder: Path, canary: Path) -> dict[str, dict[str, Any]]:
    """Calls that touch the canary, by name."""
    bomb, victim, empty = str(folder / "bomb.pkl"), str(canary), f"open({str(canary)!r}, 'w').close()"
    shell = f"truncate -s 0 {victim}"
    calls: dict[str, list[Any] | dict[str, Any]] = {
        "torch.load": {"f": bomb, "weights_only": False},
        "torch.serialization.load": {"f": bomb, "weights_only": False},
        "torch.jit.load": {"f": bomb},
        "torch.hub.download_url_to_file": [f"file://{bomb}", victim],
        "torch.hub.load": {"repo_or_dir": str(folder), "model": "x", "source": "local"},
        "torch.save": [{}, victim],
        "os.system": [shell],
        "os.popen": [shell],
        "os.remove": [victim],
        "os.truncate": [victim, 0],
        "posix.system": [shell],
        "builtins.eval": [empty],
        "builtins.exec": [empty],
        "builtins.open": [victim, "w"],
        "subprocess.run": {"args": shell, "shell": True},
        "subprocess.Popen": {"args": shell, "shell": True},
        "subprocess.check_output": {"args": shell, "shell": True},
        "pandas.read_pickle": [bomb],
        "numpy.load": {"file": bomb, "allow_pickle": True},
        "joblib.load": [bomb],
        "pickle.loads": [pickle.dumps(Bomb(canary)).decode("latin-1")],
        "shutil.rmtree": [str(canary.parent)],
        "shutil.copyfile": [bomb, victim],
        "pathlib.Path.write_text": [victim, ""],
        "runpy.run_path": [str(folder / "script.py")],
        "functools.partial": [{"_target_": "os.truncate", "_partial_": True}, victim, 0],
        "importlib.import_module": ["antigravity"],
        "operator.methodcaller": ["system", shell],
        "ctypes.CDLL": [bomb],
        "code.interact": [],
        "hydra.utils.instantiate": [{"_target_": "os.truncate", "_args_": [victim, 0]}],
        "hydra.utils.call": [{"_target_": "os.truncate", "_args_": [victim, 0]}],
        "hydra.utils.get_method": ["os.system"],
        "hydra.utils.get_class": ["subprocess.Popen"],
        "omegaconf.OmegaConf.load": [bomb],
        "jointsdf.runs.files.write_atomically": [{"_target_": "pathlib.Path", "_args_": [victim]}, ""],
        "jointsdf.runs.folder._clear": [{"_target_": "pathlib.Path", "_args_": [str(canary.parent)]}],
        "jointsdf.runs.folder.shutil.rmtree": [str(canary.parent)],
        "jointsdf.metrics.chamfer.np.load": {"file": bomb, "allow_pickle": True},
        "jointsdf.model.field.torch.load": {"f": bomb, "weights_only": False},
        "jointsdf.results.write_atomically": [{"_target_": "pathlib.Path", "_args_": [victim]}, ""],
        "jointsdf.cli.fit": [],
        "jointsdf.api.fit": {"shape": "part_01", "out": victim},
        "jointsdf.metrics.chamfer.Chamfer.__init__.__globals__": [],
        "torch.optim.lr_scheduler.LambdaLR": [],
        "torch.optim.sgd.torch.load": {"f": bomb, "weights_only": False},
    }
    return {
        name: {"_target_": name} | (given if isinstance(given, dict) else {"_args_": given})
        for name, given in calls.items()
    }


def placed(key: str, payload: Any) -> dict[str, Any]:
    """The stored config with a value at a dotted key; numbers are places in lists."""
    config = deepcopy(CONFIG)
    inner: Any = config
    *names, last = key.split(".")
    for name in names:
        inner = inner[int(name)] if isinstance(inner, list) else inner.setdefault(name, {})
    if isinstance(inner, list):
        inner.insert(int(last), payload)
    else:
        inner[last] = payload
    return config


PLACES = (  # of a payload: before, within and around what a class of the table is built from
    *("extraction", "extraction.method", "extraction._args_", "extraction.resolution"),
    *("evaluation", "evaluation.protocols", "evaluation.protocols.unit", "evaluation.protocols.unit.name"),
    *("evaluation.protocols.unit.metrics", "evaluation.protocols.unit.metrics.chamfer", "evaluation.primary"),
    *("evaluation.protocols.unit.metrics.f_score.threshold", "evaluation.protocols.unit.field.distance"),
    *("evaluation.protocols.unit.metrics.chamfer._partial_", "evaluation.protocols.unit._recursive_"),
    *("evaluation.protocols.unit._convert_", "loss", "loss.terms.dirichlet", "loss.weights.eikonal", "optimizer"),
    *("loss.schedules.weingarten.knots.0.0", "optimizer.betas", "head", "trunk.init", "data.counts", "trainer"),
    *("identity.evaluation.protocols.unit", "identity.optimizer", "tessellation", "notes", "paths.notes"),
)

MISPLACED = {  # classes of the table where they are not what is built, and names that are nearly in it
    "a metric extracts": ("extraction._target_", "jointsdf.metrics.chamfer.Chamfer"),
    "an optimizer measures": ("evaluation.protocols.unit.metrics.x", {"_target_": "torch.optim.SGD"}),
    "an extraction is a loss": ("loss.terms.x", {"_target_": "jointsdf.extraction.Extraction"}),
    "a loss is a head": ("head", {"_target_": "jointsdf.losses.dirichlet.Dirichlet", "name": "siren"}),
    "a list": ("extraction._target_", ["jointsdf.extraction.Extraction"]),
    "a mapping": ("extraction._target_", {"a": "jointsdf.extraction.Extraction"}),
    "a number": ("extraction._target_", 3),
    "nothing": ("extraction._target_", None),
    "no text": ("extraction._target_", ""),
    "a space": ("extraction._target_", "jointsdf.extraction.Extraction "),
    "a line feed": ("extraction._target_", "os\nsystem"),
    "an escape sequence": ("extraction._target_", "\x1b[2Jos.system"),
    "an escape sequence in the key": ("extraction.\x1b[31m.\n", {"_target_": "os.system"}),
    "a long name": ("extraction._target_", "x." * 4000 + "y"),
    "another case": ("optimizer._target_", "torch.optim.adam"),
    "the base class": ("optimizer._target_", "torch.optim.Optimizer"),
    "below a class": ("optimizer._target_", "torch.optim.Adam.__init__"),
    "relative": ("extraction._target_", ".jointsdf.extraction.Extraction"),
}

INTERPOLATIONS = {
    "a variable of the environment": ("extraction.method", "${oc.env:SECRET}"),
    "its default": ("extraction.borders", "${oc.env:NONE,${oc.env:SECRET}}"),
    "decoded": ("extraction.chunk", "${oc.decode:${oc.env:SECRET}}"),
    "within text": ("evaluation.protocols.unit.name", "a${oc.env:SECRET}b"),
    "escaped": ("evaluation.protocols.unit.frame", "\\${oc.env:SECRET}"),
    "in a list": ("loss.schedules.weingarten.knots", [["${oc.env:SECRET}", 1.0]]),
    "of a node": ("evaluation.protocols.unit", "${evaluation.protocols.flatcad}"),
    "of a class": ("extraction._target_", "${oc.env:SECRET}"),
    "in the identity": ("identity.trunk.init", "${oc.env:SECRET}"),
    "Hydra's": ("trainer.note", "${hydra:runtime.cwd}"),
    "created": ("extraction", "${oc.create:{_target_: os.system}}"),
}
