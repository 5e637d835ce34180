"""A graph of ONNX operators (Open Neural Network Exchange), built node by node."""

from collections.abc import Mapping, Sequence
from types import ModuleType
from typing import Any

import numpy as np

from jointsdf.errors import InputError
from jointsdf.export.layers import Dense, in_half

OPSET, IR = 17, 8  # operators and layout that onnxruntime 1.13 (2022) and later read
ACTIVATIONS = {"sine": "Sin", "relu": "Relu"}


def load_onnx() -> ModuleType:
    """The package onnx.

    Raises:
        InputError: It is not installed.
    """
    try:
        import onnx
    except ImportError as error:
        raise InputError("--to onnx needs the package onnx: pip install 'jointsdf[onnx]'") from error
    loaded: ModuleType = onnx
    return loaded


class Graph:
    """Nodes and constants of a graph; values are known by their names."""

    def __init__(self) -> None:
        self.onnx = load_onnx()
        self.nodes: list[Any] = []
        self.constants: list[Any] = []
        self.weights: dict[Dense, str] = {}  # of each layer: the reverse sweep uses them again

    def constant(self, value: Any, dtype: Any = np.float32) -> str:
        """Add a constant of the given type."""
        name = f"c{len(self.constants)}"
        self.constants.append(self.onnx.numpy_helper.from_array(np.array(value, dtype=dtype), name))
        return name

    def apply(self, operator: str, *inputs: str, name: str | None = None, **attributes: Any) -> str:
        """Add a node of one output, and give that output's name."""
        name = name or f"v{len(self.nodes)}"
        self.nodes.append(self.onnx.helper.make_node(operator, list(inputs), [name], **attributes))
        return name

    def cast(self, value: str, dtype: Any, **options: Any) -> str:
        """Convert a value to another type."""
        code = self.onnx.helper.np_dtype_to_tensor_dtype(np.dtype(dtype))
        return self.apply("Cast", value, to=code, **options)

    def weight(self, layer: Dense) -> str:
        """A layer's matrix, stored once, in float16 where that loses nothing; float32 for the operators."""
        if layer not in self.weights:
            kept = in_half(layer.weight)
            name = self.constant(kept, kept.dtype)
            self.weights[layer] = name if kept.dtype == np.float32 else self.cast(name, np.float32)
        return self.weights[layer]

    def dense(self, layer: Dense, value: str) -> tuple[str, str]:
        """Apply a layer; its pre-activation and its output."""
        weight, bias = self.weight(layer), self.constant(layer.bias)
        before = self.apply("Gemm", value, weight, bias, alpha=layer.omega, beta=layer.omega, transB=1)
        return before, self.apply(ACTIVATIONS[layer.activation], before) if layer.activation != "none" else before

    def sum(self, value: str, axis: int) -> str:
        """Sum along an axis, which is dropped."""
        return self.apply("ReduceSum", value, self.constant([axis], np.int64), keepdims=0)

    def squeeze(self, value: str, axis: int, **options: Any) -> str:
        """Drop an axis of one entry."""
        return self.apply("Squeeze", value, self.constant([axis], np.int64), **options)

    def unsqueeze(self, value: str, *axes: int) -> str:
        """Insert axes of one entry at the given places of the result."""
        return self.apply("Unsqueeze", value, self.constant(axes, np.int64))

    def model(self, inputs: Sequence[Any], outputs: Sequence[Any], about: Mapping[str, str]) -> bytes:
        """The file of the graph, after onnx's own check.

        Args:
            inputs: (name, type, shape) of each; a dimension by name is free.
            outputs: The same.
            about: Metadata by name.
        """
        helper = self.onnx.helper
        values = [
            [
                helper.make_tensor_value_info(name, helper.np_dtype_to_tensor_dtype(np.dtype(dtype)), shape)
                for name, dtype, shape in side
            ]
            for side in (inputs, outputs)
        ]
        graph = helper.make_graph(self.nodes, "jointsdf_field", *values, initializer=self.constants)
        model = helper.make_model(
            graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR, producer_name="jointsdf"
        )
        helper.set_model_props(model, dict(about))
        self.onnx.checker.check_model(model, full_check=True)
        content: bytes = model.SerializeToString()
        return content
