"""STEP files written by hand."""

import importlib.util
from itertools import product

import numpy as np
import pytest

NEEDS_READER = pytest.mark.skipif(not importlib.util.find_spec("cascadio"), reason="cascadio is not installed")
MILLIMETRE = ("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))",)
METRE = ("( LENGTH_UNIT ( ) NAMED_UNIT ( * ) SI_UNIT ( $, .METRE. ) )",)
INCH = (
    *MILLIMETRE,
    "LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(2.54E1),{})",
    "(CONVERSION_BASED_UNIT('INCH',{1})LENGTH_UNIT()NAMED_UNIT(*))",
)
SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
ONE = [((0, 0, 0), (1, 2, 3))]
TOUCHING = [*ONE, ((1, 0, 0), (4, 2, 3))]
Boxes = list[tuple[tuple[float, ...], tuple[float, ...]]]


def step_boxes(boxes: Boxes, unit: tuple[str, ...] = MILLIMETRE, *, painted: int | list[int] | None = None) -> str:
    """A STEP file of boxes, given by two corners each; one side of the first, or several, may be painted."""
    records: list[str] = []

    def add(record: str, *parts: str | list[str] | np.ndarray) -> str:
        """The id of a new record; parts that are lists are written as lists."""
        written = (part if isinstance(part, str) else "(" + ",".join(map(str, part)) + ")" for part in parts)
        records.append(record.format(*written))
        return f"#{len(records)}"

    units: list[str] = []
    for record in unit:
        units.append(add(record, *units))
    units.append(add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))"))
    context = add(
        "(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNIT_ASSIGNED_CONTEXT({})REPRESENTATION_CONTEXT('',''))", units[-2:]
    )
    bodies, faces = [], []
    for corners in (np.array(list(product(*zip(*box, strict=True))), dtype=float) for box in boxes):
        points = [add("CARTESIAN_POINT('',{})", corner) for corner in corners]
        for side in SIDES:
            a, b, c = corners[list(side[:3])]
            normal, along = np.cross(b - a, c - b), b - a
            axes = [add("DIRECTION('',{})", axis / np.linalg.norm(axis)) for axis in (normal, along)]
            plane = add("PLANE('',{})", add("AXIS2_PLACEMENT_3D('',{},{},{})", points[side[0]], *axes))
            bound = add("FACE_OUTER_BOUND('',{},.T.)", add("POLY_LOOP('',{})", [points[corner] for corner in side]))
            faces.append(add("FACE_SURFACE('',{},{},.T.)", [bound], plane))
        bodies.append(add("FACETED_BREP('',{})", add("CLOSED_SHELL('',{})", faces[-6:])))
    if painted is not None:
        paint = add("FILL_AREA_STYLE_COLOUR('',{})", add("COLOUR_RGB('',1.,0.,0.)"))
        paint = add("SURFACE_STYLE_FILL_AREA({})", add("FILL_AREA_STYLE('',{})", [paint]))
        paint = add("SURFACE_STYLE_USAGE(.BOTH.,{})", add("SURFACE_SIDE_STYLE('',{})", [paint]))
        paint = add("PRESENTATION_STYLE_ASSIGNMENT({})", [paint])
        sides = [painted] if isinstance(painted, int) else painted
        items = [add("STYLED_ITEM('',{},{})", [paint], faces[side]) for side in sides]
        add("MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',{},{})", items, context)
    solids = add("FACETED_BREP_SHAPE_REPRESENTATION('',{},{})", bodies, context)
    use = add("APPLICATION_CONTEXT('')")
    thing = add("PRODUCT('','','',{})", [add("PRODUCT_CONTEXT('',{},'')", use)])
    formation = add("PRODUCT_DEFINITION_FORMATION('','',{})", thing)
    thing = add("PRODUCT_DEFINITION('','',{},{})", formation, add("PRODUCT_DEFINITION_CONTEXT('',{},'')", use))
    add("SHAPE_DEFINITION_REPRESENTATION({},{})", add("PRODUCT_DEFINITION_SHAPE('','',{})", thing), solids)
    head = "FILE_DESCRIPTION((''),'2;1');FILE_NAME('','',(''),(''),'','','');FILE_SCHEMA(('AUTOMOTIVE_DESIGN'));"
    body = "".join(f"#{number}={record};\n" for number, record in enumerate(records, 1))
    return f"ISO-10303-21;\nHEADER;{head}ENDSEC;\nDATA;\n{body}ENDSEC;\nEND-ISO-10303-21;\n"
