"""``[mesh] plane``: a planar study, and what it refuses, with file, line and key."""

import numpy as np
import pytest

import dovetail
from dovetail import StudyError
from dovetail.file import read_study
from fem import FRF
from fem.io import write_npz
from tests.frames import FLAT_STEEL

STUDY = f"""
[mesh]
plane = "xz"
element_size = 0.1

[points]
A = [0, 0, 0]
B = [0, 0, 0.6]
C = [0.8, 0, 0.6]

[members.post]
from = "A"
to = "B"

[members.arm]
from = "B"
to = "C"
{FLAT_STEEL}
[[supports]]
point = "A"
name = "foot"

[[sensors]]
name = "tip"
point = "C"
direction = "z"

[[excitations]]
sensor = "tip"

[[loads]]
point = "C"
force = [0, 0, -10.0]

[damping]
modal = 0.01

[frequency]
start = 5
stop = 200
step = 1
"""


def read(tmp_path, *changes):
    text = STUDY
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    return read_study(text, tmp_path / "study.toml")


def test_a_planar_study_has_the_modes_of_its_plane(tmp_path):
    (tmp_path / "flat.toml").write_text(STUDY, encoding="utf-8")
    (tmp_path / "space.toml").write_text(STUDY.replace('plane = "xz"\n', ""), encoding="utf-8")
    flat, space = (dovetail.load_study(tmp_path / f"{name}.toml") for name in ("flat", "space"))
    found = flat.solve_modes(3).frequency
    every = space.solve_modes(9)
    inside = every.frequency[np.abs(every.shapes[1::6]).max(axis=0) < 1e-9]
    np.testing.assert_allclose(found, inside[:3], rtol=1e-8)
    assert "all points move in the plane xz alone: x, z, ry" in flat.assumptions
    np.testing.assert_allclose(flat.frf().H, space.frf().H, rtol=1e-7, atol=1e-12)
    load = [s.static() for s in (flat, space)]
    np.testing.assert_allclose(load[0].displacements, load[1].displacements, atol=1e-12)


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        (
            'direction = "z"',
            'direction = "y"',
            r"sensors\[1\]\.direction: 'tip' has the direction \(0, 1, 0\)",
        ),
        ("force = [0, 0, -10.0]", "force = [0, 1, -10.0]", r"loads\[1\]\.force: its component y is out of"),
        ("force = [0, 0, -10.0]", "moment = [1, 0, 0]", r"loads\[1\]\.moment: a moment about an axis in"),
        (
            'point = "C"\nforce = [0, 0, -10.0]',
            'support = "foot"\nsettlement = { y = 0.1 }',
            r"loads\[1\]\.settlement\.y: it is out of the model's plane xz; allowed are x, z, ry",
        ),
        (
            "C = [0.8, 0, 0.6]",
            "C = [0.8, 0.1, 0.6]",
            r"mesh\.plane: point 2 does not fit into it: it lies 0\.1 m",
        ),
        ('plane = "xz"', 'plane = "zx"', r"mesh\.plane: 'zx' is not allowed"),
        ('plane = "xz"', 'plane = "yz"', r"mesh\.plane: point . does not fit into it"),
    ],
)
def test_what_lies_out_of_the_plane_is_refused(tmp_path, before, after, message):
    with pytest.raises(StudyError, match=message):
        read(tmp_path, (before, after))


def test_a_rotor_is_not_planar(tmp_path):
    spin = (
        '[members.arm]\nfrom = "B"',
        '[members.arm]\nspin = 1.0\nsection = { shape = "circle", d = 0.02 }\nfrom = "B"',
    )
    with pytest.raises(StudyError, match=r"member 'arm' does not fit into it: a rotor whirls in two planes"):
        read(tmp_path, spin)


def test_a_planar_study_finds_a_hidden_mass(tmp_path):
    """Measured in the plane, with a point mass on the arm that the study does not know."""
    (tmp_path / "plain.toml").write_text(STUDY, encoding="utf-8")
    truth = dovetail.load_study(tmp_path / "plain.toml").add("point_mass:arm", mass=0.08, position=0.4)
    frf = truth.frf()
    noise = 1e-4 * np.random.default_rng(1).standard_normal(frf.H.shape)
    write_npz(
        tmp_path / "tip.npz", FRF.from_arrays(frf.frequency, frf.H * (1 + noise), frf.kind, ["tip"], ["tip"])
    )
    measured = '[[measurements]]\nfile = "tip.npz"\n[candidates]\nkinds = ["point_mass", "joint_stiffness"]\n'
    (tmp_path / "study.toml").write_text(STUDY + measured, encoding="utf-8")
    study = dovetail.load_study(tmp_path / "study.toml")
    before = study.error().fit_db
    fitted = study.add("point_mass:arm").fit()
    assert fitted.error().fit_db < 0.1 * before
    mass = next(
        v for (name, key), v in fitted.model.values().items() if (name, key) == ("point_mass:arm", "mass")
    )
    assert mass == pytest.approx(0.08, rel=0.05)
