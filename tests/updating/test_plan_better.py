"""Better tests than a planned one: chosen sensors and forces, and second tests of a changed structure."""

import numpy as np
import pytest

from fem import Relevant
from tests.frames import fix
from tests.updating.test_plan import BAND, channels, halves, mapped
from updating.plan import with_masses, without_supports
from updating.plan.choose import N_LINES, choose
from updating.plan.perturbed import perturbed
from updating.plan.planned import planned_measurement

ACROSS = (0.0, 1.0, 0.0)


def chosen(sensors, forces, n_sensors, n_forces=None, **more):
    how = {"kinds": ("point_mass",), "sizes": Relevant(masses=0.02), "model_error": 0.0, "discrepancy": 0.0}
    return choose(halves(), sensors, forces, BAND, n_sensors, n_forces, **how | more)


def test_a_sensor_beside_the_middle_is_chosen_where_masses_must_be_told_from_their_mirror_images():
    """With the force in the middle, one there tells no mass from its mirror image."""
    found = chosen(channels("s", (0.0, 0.3)), channels("f", (0.0,)), 1)
    assert [s.name for s in found.sensors] == ["s1"]
    assert found.curve[-1] > 0


def test_sensors_and_forces_across_the_motion_are_not_chosen():
    """Small masses need all that there is."""
    along, across = channels("s", (-0.4, 0.15, 0.45)), channels("t", (-0.3, 0.2, 0.35), ACROSS)
    forces = (*channels("g", (0.1,), ACROSS), *channels("f", (0.1,)))
    found = chosen((*across, *along), forces, 3, 1, sizes=Relevant(masses=0.001))
    assert {s.name for s in found.sensors} == {s.name for s in along}
    assert [f.name for f in found.excitations] == ["f0"]


def test_of_many_places_forces_are_chosen_by_what_some_sensors_see(monkeypatch):
    """What all places see with all forces would not fit into memory."""
    seen = []

    def recorded(model, sensors, forces, *args, **more):
        seen.append((len(sensors), len(forces)))
        return planned_measurement(model, sensors, forces, *args, **more)

    monkeypatch.setattr("updating.plan.choose.planned_measurement", recorded)
    monkeypatch.setattr("updating.plan.choose.MOST_RESIDUALS", 2 * 2 * N_LINES)
    along = channels("s", (-0.4, -0.1, 0.15, 0.45))
    forces = (*channels("g", (0.1,), ACROSS), *channels("f", (0.1,)))
    found = chosen(along, forces, 3, 1, sizes=Relevant(masses=0.001))
    assert seen == [(2, 2), (4, 1)]
    assert [f.name for f in found.excitations] == ["f0"]
    assert len(found.sensors) == 3


def test_more_sensors_name_no_fewer_effects_as_they_are_added():
    found = chosen(channels("s", (-0.45, -0.2, 0.05, 0.3)), channels("f", (0.1,)), 4)
    assert len(found.curve) == 4
    assert (np.diff(found.curve) >= -0.05).all()
    assert found.share >= found.curve[-1] - 1e-9


def test_sensors_of_the_test_stay_beside_those_that_are_added():
    """One beside the middle is worth more beside one in the middle than a second one there."""
    kept, possible = channels("k", (0.0,)), channels("s", (0.0, 0.3))
    found = chosen(possible, channels("f", (0.0,)), 1, kept=kept)
    assert [s.name for s in found.kept] == ["k0"]
    assert [s.name for s in found.sensors] == ["s1"]
    both = chosen((*kept, possible[1]), channels("f", (0.0,)), 2)
    assert found.curve.shape == (1,)
    assert found.without < found.share == pytest.approx(both.share)


def test_no_more_can_be_chosen_than_there_are():
    with pytest.raises(ValueError, match="3 sensors are to be chosen from 2"):
        chosen(channels("s", (0.0, 0.3)), channels("f", (0.0,)), 3)
    with pytest.raises(ValueError, match="2 excitations are to be chosen from 1"):
        chosen(channels("s", (0.0, 0.3)), channels("f", (0.0,)), 1, 2)


def test_a_known_mass_beside_the_middle_tells_mirror_images_apart():
    """In the test alone they are one; a mass in the middle would leave them so."""
    plan = mapped(halves(), (0.0,), (0.0,), kinds=("point_mass",))
    pairs = [
        (o, o.visible.rival)
        for o in plan.relevant
        if o.visible.alike > 1 - 1e-6 and o.relevant.member == "left"
    ][1:4]
    found = perturbed(plan, with_masses(halves(), 0.2), (), pairs, model_error=0.0)
    assert len(found) == len(pairs)
    for each in found:
        assert each.alike[0] == pytest.approx(1.0, abs=1e-6)
        assert each.alike[1] < 0.995
        assert not each.change.endswith(("left at 0.5 m", "right at 0 m"))  # the middle
        assert each.ratio > 1


def test_a_released_support_tells_an_effect_from_its_mirror_image():
    """Held at both ends alike, a beam hides on which half a mass is; held at one end alone it does not."""
    model = halves()
    ends = [model.mesh.nearest_point([x, 0.0, 0.0])[0] for x in (-0.5, 0.5)]
    held = model.with_effect(fix(ends[0])).with_effect(fix(ends[1]))
    plan = mapped(held, (0.0,), (0.0,), kinds=("point_mass",), sizes=Relevant(masses=0.1))
    pairs = plan.twins[:2]
    assert all(o.visible.alike > 0.9999 for o, _ in pairs)
    for each in perturbed(plan, without_supports(held), (), pairs, model_error=0.0):
        assert each.change.startswith("support ")
        assert each.alike[1] < 0.995
        assert each.ratio > 1
