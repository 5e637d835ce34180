"""A field as numpy arrays in one .npz file, which sixty lines of numpy evaluate (docs/export.md)."""

import io
from pathlib import Path
from typing import Any

import numpy as np

from jointsdf.export.about import as_text, describe
from jointsdf.export.layers import Dense, head_layers, in_half, sine_layers
from jointsdf.model.field import JointField
from jointsdf.runs.files import write_atomically


def write_arrays(field: JointField, path: Path) -> None:
    """Write the field as arrays without pickles, atomically; weights that float16 holds exactly are kept as such.

    Raises:
        InputError: A head without an exported form.
        OSError: The file cannot be written.
    """
    content = io.BytesIO()
    np.savez_compressed(content, **arrays_of(field))
    write_atomically(path, content.getvalue())


def arrays_of(field: JointField) -> dict[str, Any]:
    """Arrays of the file by name, `about` (JSON) among them.

    `trunk_weight_<k>`, `trunk_bias_<k>`, `head_weight_<k>`, `head_bias_<k>` of the layers, k from 0; `output_weight`,
    `output_bias` of the distance; `far_coefficients` of the grid away from the surface, in whole steps.
    """
    trunk, head = sine_layers(field.trunk.sine_layers), head_layers(field.head)
    about = describe(field) | {
        "tap": field.trunk.tap,
        "trunk_layers": [_wiring(layer) for layer in trunk],
        "head_layers": [_wiring(layer) for layer in head],
        "far": None,
    }
    output = field.trunk.output
    arrays: dict[str, Any] = {
        "centre": field.centre.cpu().numpy(),
        "scale": field.scale.cpu().numpy(),
        "output_weight": output.weight.detach().cpu().numpy()[0],
        "output_bias": output.bias.detach().cpu().numpy()[0],
    }
    for name, layers in (("trunk", trunk), ("head", head)):
        for k, layer in enumerate(layers):
            arrays |= {f"{name}_weight_{k}": in_half(layer.weight), f"{name}_bias_{k}": layer.bias}
    if (far := field.far) is not None:
        about["far"] = {"cell": far.cell, "inner": far.inner, "outer": far.outer, "step": float(far.step)}
        arrays["far_coefficients"] = far.coefficients.cpu().numpy()
    return {"about": np.array(as_text(about)), **arrays}


def _wiring(layer: Dense) -> dict[str, Any]:
    return {"activation": layer.activation, "omega": layer.omega, "inputs": list(layer.inputs)}
