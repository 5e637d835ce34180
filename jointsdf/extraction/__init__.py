"""A field -> a part-labelled triangle mesh, by marching cubes near its zero level set."""

from jointsdf.extraction.extractor import Extraction

__all__ = ["Extraction"]
