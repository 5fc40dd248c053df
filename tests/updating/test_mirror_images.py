"""Explanations of measured modes that a symmetry of the structure makes of one another."""

import numpy as np
import pytest

from dovetail.report.found_lines import found_lines
from fem import assemble, first_modes
from tests.frames import beam, fix
from updating import (
    EFFECT,
    ModeTargets,
    Nuisance,
    Sensor,
    diagnose_modes,
    place_sensors,
    propose,
    sensor_rows,
)

SENSORS = tuple(
    Sensor(f"{d}{x}", np.array([x, 0.0, 0.0]), np.eye(3)["xyz".index(d)])
    for x in (0.2, 0.3, 0.6)
    for d in "yz"
)
E = Nuisance("frame", "E:steel", 0.02)


def clamped(*points):
    """Return a beam of 1 m that is clamped at some of its ends."""
    model = beam(10, effects=tuple(fix(p, name=f"end {p}") for p in points), theory="timoshenko")
    return model.with_mesh(place_sensors(model.mesh, SENSORS))


def diagnosed(model, kind, name, *, shapes=False, n=6, **values):
    (effect,) = (e for e in propose(model, [kind]) if e.name == name)
    modes = first_modes(assemble(model.with_effect(effect.with_values(**values))), n)
    rng = np.random.default_rng(3)
    f = modes.frequency[:n] * (1 + 1e-3 * rng.standard_normal(n))
    known = {}
    if shapes:
        known = {"shapes": sensor_rows(model, SENSORS) @ modes.shapes[:, :n], "sensors": SENSORS}
    return diagnose_modes(model, ModeTargets.of(f, 1e-3, **known), [E], kinds=[kind])


def test_mass_on_a_symmetric_beam_has_a_mirror_image():
    found = diagnosed(clamped(0, 1), "point_mass", "point_mass:beam", mass=0.3, position=0.3)
    (image,) = found.images
    (mirrored,), (mass,) = image.effects, found.found
    assert mass.position + mirrored.position == pytest.approx(1.0, abs=0.01)
    assert min(mass.position, mirrored.position) == pytest.approx(0.3, abs=0.02)
    assert found.verdict == EFFECT
    assert found.sure
    assert found.reported.probability < 0.6 < found.reported.probability + image.probability
    assert "these data cannot tell which is there" in found.reason
    (line,) = (text for text in found_lines(found) if "or its mirror image, " in text)
    assert line.strip().startswith("or its mirror image, point mass: member beam at ")
    assert "these data cannot tell which. One sensor would: the shape at" in line
    assert all(text.startswith("the shape at") for text in found.next_measurements)


def test_soft_supports_at_either_end_are_mirror_images():
    name = "support_flexibility:end 0.ry"
    found = diagnosed(clamped(0, 1), "support_flexibility", name, stiffness=400.0)
    names = [e.name for x in (found.reported, *found.images) for e in x.effects]
    assert sorted(names) == [name, "support_flexibility:end 1.ry"]


def test_beam_without_symmetry_has_no_mirror_image():
    found = diagnosed(clamped(0), "point_mass", "point_mass:beam", mass=0.3, position=0.5)
    assert found.verdict == EFFECT
    assert found.images == ()


def test_measured_shapes_tell_which_of_the_images_is_there():
    known = {"shapes": True, "mass": 0.3, "position": 0.3}
    found = diagnosed(clamped(0, 1), "point_mass", "point_mass:beam", **known)
    assert found.images == ()
    assert found.found[0].position == pytest.approx(0.3, abs=0.02)
