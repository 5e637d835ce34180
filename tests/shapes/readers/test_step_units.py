"""Length units of STEP files, as their records tell them and as the CAD kernel then reads them."""

from pathlib import Path

import numpy as np
import pytest
from step_files import METRE, MILLIMETRE, NEEDS_READER, ONE, step_boxes

from jointsdf.errors import InputError
from jointsdf.shapes.readers.step import read_step
from jointsdf.shapes.readers.step_units import read_length_units

KERNEL_ORDER = "(CONVERSION_BASED_UNIT('INCH',{1})LENGTH_UNIT()NAMED_UNIT(*))"


def inch(measure: str, unit: str = KERNEL_ORDER, base: tuple[str, ...] = MILLIMETRE) -> tuple[str, ...]:
    """Records of a unit of one measure; what is right is known from the measure alone."""
    return (*base, measure, unit)


UNITS = {
    "bare": (inch("LENGTH_MEASURE_WITH_UNIT(25.4,{0})"), "in", 0.0254),
    "bare integer": (inch("LENGTH_MEASURE_WITH_UNIT(10,{0})"), "cm", 0.01),
    "typed": (inch("LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),{0})"), "in", 0.0254),
    "exponent and sign": (inch("LENGTH_MEASURE_WITH_UNIT( LENGTH_MEASURE ( +2.54E+1 ) , {0} )"), "in", 0.0254),
    "other measure": (inch("MEASURE_WITH_UNIT(POSITIVE_LENGTH_MEASURE(304.8),{0})"), "ft", 0.3048),
    "mil": (inch("LENGTH_MEASURE_WITH_UNIT(2.54E-2,{0})", KERNEL_ORDER.replace("INCH", "MIL")), "mil", 2.54e-5),
    "of the metre": (inch("LENGTH_MEASURE_WITH_UNIT(0.9144,{0})", base=METRE), "yd", 0.9144),
    "complex measure": (
        inch("(LENGTH_MEASURE_WITH_UNIT()MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),{0}))"), "in", 0.0254,
    ),
    "length unit first": (
        inch("LENGTH_MEASURE_WITH_UNIT(25.4,{0})", "(LENGTH_UNIT()NAMED_UNIT(*)CONVERSION_BASED_UNIT('INCH',{1}))"),
        "in", 0.0254,
    ),
    "conversion last, spaced": (
        inch("LENGTH_MEASURE_WITH_UNIT(25.4,{0})",
             "( NAMED_UNIT ( * )\n LENGTH_UNIT ( ) CONVERSION_BASED_UNIT ( 'INCH' , {1} ) )"), "in", 0.0254,
    ),
    "si unit first": (("(SI_UNIT(.CENTI.,.METRE.)LENGTH_UNIT()NAMED_UNIT(*))",), "cm", 0.01),
    "simple records": (
        ("SI_UNIT(*,.MILLI.,.METRE.)", "MEASURE_WITH_UNIT(25.4,{0})", "CONVERSION_BASED_UNIT(*,'INCH',{1})"),
        "in", 0.0254,
    ),
    "foot of inches": (
        (*inch("LENGTH_MEASURE_WITH_UNIT(25.4,{0})"), "LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(12.),{2})",
         "(CONVERSION_BASED_UNIT('FOOT',{3})LENGTH_UNIT()NAMED_UNIT(*))"), "ft", 0.3048,
    ),
    "words in strings and comments": (
        inch("/* LENGTH_MEASURE_WITH_UNIT(1.,{0}); don't */LENGTH_MEASURE_WITH_UNIT(25.4,{0})",
             "(CONVERSION_BASED_UNIT('SI_UNIT($,.METRE.);#1=''x'' /*',{1})LENGTH_UNIT()NAMED_UNIT(*))"), "in", 0.0254,
    ),
    **{prefix: ((f"(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.{prefix}.,.METRE.))",), name, size)
       for prefix, name, size in (("MICRO", "um", 1e-6), ("NANO", "nm", 1e-9), ("KILO", "km", 1e3),
                                  ("MEGA", "1000000m", 1e6))},
}  # fmt: skip


MISREAD = ("bare", "complex measure", "conversion last, spaced", "simple records", "foot of inches", "NANO")  # or crash


@pytest.mark.parametrize("key", UNITS)
def test_the_unit_is_found_wherever_the_records_put_it(key: str, caplog: pytest.LogCaptureFixture) -> None:
    records, _, metres = UNITS[key]
    head, mark, body = step_boxes(ONE, records).partition("DATA;\n")
    lines = body.partition("ENDSEC;")[0].replace(";\n#", ";\n\0#").split("\0")  # one record each
    for content in (lines, lines[::-1]):
        assert read_length_units(Path("a.step"), "".join([head, mark, *content]).encode()).metres == pytest.approx(
            metres
        )
    assert not caplog.records


