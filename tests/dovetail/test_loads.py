"""Loads of a study file, and what becomes of them."""

import numpy as np
import pytest

from dovetail import StudyError
from fem import LineLoad, LoadCase, assemble, envelope, solve_static
from tests.studies import study_from

BEAM = """
[points]
A = [0, 0, 0]
B = [2, 0, 0]

[members.bar]
from = "A"
to = "B"
section = { A = 1e-3, Iy = 2e-6, Iz = 1e-6, J = 1e-6 }
theory = "euler-bernoulli"

[materials.steel]
E = 200e9
rho = 7850

[[supports]]
point = "A"
"""
HELD = '[[supports]]\npoint = "B"\nfixed = "z"\n'
EI, L = 200e9 * 2e-6, 2.0


def load(tmp_path, text):
    return study_from(tmp_path, BEAM + text)


def tip(solution, direction=2, case=0):
    point = solution.model.mesh.point_names["B"]
    return solution.displacements[6 * point + direction, case]


@pytest.mark.parametrize(
    ("entry", "expected"),
    [
        ('point = "B"\nforce = [0, 0, -300]', -300 * L**3 / (3 * EI)),
        ('point = "B"\nmoment = [0, 500, 0]', -500 * L**2 / (2 * EI)),
        ('point = { member = "bar", position = 0.5 }\nforce = [0, 0, -300]', -300 * 0.25 * 5.5 / (6 * EI)),
        ('member = "bar"\nforce_per_length = [0, 0, -80]', -80 * L**4 / (8 * EI)),
        (
            'member = "bar"\nforce_per_length = [0, 0, 0]\nforce_per_length2 = [0, 0, -80]',
            -11 * 80 * L**4 / (120 * EI),
        ),
        ("gravity = [0, 0, -10]", -78.5 * L**4 / (8 * EI)),
        ("temperature = 0\nexpansion = 1e-5\ngradient_z = 100", -1e-3 * L**2 / 2),
    ],
)
def test_each_kind_of_load_has_its_closed_form(tmp_path, entry, expected):
    study = load(tmp_path, f"[[loads]]\n{entry}\n")
    assert tip(study.static()) == pytest.approx(expected, rel=1e-9)


def test_strain_and_temperature_stretch_the_bar(tmp_path):
    text = '[[loads]]\ncase = "a"\nmember = "bar"\nstrain = 2e-4\n[[loads]]\ncase = "b"\ntemperature = 20\n'
    found = load(tmp_path, text + "expansion = 1e-5\n").static()
    assert tip(found, 0) == pytest.approx(2e-4 * L)
    assert tip(found, 0, 1) == pytest.approx(2e-4 * L)


def test_part_of_a_member_and_local_axes(tmp_path):
    entry = '[[loads]]\nmember = "bar"\nforce_per_length = [0, 0, -80]\nstart = 0.5\nstop = "end"\n'
    study = load(tmp_path, entry + 'axes = "local"\n')
    own = LoadCase(members=(LineLoad(member="bar", force1=[0, 0, -80], axes="local", start=0.5),))
    expected = solve_static(assemble(study.model), own)
    np.testing.assert_array_equal(study.static().displacements, expected.displacements)


def test_settlement_moves_a_support(tmp_path):
    study = load(tmp_path, HELD + '[[loads]]\nsupport = "B"\nsettlement = { z = -0.002 }\n')
    found = study.static()
    assert tip(found) == pytest.approx(-0.002)
    assert found.reactions["B", "z"] == pytest.approx(-3 * EI * 0.002 / L**3)


CASES = """
[[loads]]
case = "dead"
gravity = [0, 0, -10]
[[loads]]
case = "dead"
member = "bar"
strain = 1e-4
[[loads]]
case = "live"
point = "B"
force = [10, 0, -300]
[[loads]]
case = "live"
member = "bar"
force_per_length = [0, 5, 0]
force_per_length2 = [0, 9, 0]
[[loads]]
case = "sink"
support = "B"
settlement = { z = -0.002 }
[[combinations]]
name = "design"
factors = { dead = 1.35, live = -1.5, sink = 0.5 }
[[envelopes]]
of = ["live", "design"]
"""


