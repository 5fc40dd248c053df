"""What a study file becomes."""

import re

import numpy as np
import pytest

from dovetail import StudyError, load_study
from dovetail.file import element_size
from dovetail.report.sections.about import _mesh
from fem import FRF, Frame, Joint, Mesh, assemble, compute_frf, solve_modes
from fem.io import write_mesh, write_npz, write_uff
from tests.frames import MAST
from tests.studies import study_file, study_from
from updating import sensor_rows

BEAM = """
[materials.steel]
E = 210e9
rho = 7850

[points]
A = [0, 0, 0]
B = [1, 0, 0]

[members.bar]
from = "A"
to = "B"
section = { shape = "rectangle", b = 0.03, h = 0.01 }
"""

CLAMP = """
[[supports]]
point = "A"
"""

SENSORS = """
[[sensors]]
name = "tip"
point = "B"
direction = "z"
[[excitations]]
sensor = "tip"
"""


def load(tmp_path, text):
    return study_from(tmp_path, text)


def frequencies(study, n=8):
    found = solve_modes(assemble(study.model), n=n)
    return found.frequency[found.n_rigid :]


def test_cantilever_has_the_frequencies_of_the_closed_form(tmp_path):
    study = load(tmp_path, BEAM + CLAMP)
    beta = np.array([1.87510407, 4.69409113])
    weak = beta**2 / (2 * np.pi) * np.sqrt(210e9 * 0.03 * 0.01**3 / 12 / (7850 * 0.03 * 0.01))
    # shear and rotary inertia lower them by far less than a thousandth in so slender a beam
    np.testing.assert_allclose(frequencies(study)[[0, 2]], [weak[0], weak[1]], rtol=1e-3)


def test_defaults_are_said(tmp_path):
    study = load(tmp_path, BEAM + CLAMP)
    said = " ".join(study.assumptions)
    for word in ("0.5 % is assumed", "element size", "1000 Hz", "E 2 %"):
        assert word in said
    assert [(n.effect, n.parameter, n.std) for n in study.nuisances] == [
        ("frame", "E:steel", 0.02),
        ("frame", "rho:steel", 0.01),
    ]
    assert study.damping_std == 0.5
    assert study.kinds is None
    assert study.measurements == ()


def test_one_element_size_is_told(tmp_path):
    study = load(tmp_path, BEAM + CLAMP + "[frequency]\nstop = 5000\n")
    n = study.model.mesh.n_lines
    size = f"elements of {1e3 / n:.3g} mm"  # as made, not as aimed at
    assert any(f"{size} ({n} in all)" in text for text in study.assumptions)
    assert _mesh(study)[1].startswith(f"{n} {size}, ")
    assert study.element_size == pytest.approx((1 / n, 1 / n))


def test_what_is_given_is_not_assumed(tmp_path):
    text = BEAM + CLAMP + "[damping]\nmodal = 0.01\n[mesh]\nelement_size = 0.1\n[frequency]\nstop = 300\n"
    study = load(tmp_path, text + "[uncertain]\nE = 0.03\nrho = 0\ndamping = 0.2\n")
    assert study.assumptions == ()
    assert study.model.mesh.n_lines == 10
    assert [(n.parameter, n.std) for n in study.nuisances] == [("E:steel", 0.03)]
    assert study.frequency[-1] == pytest.approx(300)


@pytest.mark.parametrize(
    ("more", "uncertain", "std"),
    [("", "", 0.3), ("", "shear = 0.1", 0.1), ("", "shear = 0", 0), (", ky = 0.4", "", 0)],
)
def test_shear_coefficients_of_walls_are_uncertain_unless_they_are_given(tmp_path, more, uncertain, std):
    box = f'section = {{ shape = "hollow_rectangle", b = 0.02, h = 0.03, t = 0.001{more} }}'
    text = re.sub("section = .*", box, BEAM) + CLAMP + f"[uncertain]\n{uncertain}\n"
    assert "hollow" in text
    study = load(tmp_path, text)
    stds = {n.parameter: n.std for n in study.nuisances if n.effect == "section_shear"}
    assert stds == ({"ky:bar": std, "kz:bar": std} if std else {})
    said = [text for text in study.assumptions if "shear coefficients of walls 30 %" in text]
    assert len(said) == (std == 0.3)


