"""Labels of units against their definitions, and headings of columns that have one."""

import numpy as np
import pytest

from fem.io import G0
from fem.io.units import conversion, density_conversion, heading_of, named_unit, size_of, split_heading

LBF = 4.4482216152605
TIMES = ("time", "t", "timestamp", "elapsedtime")


@pytest.mark.parametrize(
    ("label", "unit", "factor"),
    [
        ("g", "m/s^2", G0),
        ("mg", "m/s^2", 1e-3 * G0),
        ("cm/s²", "m/s^2", 0.01),
        ("gal", "m/s^2", 0.01),
        ("m s^-2", "m/s^2", 1.0),
        ("m·s⁻²", "m/s^2", 1.0),
        ("m/s/s", "m/s^2", 1.0),
        ("m/(s^2)", "m/s^2", 1.0),
        ("meters per second squared", "m/s^2", 1.0),
        ("ft/sec^2", "m/s^2", 0.3048),
        ("milliseconds", "s", 1e-3),
        ("usec", "s", 1e-6),
        ("min", "s", 60.0),
        ("kN", "N", 1e3),
        ("MN", "N", 1e6),
        ("mN", "N", 1e-3),
        ("kN·m", "N m", 1e3),
        ("Nm", "N m", 1.0),
        ("nm", "m", 1e-9),
        ("kNmm", "N m", 1.0),
        ("milli seconds", "s", 1e-3),
        ("millis", "s", 1e-3),
        ("deg/s^2", "rad/s^2", np.pi / 180),
        ("NM", "m", 1e-9),
        ("lbfin", "N m", LBF * 0.0254),
        ("inlb", "N m", LBF * 0.0254),
        ("ftlb", "N m", LBF * 0.3048),
        ("kgfm", "N m", G0),
        ("mNm", "N m", 1e-3),
        ("MNm", "N m", 1e6),
        ("°/S²", "rad/s^2", np.pi / 180),
        ("rad/s", "rad s^-1", 1.0),
        ("kHz", "1/s", 1e3),
        ("MHz", "Hz", 1e6),
        ("mHz", "Hz", 1e-3),
        ("%", "1", 0.01),
        ("-", "1", 1.0),
    ],
)
def test_units_are_converted_by_their_definition(label, unit, factor):
    assert conversion(label, unit) == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize(
    "label", ["", "V", "fortnight", "g/sqrt(Hz)", "(", "m)", "()", "gRMS", "grams", "a" * 100]
)
def test_labels_that_are_no_units(label):
    assert size_of(label) is None


def test_a_unit_of_another_quantity_is_not_converted():
    assert conversion("m", "m/s^2") is None
    assert conversion("rad/s^2", "m/s^2") is None
    assert density_conversion("g", "m/s^2") is None


def test_densities_over_hertz_and_over_rad_per_second():
    assert density_conversion("g^2/Hz", "m/s^2") == pytest.approx(G0**2)
    assert density_conversion("m²/s³", "m/s^2") == pytest.approx(1.0)
    # dω = 2π df
    assert density_conversion("(cm/s^2)^2/(rad/s)", "m/s^2") == pytest.approx(2 * np.pi * 1e-4)
    assert density_conversion("(rad/s²)²/Hz", "rad/s^2") == pytest.approx(1.0)
    assert density_conversion("1/Hz", "1") == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("time", ""),
        ("time_ms", "ms"),
        ("Time ms", "ms"),
        ("Time(milliseconds)", "milliseconds"),
        ("timestamp_us", "us"),
        ("t/ms", "ms"),
        ("Time, ms", "ms"),
        ("time in ms", "ms"),
        ("time2", ""),
        ("elapsed_time_ms", "ms"),
        ("timeMs", "Ms"),
        ("time_millis", "millis"),
        ("Time elapsed", ""),
        ("Time [V]", "V"),
    ],
)
def test_headings_of_times(text, unit):
    found = heading_of(text, TIMES)
    assert found is not None
    assert found.unit == unit


def test_headings_with_other_names():
    assert heading_of("acc [m/s^2]", TIMES) is None
    assert heading_of("t1", TIMES) is None
    assert split_heading("acc (m/(s^2))").unit == "m/(s^2)"
    assert named_unit("tip_kN", ["tip"]).name == "tip"
    assert named_unit("tip_kN", ["tip", "tip_kN"]).unit == ""
    assert named_unit("Base x g", ["base x"]).unit == "g"
