"""Ground truths: a shape's name or path -> `Shape`, with part labels from any of their sources."""

from jointsdf.shapes.loading import load, name_of, require_parts, shape_names, triangles

__all__ = ["load", "name_of", "require_parts", "shape_names", "triangles"]
