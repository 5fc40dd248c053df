"""A found effect's value at its bound is stated without a deviation."""

import pytest

from dovetail.report import fitted_text, parameter_text
from fem import Parameter
from fem.effects import EndRelease
from updating import EffectParameter
from updating.diagnosis.findings import Finding, _at_bound


@pytest.mark.parametrize(
    ("value", "bound"),
    [(1e-6, True), (1e18, True), (1e18 * (1 - 1e-9), True), (1.1e-6, False), (1e9, False), (9e17, False)],
)
def test_values_at_either_bound_are_known(value, bound):
    stiffness = Parameter("stiffness", "N/m", 1e6, float("inf"), 1e-6, 1e18, log=True)
    assert _at_bound(stiffness, value) is bound


@pytest.mark.parametrize(("value", "bound"), [(0.0, True), (1e-30, False), (2.0, False)])
def test_a_bound_of_zero_is_reached_by_zero_alone(value, bound):
    mass = Parameter("mass", "kg", 1.0, 0.0, 0.0, float("inf"))
    assert _at_bound(mass, value) is bound


def test_no_deviation_is_said_at_a_bound():
    inside = EffectParameter("stiffness", 147.0, "N·m/rad", 10.0)
    assert fitted_text(inside) == "147 ± 10\u00a0N·m/rad"
    edge = EffectParameter("share", 1.0, "-", 0.3, at_bound=True)
    assert fitted_text(edge) == "1.00 (at its bound)"
    assert parameter_text(edge) == "share 1.00 (at its bound)"


def test_a_found_compliance_is_printed_as_a_stiffness():
    release = EndRelease(name="end", member="beam", end=2, direction="ry", compliance=5e-4, reference=1.0)
    found = Finding(release, (EffectParameter("compliance", 5e-4, "rad/(N·m)", 5e-5),), ())
    assert "stiffness 2000 ± 200 N·m/rad" in repr(found)