@pytest.mark.parametrize("stop", [200.0, 2000.0])
def test_default_elements_follow_the_shortest_wave(tmp_path, stop):
    study = load(tmp_path, BEAM + CLAMP + f"[frequency]\nstop = {stop}\n")
    p = study.model.effect("frame").members["bar"]
    wave = (
        2
        * np.pi
        * (p.material.E * p.section.Iy / (p.material.rho * p.section.A * (2 * np.pi * stop) ** 2)) ** 0.25
    )
    assert study.model.mesh.lengths().max() <= min(wave / 12, 1 / 4) * (1 + 1e-9)
    assert element_size(p, stop) <= wave / 12 * (1 + 1e-12)


def test_finer_mesh_changes_frequencies_by_no_more_than_foreseen(tmp_path):
    study = load(tmp_path, BEAM + CLAMP + "[frequency]\nstop = 2000\n")
    coarse, fine = (frequencies(s, 12) for s in (study, study.refined(2)))
    within = fine < 2000
    # 32 elements for a torsional wave are too stiff by (2π/32)²/24
    assert (np.abs(coarse / fine - 1)[within] < (2 * np.pi / 32) ** 2 / 24).all()
    assert (study.refined(2).model.mesh.points[: study.model.mesh.n_points] == study.model.mesh.points).all()


def test_members_that_touch_are_welded_or_not(tmp_path):
    cross = (
        BEAM
        + '[members.post]\nfrom = [0.4, 0, 0]\nto = [0.4, 0, 0.5]\nsection = {shape = "circle", d = 0.01}\n'
        + CLAMP
    )
    study = load(tmp_path, cross)
    bar, post = (set(study.model.mesh.member_points(name)) for name in ("bar", "post"))
    assert len(bar & post) == 1
    assert any("welded" in text for text in study.assumptions)
    apart = load(tmp_path, cross + "[mesh]\nconnect = false\n")
    bar, post = (set(apart.model.mesh.member_points(name)) for name in ("bar", "post"))
    assert not bar & post


def test_names_of_one_place_on_a_member_are_of_one_point(tmp_path):
    """Two members that end there under different names are welded to it, and to each other."""
    ends = "P = [0.4, 0, 0]\nQ = [0.4, 0, 0]\nC = [0.4, 0.5, 0]\nD = [0.4, -0.5, 0]"
    text = BEAM.replace("B = [1, 0, 0]", f"B = [1, 0, 0]\n{ends}")
    for name, first, last in (("left", "P", "C"), ("right", "Q", "D")):
        text += f'[members.{name}]\nfrom = "{first}"\nto = "{last}"\nsection = "flat"\n'
    text += CLAMP + '[sections.flat]\nshape = "rectangle"\nb = 0.03\nh = 0.01\n'
    mesh = load(tmp_path, text).model.mesh
    assert mesh.point_names["P"] == mesh.point_names["Q"]
    assert sum(mesh.point_names["P"] in mesh.member_points(m) for m in mesh.members) == 3
    assert (np.linalg.norm(mesh.points[mesh.point_names["D"]] - [0.4, -0.5, 0])) == 0
    apart = load(tmp_path, text + "[mesh]\nconnect = false\n").model.mesh
    assert apart.point_names["P"] != apart.point_names["Q"]
    with pytest.raises(StudyError, match=r"same point.*unless \[mesh\] has connect = false"):
        load(tmp_path, text + '[[joints]]\npoint1 = "P"\npoint2 = "Q"\nk = {kx = 1e5}\n')


def test_two_points_at_one_place_may_be_a_hinge(tmp_path):
    text = BEAM.replace("B = [1, 0, 0]", "B = [1, 0, 0]\nC = [1, 0, 0]\nD = [2, 0, 0]")
    text += (
        '[members.bar2]\nfrom = "C"\nto = "D"\nsection = {shape = "rectangle", b = 0.03, h = 0.01}\n' + CLAMP
    )
    hinge = (
        '[[joints]]\nname = "hinge"\npoint1 = "B"\npoint2 = "C"\nrigid = "x y z rx rz"\nk = {kry = 0.001}\n'
    )
    study = load(tmp_path, text + hinge)
    (joint,) = study.model.of_kind(Joint)
    assert joint.point1 != joint.point2
    assert joint.rigid == ("x", "y", "z", "rx", "rz")
    assert frequencies(study)[0] < 0.2  # all but a mechanism


