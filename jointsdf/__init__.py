"""Neural signed distance fields that know their parts: one shared SIREN trunk, one segmentation head, one CAD shape."""
