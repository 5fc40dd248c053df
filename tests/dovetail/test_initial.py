"""Initial motions of responses in time, by the study file and by options."""

import json

import numpy as np
import pytest

from dovetail import main
from tests.studies import study_file

CANTILEVER = """
[points]
A = [0, 0, 0]
B = [2, 0, 0]
[members.bar]
from = "A"
to = "B"
section = { A = 1e-3, Iy = 1e-6, Iz = 2e-6, J = 1e-6 }
theory = "euler-bernoulli"
elements = 4
[materials.steel]
E = 200e9
rho = 1.0
[[supports]]
point = "A"
[[masses]]
name = "tip"
point = "B"
mass = 50.0
[[loads]]
case = "pull"
point = "B"
force = [0, 0, 1500.0]
[damping]
modal = 0.0
[[sensors]]
name = "tip"
point = "B"
direction = "z"
"""
STIFFNESS, MASS = 3 * 200e9 * 1e-6 / 2**3, 50.0
"""Of the tip, against which the bar of 2 g has next to no mass: its share is 33/140."""
OMEGA = np.sqrt(STIFFNESS / (MASS + 33 / 140 * 0.002))
STEPS = ("--step", "0.002", "--duration", "0.2", "--max", "2000")


@pytest.fixture
def study(tmp_path):
    return study_file(tmp_path, CANTILEVER)


def swing(capsys, *arguments):
    """Return the times and displacements of the tip."""
    assert main(["transient", *(str(a) for a in (*arguments, *STEPS)), "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    return np.array(found["time_s"]), np.array(found["responses"]["tip"]["displacement"])


def refused(capsys, *arguments):
    assert main(["transient", *(str(a) for a in (*arguments, *STEPS))]) == 2
    return capsys.readouterr().err


def test_a_mass_with_a_velocity_swings_as_one_oscillator(study, capsys):
    t, u = swing(capsys, study, "--velocity", "B:z=0.3")
    np.testing.assert_allclose(u, 0.3 / OMEGA * np.sin(OMEGA * t), atol=2e-5 * 0.3 / OMEGA)
    study.write_text(CANTILEVER + '[[initial]]\npoint = "B"\nvelocity = { z = 0.3 }\n', encoding="utf-8")
    np.testing.assert_allclose(swing(capsys, study)[1], u, rtol=1e-12)
    _, still = swing(capsys, study, "--velocity", "B:z=0")  # the option replaces the study's
    assert not still.any()


def test_a_displacement_is_let_go_as_by_the_force_that_gives_it(study, capsys):
    t, u = swing(capsys, study, "--displacement", "B:z=0.02")
    np.testing.assert_allclose(u, 0.02 * np.cos(OMEGA * t), atol=2e-5 * 0.02)
    _, released = swing(capsys, study, "--release", "pull")
    np.testing.assert_allclose(released, u * 1500 / STIFFNESS / 0.02, atol=1e-12)


def test_displacements_that_depend_on_each_other_are_refused(study, capsys):
    link = '[[rigid_links]]\npoint = "B"\ndependents = [{ member = "bar", position = 1.5 }]\n'
    study.write_text(
        CANTILEVER + link + '[[initial]]\npoint = { member = "bar", position = 1.5 }\n'
        "displacement = { y = 0.1, rz = 0.1 }\n",
        encoding="utf-8",
    )
    both = ("--displacement", "B:y=0.2", "--displacement", "B:rz=0.1")
    assert "do not allow the displacements of" in refused(capsys, study, *both)


def test_members_of_a_free_structure_turn_as_one_body(study, capsys):
    free = CANTILEVER.replace("[[supports]]\npoint", '[[masses]]\nname = "root"\nmass = 1.0\npoint')
    text = "[[initial]]\nvelocity = { z = 0.5, ry = 0.1 }\nabout = [0.4, 0, 0]\n"
    study.write_text(free + text, encoding="utf-8")
    t, u = swing(capsys, study)
    np.testing.assert_allclose(u, (0.5 - 0.1 * (2 - 0.4)) * t, atol=1e-9)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('point = "A"\nvelocity = { z = 1 }', "'A' has an initial motion in z, in which it is held"),
        ('point = "B"\nvelocity = { w = 1 }', "unknown key; allowed are rx, ry, rz, x, y, z"),
        ('point = "B"\nvelocity = { z = "fast" }', "'fast' is not allowed; a number [m/s] is needed"),
        ('point = "B"', "give displacement, velocity or both"),
        ("displacement = { z = 0.1 }", "it is that of a point"),
        ('member = "rod"\nvelocity = { z = 1 }', "there is no member 'rod'; allowed are bar"),
        ('point = "B"\nvelocity = 3', "3 is not allowed; a table, [velocity], is needed"),
    ],
)
def test_motions_that_cannot_be_meant_are_refused(study, capsys, text, message):
    study.write_text(f"{CANTILEVER}[[initial]]\n{text}\n", encoding="utf-8")
    assert message in refused(capsys, study)


def test_options_that_cannot_be_meant_are_refused(study, capsys):
    assert "PLACE:DIRECTION=VALUE is needed" in refused(capsys, study, "--velocity", "B=1")
    assert "there is no place 'C'; allowed are A, B, bar" in refused(capsys, study, "--velocity", "C:z=1")
    assert "there is no place 'bar'; allowed are A, B" in refused(capsys, study, "--displacement", "bar:z=1")
    both = ("--release", "pull", "--displacement", "B:z=1")
    assert "give one of them" in refused(capsys, study, *both)
