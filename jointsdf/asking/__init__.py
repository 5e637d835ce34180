"""Questions to a fitted field: of points, planes, offsets, measures and parts; and their commands."""