def test_joint_between_places_on_members(tmp_path):
    text = (
        BEAM + "[members.over]\nfrom = [0.5, -0.5, 0.02]\nto = [0.5, 0.5, 0.02]\nsection = {shape = "
        '"circle", d = 0.02}\n'
    )
    text += (
        '[[joints]]\nname = "J"\nmember1 = "over"\nposition1 = "middle"\nmember2 = "bar"\nposition2 = 0.5\n'
    )
    text += (
        "k = { kx = 1e6, ky = 1e6, kz = 1e6, krx = 10, kry = 10, krz = 10 }\neta = 0.1\nM "
        "= [0.1, 0.1, 0.1, 0, 0, 0]\n"
    )
    text += "[uncertain]\njoints = 0.1\n[uncertain.joint.J]\nkrx = 0.5\neta = 1.0\n"
    study = load(tmp_path, text)
    joint = study.model.effect("J")
    np.testing.assert_allclose(joint.location, [0.5, 0, 0.01], atol=1e-12)
    np.testing.assert_allclose(np.diag(joint.K), [1e6, 1e6, 1e6, 10, 10, 10])
    std = {n.parameter: n.std for n in study.nuisances if n.effect == "J"}
    assert std == {"kx": 0.1, "ky": 0.1, "kz": 0.1, "krx": 0.5, "kry": 0.1, "krz": 0.1, "eta": 1.0}


@pytest.mark.parametrize(
    ("section", "area"),
    [
        ('{shape = "hollow_rectangle", b = 0.04, h = 0.06, t = 0.002}', 0.04 * 0.06 - 0.036 * 0.056),
        ('{shape = "circle", d = 0.02}', np.pi * 0.02**2 / 4),
        ('{shape = "tube", d = 0.02, t = 0.001}', np.pi * (0.02**2 - 0.018**2) / 4),
        (
            '{shape = "i_section", b = 0.05, h = 0.1, tf = 0.004, tw = 0.003}',
            2 * 0.05 * 0.004 + 0.092 * 0.003,
        ),
        ("{A = 1e-4, Iy = 1e-9, Iz = 2e-9, J = 1e-9}", 1e-4),
        ('{shape = "circle", d = 0.02, A = 3e-4}', 3e-4),
        ('{shape = "ellipse", b = 0.02, h = 0.03, nu = 0.3}', np.pi * 0.02 * 0.03 / 4),
        ('{shape = "angle_section", b = 0.03, h = 0.04, t = 0.003}', 0.07 * 0.003 - 0.003**2),
        (
            '{shape = "channel", b = 0.03, h = 0.06, tf = 0.003, tw = 0.002, r = 0.002}',
            2 * 0.03 * 0.003 + 0.054 * 0.002 + 2 * (1 - np.pi / 4) * 0.002**2,
        ),
        ('{shape = "hollow_polygon", n = 6, d = 0.03, t = 0.002}', 6 * 0.028 * np.tan(np.pi / 6) * 0.002),
        (
            '{shape = "polygon", outer = [[0, 0], [0.03, 0], [0, 0.02]], '
            "holes = [[[0.01, 0.005], [0.012, 0.005], [0.01, 0.007]]], J = 1e-9}",
            3e-4 - 2e-6,
        ),
    ],
)
def test_sections(tmp_path, section, area):
    study = load(tmp_path, BEAM.replace('{ shape = "rectangle", b = 0.03, h = 0.01 }', section) + CLAMP)
    assert pytest.approx(area, rel=1e-12) == study.model.effect("frame").members["bar"].section.A


