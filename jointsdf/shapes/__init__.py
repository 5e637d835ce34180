"""Ground truths: meshes with part labels, loaded by a shape's name or path."""

from jointsdf.shapes.loading import load, require_parts
from jointsdf.shapes.naming import name_of, shape_names

__all__ = ["load", "name_of", "require_parts", "shape_names"]
