"""A fitted field as a file for other programs: ONNX, numpy arrays, half precision."""

from jointsdf.export.export import export_field

__all__ = ["export_field"]