@pytest.mark.parametrize(
    ("section", "words"),
    [
        (
            '{shape = "hollow_polygon", n = 6.5, d = 0.03, t = 0.002}',
            r"section\.n: 6\.5 is not allowed; a whole",
        ),
        ('{shape = "channel", b = 0.03, h = 0.06, tf = 0.003, tw = 0.04}', "do not fit"),
        ('{shape = "channel", b = 0.03, h = 0.06, tf = 0.003, tw = 0.002, r = 0.04}', r"radius r is 0\.04"),
        ('{shape = "chanel", b = 0.03}', "did you mean 'channel'"),
        ('{shape = "polygon", outer = [[0, 0], [0.03, 0]], J = 1e-9}', "has 2 corners"),
        ('{shape = "polygon", outer = "round", J = 1e-9}', "a list of corners"),
        ('{shape = "polygon", outer = [[0, 0], [1, 0], [0, 1]], ky = 0.8}', "give J too"),
    ],
)
def test_impossible_sections(tmp_path, section, words):
    with pytest.raises(StudyError, match=words):
        load(tmp_path, BEAM.replace('{ shape = "rectangle", b = 0.03, h = 0.01 }', section) + CLAMP)


def test_a_shear_centre_beside_the_centroid_is_said(tmp_path):
    section = '{shape = "channel", b = 0.03, h = 0.06, tf = 0.003, tw = 0.002}'
    study = load(tmp_path, BEAM.replace('{ shape = "rectangle", b = 0.03, h = 0.01 }', section) + CLAMP)
    assert any("shear centre 0.0" in text for text in study.assumptions)


def test_members_of_a_mesh_file_and_their_groups(tmp_path):
    points = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    write_mesh(
        Mesh.from_lines(points, [[0, 1], [1, 2], [2, 3]], {"legs": [0, 2], "top": [1]}), tmp_path / "m.inp"
    )
    text = """
[mesh]
file = "m.inp"
[materials.steel]
E = 210e9
rho = 7850
[sections.a]
shape = "circle"
d = 0.02
[sections.b]
shape = "circle"
d = 0.03
[defaults]
section = "a"
[members.legs]
section = "b"
elements = 6
[[supports]]
point = [0, 0, 0]
"""
    study = load(tmp_path, text)
    frame = study.model.effect("frame")
    assert isinstance(frame, Frame)
    legs = study.model.mesh.members_of("legs")
    assert len(legs) == 2
    assert {frame.members[name].section.A for name in legs} == {np.pi * 0.03**2 / 4}
    assert np.pi * 0.02**2 / 4 == frame.members["top"].section.A
    assert [len(study.model.mesh.members[name]) for name in legs] == [6, 6]


def test_rigid_end_zones_fit_into_their_elements(tmp_path):
    zones = (
        BEAM.replace('to = "B"', 'to = "B"\nrigid1 = 0.03\nrigid2 = 0.02')
        + CLAMP
        + "[frequency]\nstop = 9000\n"
    )
    study = load(tmp_path, zones)
    shorter = BEAM.replace("B = [1, 0, 0]", "B = [0.97, 0, 0]") + CLAMP + "[frequency]\nstop = 9000\n"
    # the zone at the clamp stands still; the one at the tip is stiff and has mass
    np.testing.assert_allclose(frequencies(study)[0], frequencies(load(tmp_path, shorter))[0], rtol=2e-3)


def test_masses_and_damping(tmp_path):
    text = (
        BEAM
        + CLAMP
        + '[[masses]]\npoint = "B"\nmass = 2.0\ninertia = 0.001\n[damping]\nalpha = 1.0\nbeta = 1e-6\n'
    )
    study = load(tmp_path, text)
    assert frequencies(study)[0] == pytest.approx(
        np.sqrt(3 * 210e9 * 2.5e-9 / (2.0 + 33 / 140 * 2.355)) / 2 / np.pi, rel=2e-3
    )
    table = load(
        tmp_path, BEAM + CLAMP + "[damping]\nmodal = {frequency = [10, 100], ratio = [0.01, 0.02]}\n"
    )
    assert table.model.damping.ratio_at(55) == pytest.approx(0.015)


# Sensors and measurements -------------------------------------------------------------------------------


