"""The places where a model fails: by the best effect at each."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from fem.declarations import Site
from fem.effects import effect_classes
from tests.studies import fit_problem
from updating import locate
from updating.diagnosis import localisation


@pytest.fixture(scope="module")
def problem(study):
    return fit_problem(study)


def test_a_joint_without_its_stiffness_is_the_first_place(problem):
    where = locate(problem, problem.nominal())
    assert where.places[0][0] == "joint J"  # where the stiffness is missing
    assert where.places[0][1] > max(where.members.values())


def test_errors_of_sensors_are_those_of_the_corrected_data(problem, monkeypatch):
    """The measurement keeps the labels as they were read; the data of the fit have them set right."""
    monkeypatch.setattr(localisation, "propose", lambda *how: ())
    fitted = problem.nominal()
    order = np.roll(np.arange(len(problem.data.measurement.sensors)), 1)
    frf = problem.data.measurement.frf
    as_read = problem.data.measurement.with_frf(replace(frf, H=2 * frf.H[:, order]))
    right = replace(problem, data=replace(problem.data, measurement=as_read))
    where, expected = locate(right, fitted), locate(problem, fitted)
    np.testing.assert_allclose(where.by_sensor_db, expected.by_sensor_db, rtol=1e-12)
    assert where.by_sensor_db.max() > 1.2 * where.by_sensor_db.min()


def shares(members, places):
    blank = np.zeros(0)
    return localisation.Localisation((), (), blank, blank, blank, blank, members, places, {}, "")


def test_shares_near_zero_do_not_say_where():
    assert not shares({"beam": 0.006}, (("support foot", 0.013),)).says_where
    assert not shares({}, ()).says_where
    assert shares({"beam": 0.006}, (("joint bolt", 0.4),)).says_where


def test_a_large_effect_that_no_small_change_explains_is_told(problem, monkeypatch):
    monkeypatch.setattr(localisation, "N_LINES", 20)
    monkeypatch.setattr(localisation, "LEAST_SHARE", 1.0)
    where = locate(problem, problem.nominal())
    assert not where.says_where
    assert where.note == localisation.NOWHERE


def test_a_joint_with_a_comma_in_its_name_is_a_place_with_its_whole_name():
    one = effect_classes()["joint_structural_damping"](name="eta", joint="leg, left", loss_factor=0.1)
    assert localisation.place_named(one) == ("joint leg, left", False)


def test_words_of_a_place_keep_their_parts_between_processes():
    where = pickle.loads(pickle.dumps(Site("member rib, left", 0.6, "rz")))
    assert where == "member rib, left at 0.600 m, rz"
    assert (where.thing, where.at, where.detail) == ("member rib, left", "0.600 m", "rz")
