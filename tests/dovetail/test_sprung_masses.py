"""``[[sprung_masses]]`` of a study: by stiffness, or tuned to a frequency; written back with new values."""

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from dovetail import StudyError, load_study
from dovetail.file import read_study, with_parameters
from fem import assemble, solve_modes
from tests.studies import study_file
from updating import sensor_rows

STUDY = """
[points]
A = [0, 0, 0]
B = [0, 0, 2]

[members.mast]
from = "A"
to = "B"

[materials.steel]
E = 210e9
rho = 7850.0

[sections.rod]
shape = "circle"
d = 0.04

[[supports]]
point = "A"

[[sprung_masses]]
name = "absorber"
point = "B"
mass = 0.5
"""
TUNED = 'frequency = 7.0\nzeta = 0.1\ndirections = "x"\n'
SPRUNG = "k = { kx = 967.2213, krz = 5.0 }\nc = { cx = 4.398 }\neta = 0.02\ninertia = [0, 0, 0.01]\n"


def read(tmp_path, more):
    return read_study(STUDY + more, tmp_path / "study.toml")


def test_tuned_and_sprung_are_the_same(tmp_path):
    tuned, sprung = (read(tmp_path, text).model.effect("absorber") for text in (TUNED, SPRUNG))
    assert tuned.k == {"x": pytest.approx(0.5 * (14 * np.pi) ** 2)}
    assert tuned.c == {"x": pytest.approx(0.1 * 2 * 0.5 * 14 * np.pi)}
    assert sprung.k["x"] == pytest.approx(tuned.k["x"], rel=1e-6)
    assert sprung.c == {"x": pytest.approx(tuned.c["x"], rel=1e-3)}
    assert (sprung.k["rz"], sprung.eta, sprung.inertia[2, 2]) == (5.0, 0.02, 0.01)


def test_it_splits_the_mode_that_it_is_tuned_to(tmp_path):
    f = solve_modes(assemble(read(tmp_path, TUNED).model), 3).frequency
    alone = solve_modes(assemble(read(tmp_path, TUNED).model.without_effect("absorber")), 2).frequency
    assert f[0] < min(alone[0], 7.0) < max(alone[0], 7.0) < f[2]


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (TUNED + "k = { kx = 1.0 }\n", r"sprung_masses\[1\]\.k: give either frequency and zeta, or k"),
        ('frequency = 7.0\ndirections = "rx"\n', r"tuned in rx; give k and c of rotations"),
        ("c = { cx = 1.0 }\n", "a dashpot in x but no spring there"),
        ("", "has no spring"),
        ("k = { kx = 10.0 }\nkx = 1.0\n", "unknown key"),
    ],
)
def test_what_is_refused(tmp_path, more, message):
    with pytest.raises(StudyError, match=message):
        read(tmp_path, more)


def test_new_values_are_written_where_they_stand(tmp_path):
    values = {("absorber", "kx"): 800.0, ("absorber", "cx"): 3.0, ("absorber", "mass"): 0.6}
    text = with_parameters(STUDY + SPRUNG, values)
    again = read_study(text, tmp_path / "study.toml").model.values()
    assert {key: again[key] for key in values} == values
    assert "[values" not in text
    tuned = read_study(with_parameters(STUDY + TUNED, values), tmp_path / "study.toml").model.values()
    assert {key: tuned[key] for key in values} == values


SENSORS = """
[[sensors]]
name = "tip"
point = "B"
direction = "x"
[[sensors]]
name = "body"
on = "absorber"
direction = "x"
[[excitations]]
sensor = "tip"
[[excitations]]
sensor = "body"
[damping]
modal = 0.0
[frequency]
start = 1.0
stop = 20.0
step = 0.5
"""


def test_a_sensor_on_it_reads_the_transmissibility_of_its_springs(tmp_path):
    """x_body / x_tip = (k + iωc) / (k + iωc - ω²m) for a force on the mast, whatever that is."""
    file = study_file(tmp_path, STUDY + TUNED + SENSORS)
    frf = load_study(file).frf(kind="receptance")
    omega, natural = 2 * np.pi * frf.frequency, 14 * np.pi
    spring = 0.5 * (natural**2 + 0.2j * natural * omega)
    expected = spring / (spring - 0.5 * omega**2)
    assert frf.H[:, 1, 0] / frf.H[:, 0, 0] == pytest.approx(expected, rel=1e-6)
    assert frf.H[:, 1, 0] == pytest.approx(frf.H[:, 0, 1], rel=1e-6)


def test_it_reads_the_centre_of_a_mass_on_an_arm_with_skew_springs(tmp_path):
    """The centre moves with the point as a rigid body, and by the spring s = ω²m e·u / (k - ω²m) along e."""
    skew = "arm = [0, 0, 0.3]\naxes = [[0.6, 0, 0.8], [0, 1, 0]]\nk = { kx = 900.0 }\n"
    study = read(tmp_path, skew + SENSORS)
    system = assemble(study.model)
    rows = sensor_rows(study.model, study.sensors)
    omega, e = 2 * np.pi * 5.0, np.array([0.6, 0, 0.8])
    u = system.Q @ spsolve(system.dynamic_stiffness(omega).tocsc(), system.Q.T @ rows[0].astype(complex))
    tip = 6 * study.model.mesh.point_names["B"]
    centre = u[tip : tip + 3] + np.cross(u[tip + 3 : tip + 6], [0, 0, 0.3])
    s = omega**2 * 0.5 * (e @ centre) / (900.0 - omega**2 * 0.5)
    assert rows[1] @ u == pytest.approx(centre[0] + e[0] * s, rel=1e-9)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ('on = "absorbr"', r"did you mean 'absorber'\?"),
        ('on = "absorber"\npoint = "B"', "leave the place out"),
        ('on = "absorber"\nmass = 0.01', "add its mass there"),
    ],
)
def test_sensors_on_it_that_are_refused(tmp_path, more, message):
    with pytest.raises(StudyError, match=message):
        read(tmp_path, f'{TUNED}[[sensors]]\nname = "s"\ndirection = "x"\n{more}\n')
