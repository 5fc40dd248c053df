"""Modes and sensors that would tell two explanations of measured modes apart."""

import re
from dataclasses import replace

import pytest

from fem import AddedMass, assemble, first_modes
from fem.effects import StiffnessLoss
from tests.frames import beam, fix
from updating.diagnosis import BAND_BEYOND
from updating.diagnosis.mode_separation import next_measurements

CANTILEVER = beam(24).with_effect(fix(0))


def with_mass(point, mass):
    return CANTILEVER.with_effect(AddedMass(name="mass", point=point, mass=mass))


def named(said):
    """Return the frequencies of the modes that proposals name [Hz]."""
    return [float(f) for text in said for f in re.findall(r"(?:near|at) ([\d.]+) Hz", text)]


@pytest.mark.parametrize("n", [3, 5])
def test_modes_are_named_as_far_as_the_test_reaches(n):
    """The two masses differ more in higher modes than the test reaches."""
    models = (with_mass(24, 0.05), with_mass(12, 0.4))
    top = float(first_modes(assemble(CANTILEVER), n).frequency[-1])
    here = named(next_measurements(CANTILEVER, models, n, top))
    assert 0 < max(here) <= BAND_BEYOND * top
    assert max(named(next_measurements(CANTILEVER, models, n, 10 * top))) > BAND_BEYOND * top


def test_one_explanation_and_two_that_are_alike_need_nothing_more():
    assert next_measurements(CANTILEVER, (CANTILEVER,), 3, 100.0) == ()
    assert next_measurements(CANTILEVER, (CANTILEVER, CANTILEVER), 3, 100.0) == ()


def test_models_that_are_no_structure_are_not_compared():
    losses = [
        replace(StiffnessLoss.propose(CANTILEVER)[0], name=name, loss=0.6, position=0.3) for name in "ab"
    ]
    assert next_measurements(CANTILEVER, (CANTILEVER.with_effect(*losses), CANTILEVER), 3, 100.0) == ()
