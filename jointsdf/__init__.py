"""Neural signed distance fields that know their parts: one shared SIREN trunk, one segmentation head, one CAD shape."""

from jointsdf.moved_names import install

install()