def test_a_combination_is_the_sum_of_its_cases(tmp_path):
    study = load(tmp_path, HELD + CASES)
    assert study.loads.names == ("dead", "live", "sink", "design")
    found = study.static()
    factors = np.array([1.35, -1.5, 0.5])
    for values in (
        found.displacements,
        found.line_forces,
        found.internal_forces("bar", [0.3, 1.7]),
        found.displacements_along("bar", [0.3, 1.7]),
        np.array(list(found.reactions.values())),
    ):
        expected = values[..., :3] @ factors
        np.testing.assert_allclose(values[..., 3], expected, atol=1e-9 * np.abs(expected).max())
    one = study.static("design")
    assert one.cases == ("design",)
    np.testing.assert_allclose(one.displacements[:, 0], found.displacements[:, 3], rtol=1e-9, atol=1e-15)


def test_an_envelope_names_the_cases_of_its_extremes(tmp_path):
    found = load(tmp_path, HELD + CASES).static("live", "design")
    forces = found.internal_forces("bar", [0.0, 1.0])
    of = envelope(forces)
    np.testing.assert_array_equal(of.low, forces.min(axis=2))
    rows, columns = np.indices(of.high.shape)
    np.testing.assert_array_equal(forces[rows, columns, of.high_case], of.high)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[[loads]]\ngravity = [0, 0, -1]\nstrain = 1", "strain and gravity are given"),
        ('[[loads]]\ncase = "a"', "which one of point, .*names; none is given"),
        ('[[loads]]\npoint = "B"', r"needs force \[N\], moment \[N·m\] or both"),
        ('[[loads]]\nmember = "bat"\nforce_per_length = [0, 0, 1]', "did you mean 'bar'"),
        ('[[loads]]\nmember = ["bar", "bar"]\nstrain = 1e-4', "would be counted twice"),
        (
            '[[loads]]\nmember = "bar"\nforce_per_length = [0, 0, 1]\nstart = 1\nstop = 0.5',
            "does not lie behind",
        ),
        ('[[loads]]\nsupport = "C"\nsettlement = { z = 1e-3 }', "no support or joint 'C'"),
        ('[[loads]]\nsupport = "B"\nsettlement = { x = 1e-3 }', "'B' does not hold x; it holds z"),
        ('[[loads]]\nsupport = "B"\nsettlement = { }', "no direction is moved"),
        ("[[loads]]\ntemperature = 20", "'expansion' is missing"),
        ("[[loads]]\ngravity = [0, 0, -1]\nforce = [0, 0, 1]", "unknown key"),
        ('[[combinations]]\nname = "u"\nfactors = { dead = 1 }', "no load case 'dead'"),
        (
            '[[loads]]\ngravity = [0, 0, -1]\n[[combinations]]\nname = "load"\nfactors = { load = 1 }',
            "must differ",
        ),
        ('[[envelopes]]\nname = "e"', "no loads for an envelope"),
        ('[[loads]]\ngravity = [0, 0, -1]\n[[envelopes]]\nof = ["x"]', "no load case or combination 'x'"),
    ],
)
def test_loads_that_cannot_be_meant_are_refused(tmp_path, text, message):
    with pytest.raises(StudyError, match=message) as caught:
        load(tmp_path, f"{HELD}{text}\n")
    assert str(caught.value).startswith("study.toml, line")


def test_a_study_without_loads_says_so(tmp_path):
    study = load(tmp_path, "")
    with pytest.raises(StudyError, match="has no loads"):
        study.static()
    with pytest.raises(StudyError, match="no load case or combination 'wind'"):
        load(tmp_path, "[[loads]]\ngravity = [0, 0, -1]\n").static("wind")