@NEEDS_READER
@pytest.mark.parametrize("key", MISREAD)
def test_coordinates_are_in_the_unit_of_the_file(key: str, caplog: pytest.LogCaptureFixture) -> None:
    records, name, metres = UNITS[key]
    mesh = read_step(Path("box.step"), step_boxes([((5, 6, 7), (6, 8, 10))], records).encode())
    assert mesh.unit is not None
    assert (mesh.unit.name, mesh.unit.metres, mesh.unit.known) == (name, pytest.approx(metres, rel=1e-12), True)
    np.testing.assert_allclose(mesh.vertices.min(axis=0), [5, 6, 7], rtol=1e-6)
    np.testing.assert_allclose(mesh.vertices.max(axis=0), [6, 8, 10], rtol=1e-6)
    assert not caplog.records


UNIT_RECORDS = {
    "#1=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.CENTI.,.METRE.))": 1e-2,
    "#1=(NAMED_UNIT(*)SI_UNIT( $ , .METRE. )\nLENGTH_UNIT())": 1.0,
    "#9=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(12.),#8);#8=(CONVERSION_BASED_UNIT('INCH',#7)LENGTH_UNIT());"
    "#7=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(0.02539999999999999897),#6);#6=(LENGTH_UNIT()SI_UNIT($,.METRE.));"
    "#1=(CONVERSION_BASED_UNIT('a; #3 ''foot''',#9)LENGTH_UNIT())": 0.3048,
    "#9=(LENGTH_MEASURE_WITH_UNIT()MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),#8));#8=(LENGTH_UNIT()SI_UNIT(.MILLI.,.METRE.));"
    "/* #1=x; 'y */ #1=(LENGTH_UNIT()CONVERSION_BASED_UNIT('INCH',#9))": 0.0254,
}  # fmt: skip
CONTEXT = ";#3=(PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.));#4=(GLOBAL_UNIT_ASSIGNED_CONTEXT((#3,#1)));"


@pytest.mark.parametrize(("records", "metres"), UNIT_RECORDS.items())
def test_length_unit_of_the_file(records: str, metres: float, caplog: pytest.LogCaptureFixture) -> None:
    assert read_length_units(Path("a.step"), (records + CONTEXT).encode()).metres == pytest.approx(metres, rel=1e-12)
    assert not caplog.records


NOT_UNDERSTOOD = {
    "itself": "#1=(LENGTH_UNIT()CONVERSION_BASED_UNIT('A',#2));#2=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(2.),#1)",
    **{
        size: "#1=(LENGTH_UNIT()CONVERSION_BASED_UNIT('NIL',#2));#5=(LENGTH_UNIT()SI_UNIT($,.METRE.));"
        f"#2=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE({size}),#5)"
        for size in ("0.", "-25.4", "1.E400")
    },
    "prefix": "#1=(LENGTH_UNIT()SI_UNIT(.SMALL.,.METRE.))",
    "no measure": "#1=(LENGTH_UNIT()CONVERSION_BASED_UNIT('INCH',#99))",
    "a name alone": "#1=(CONTEXT_DEPENDENT_UNIT('INCH')LENGTH_UNIT()NAMED_UNIT(*))",
}


@pytest.mark.parametrize("key", NOT_UNDERSTOOD)
def test_a_unit_that_is_not_understood_is_one_line_that_shows_it(key: str) -> None:
    with pytest.raises(
        InputError, match=r"^a.step: its length unit is not understood, #1=\([^\n]*export it again"
    ) as one:
        read_length_units(Path("a.step"), (NOT_UNDERSTOOD[key] + CONTEXT).encode())
    assert "\n" not in str(one.value)


@pytest.mark.parametrize("records", ["", "#1=(MASS_UNIT()NAMED_UNIT(*)SI_UNIT(.KILO.,.GRAM.))"])
def test_no_length_unit_means_millimetres_and_is_said(records: str, caplog: pytest.LogCaptureFixture) -> None:
    units = read_length_units(Path("a.step"), (records + CONTEXT).encode())
    assert (units.metres, units.known) == (1e-3, False)
    assert "no length unit found" in caplog.text


def test_of_several_units_the_one_used_most(caplog: pytest.LogCaptureFixture) -> None:
    units = "#1=(LENGTH_UNIT()SI_UNIT($,.METRE.));#2=(LENGTH_UNIT()SI_UNIT(.MILLI.,.METRE.));"
    contexts = "".join(f"#{9 + i}=(GLOBAL_UNIT_ASSIGNED_CONTEXT((#{unit})));" for i, unit in enumerate((1, 2, 2)))
    assert read_length_units(Path("a.step"), (units + contexts).encode()).metres == 1e-3
    assert "several length units" in caplog.text


def test_a_file_in_millimetres_is_handed_on_as_it_is() -> None:
    data = step_boxes(ONE).encode()
    assert read_length_units(Path("a.step"), data).content is data