def measured(study, frequency=None, kind="accelerance"):
    frequency = np.arange(5.0, 400.0, 2.0) if frequency is None else frequency
    rows = (sensor_rows(study.model, s) for s in (study.sensors, study.excitations))
    H = compute_frf(assemble(study.model), frequency, *rows, kind).H
    return FRF.from_arrays(
        frequency, H, kind, [s.name for s in study.sensors], [s.name for s in study.excitations]
    )


def test_a_measurement_gets_the_sensors_names(tmp_path):
    text = BEAM + CLAMP + SENSORS
    frf = measured(load(tmp_path, text))
    write_npz(tmp_path / "m.npz", frf)
    study = load(tmp_path, text + '[[measurements]]\nfile = "m.npz"\nband = [20, 300]\nforce_level = 2.0\n')
    (m,) = study.measurements
    assert (m.frf.outputs, m.frf.inputs, m.force_level) == (("tip",), ("tip",), 2.0)
    assert (m.frf.frequency[0], m.frf.frequency[-1]) == (21.0, 299.0)
    assert study.max_frequency == 299.0


def test_channels_of_a_universal_file_are_found_by_node_and_turned(tmp_path):
    text = BEAM + CLAMP + SENSORS
    frf = measured(load(tmp_path, text))
    mesh = Mesh.from_lines([[0, 0, 0], [1, 0, 0]], [[0, 1]])
    write_uff(tmp_path / "m.uff", frf, mesh=mesh, dofs={"tip": "2Z-"})
    by_node = text.replace('point = "B"', "node = 2")
    study = load(tmp_path, by_node + '[[measurements]]\nfile = "m.uff"\n')
    (m,) = study.measurements
    np.testing.assert_allclose(m.sensors[0].point, [1, 0, 0])
    np.testing.assert_allclose(m.frf.H, frf.H)  # turned twice: response and force
    assert any("multiplied by -1" in a for a in study.assumptions)


def test_sensors_may_be_left_to_the_universal_file(tmp_path):
    text = BEAM + CLAMP
    frf = measured(load(tmp_path, text + SENSORS))
    mesh = Mesh.from_lines([[0, 0, 0], [1, 0, 0]], [[0, 1]])
    write_uff(tmp_path / "m.uff", frf, mesh=mesh, dofs={"tip": "2Z+"})
    study = load(tmp_path, text + '[[measurements]]\nfile = "m.uff"\n')
    assert [s.name for s in study.sensors] == ["2Z+"]
    assert [s.name for s in study.excitations] == ["2Z+"]
    assert sum("are given" in a and "of the measured files are taken" in a for a in study.assumptions) == 2


def test_compact_sensors(tmp_path):
    text = (
        BEAM + CLAMP + '[[sensors]]\npoints = ["A", [0.5, 0, 0], {member = "bar", position = "end"}]\nnames '
        '= ["a", "b", "c"]\ndirections = "xz"\n'
    )
    study = load(tmp_path, text)
    assert [s.name for s in study.sensors] == ["ax", "az", "bx", "bz", "cx", "cz"]
    np.testing.assert_allclose([s.point[0] for s in study.sensors], [0, 0, 0.5, 0.5, 1, 1])


def test_sign_and_skew_directions(tmp_path):
    text = BEAM + '[[sensors]]\nname = "s"\npoint = "B"\ndirection = [0, 3, 4]\nsign = -1\n'
    np.testing.assert_allclose(load(tmp_path, text).sensors[0].direction, [0, -0.6, -0.8])


def test_what_holds_a_structure_without_supports_is_named_whatever_it_is(tmp_path):
    """Not joints alone: here springs to the ground that a diagnosis has found."""
    bare = MAST.replace('[[supports]]\npoint = "foot"\n', "")
    springs = "".join(
        f'[[effects]]\ncandidate = "ground_spring:{end}.{d}"\nstiffness = 1e5\n'
        for end in ("mast.1", "mast.2")
        for d in "xyz"
    )
    (note,) = (s for s in load_study(study_file(tmp_path, bare + springs)).assumptions if "supports" in s)
    assert note.startswith("no supports are given: the structure is held by known ground_spring:mast.1.x, ")
    assert note.endswith(" alone, and free in 1 rigid-body motion")
    (note,) = (s for s in load_study(study_file(tmp_path, bare)).assumptions if "supports" in s)
    assert "the structure is free" in note
