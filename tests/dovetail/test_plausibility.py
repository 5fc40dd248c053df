"""Values that no structure has are named, with the unit that they may be in; sound models are left alone."""

import re

import numpy as np
import pytest

from dovetail import StudyError, load_study, main
from dovetail.file import naming_implausible
from fem import (
    AddedMass,
    Damping,
    Joint,
    Material,
    Mesh,
    MeshError,
    Model,
    ModelError,
    PointMass,
    PropertyError,
    Section,
    assemble,
    check_model,
    solve_modes,
)
from fem.analysis.modes import MOST_VALUES
from fem.effects import effect_classes
from fem.plausibility import suspicions, suspicions_of_material
from tests.frames import beam, braced, cross_beam, fix, portal

SOLIDS = {
    "steel": (210e9, 7850),
    "aluminium": (70e9, 2700),
    "magnesium": (45e9, 1740),
    "lead": (16e9, 11340),
    "osmium": (560e9, 22590),
    "diamond": (1150e9, 3520),
    "tungsten": (400e9, 19300),
    "concrete": (30e9, 2400),
    "glass": (70e9, 2500),
    "CFRP": (140e9, 1600),
    "spruce across": (0.5e9, 450),
    "balsa": (3e9, 150),
    "cork": (20e6, 170),
    "rubber": (1.5e6, 1100),
    "PTFE": (0.5e9, 2200),
    "PE": (0.8e9, 950),
    "PU foam": (0.5e6, 30),
    "PMI foam": (92e6, 75),
    "beryllium": (303e9, 1850),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_are_plausible(name):
    assert not list(suspicions_of_material(Material(name, *SOLIDS[name])))


UNITS = [
    (210e3, 7850, {"E": "MPa (N/mm²): 210e9 Pa"}),
    (210.0, 7850, {"E": "GPa: 210e9 Pa"}),
    (210e6, 7850, {"E": "kPa: 210e9 Pa"}),
    (70e6, 2700, {"E": "kPa: 70e9 Pa"}),
    (210e12, 7850, {"E": "a thousand times as much: 210e9 Pa"}),
    (210e9, 7.85, {"rho": "g/cm³ (t/m³): 7850 kg/m³"}),
    (210e9, 7.85e-6, {"rho": "kg/mm³: 7850 kg/m³"}),
    (210e9, 7850e3, {"rho": "g/m³: 7850 kg/m³"}),
    (70e3, 2.7e-9, {"E": "MPa (N/mm²): 70e9 Pa", "rho": "t/mm³: 2700 kg/m³"}),
    (29e6, 0.284, {"rho": "lb/in³: 7861.1 kg/m³; E looks like psi: 199.9e9 Pa"}),
    (210e9, 78.5, {"rho": "sound would have 51722 m/s, and has 19000 m/s in diamond"}),
]


@pytest.mark.parametrize(("E", "rho", "expected"), UNITS)
def test_materials_in_other_units_are_named_with_the_unit(E, rho, expected):
    found = {s.place[2]: s.message for s in suspicions_of_material(Material("m", E, rho))}
    assert found.keys() == expected.keys()
    for key, words in expected.items():
        assert words in found[key]
        assert found[key].startswith(f"material 'm': {key} = ")


@pytest.mark.parametrize("model", [beam(4, effects=(fix(0),)), cross_beam(), portal(), braced()])
def test_sound_models_are_left_alone(model):
    assert suspicions(model, 1000.0) == ()


@pytest.mark.parametrize("example", ["tuned-absorber", "three-storeys", "four-storeys", "eighteen-storeys"])
def test_a_structure_may_carry_many_times_its_own_mass(example, pytestconfig):
    """A machine on a mast, and measured frames whose floors have up to 120 times the mass of the columns."""
    study = pytestconfig.rootpath / "examples" / example / "study.toml"
    assert not [text for text in load_study(study).warnings if " kg" in text]


def test_masses_are_not_judged_beside_members_of_implausible_stiffness():
    soft = beam(2, effects=(AddedMass(name="m", point=1, mass=80.0),), material=Material("m", 210e3, 7850))
    assert [s.place[0] for s in suspicions(soft, 1000.0)] == ["material"]


def words_of(model, max_frequency=None):
    return [s.message for s in suspicions(model, max_frequency)]


def carrying(**more):
    return beam(2, effects=(AddedMass(name="m", point=1, **more),))


def grounded(**more):
    return beam(2, effects=(Joint(name="J", point1=1, location=np.zeros(3), **more),))


MM = Section.rectangle(20, 30)
WRONG = {
    "section in mm": (beam(2, section=MM), ["A = 600 m²", "30 m deep and the member 1 m long"]),
    "section too small": (beam(2, section=Section.rectangle(2e-6, 3e-6)), ["sag by"]),
    "mesh in mm": (beam(2, 600.0), ["600 m long and 0.03 m deep, would sag by"]),
    "mesh of 3000 m": (beam(2, 3000.0), ["is 3000 m large; are the coordinates in mm (3 m)?", "sag"]),
    "all in mm": (beam(2, 600.0, section=MM), ["A = 600 m²"]),
    "A in mm2": (beam(2, section=Section(600, 4.5e-8, 2e-8, 5e-8)), ["too small for A = 600 m²"]),
    "A in cm2": (beam(2, section=Section(6, 4.5e-8, 2e-8, 5e-8)), ["too small for A = 6 m²"]),
    "I in mm4": (beam(2, section=Section(6e-4, 4.5e4, 2e4, 5e4)), ["I = 4.5e+04 m⁴ is too large"]),
    "I in cm4": (beam(2, section=Section(6e-4, 4.5, 2, 5)), ["I = 4.5 m⁴ is too large"]),
    "J too large": (beam(2, section=Section(6e-4, 4.5e-8, 2e-8, 5e-5)), ["J = 5e-05 m⁴ is larger than"]),
    "loss factor": (beam(2, material=Material("m", 210e9, 7850, loss_factor=1.5)), ["loss_factor = 1.5"]),
    "nu": (beam(2, material=Material("m", 210e9, 7850, -0.3)), ["nu = -0.3"]),
    "mass in g": (
        carrying(mass=80e3),
        [
            f"'m' has 8e+04 kg, and {48 * 210e9 * 0.03**3 * 0.01 / 12 / 9.81:.4g} kg would bend the stiffest "
            "member, held at both ends, by its length; is it in grams (80 kg)?"
        ],
    ),
    "arm in mm": (carrying(mass=0.1, arm=np.array([0, 0, 30.0])), ["arm of 30 m"]),
    "inertia": (carrying(mass=0.1, inertia=np.eye(3)), ["radius of gyration of 3.162 m"]),
    "joint too stiff": (
        grounded(K=np.diag([1e25, 0, 0, 0, 0, 1e20])),
        ["kx is 1e+25 N/m", "krz is 1e+20 N·m/rad"],
    ),
    "joint too soft": (grounded(K=np.diag([1e-9, 0, 0, 0, 0, 0])), ["kx is 1e-09 N/m"]),
    "joint eta": (grounded(K=np.eye(6) * 1e5, eta=2.0), ["eta = 2 is implausible"]),
    "pretension": (beam(2, pretension=1e7), ["strains it by 0.16"]),
    "offset in mm": (beam(2, offset1=np.array([0, 0, 15.0])), ["offset1 is 15 m"]),
    "per cent": (beam(2).with_damping(Damping.modal(0.5)), ["ratio of 0.5 is implausible"]),
    "loss per cent": (beam(2).with_damping(Damping.structural(2.0)), ["loss factor of 2 is implausible"]),
    "beta": (beam(2).with_damping(Damping.rayleigh(0, 0.01)), ["beta = 0.01 s gives modes at 1000 Hz"]),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_no_structure_has_is_named(name):
    model, expected = WRONG[name]
    found = words_of(model, 1000.0)
    assert len(found) == len(expected), found
    for text, words in zip(found, expected, strict=True):
        assert words in text


def test_python_users_get_the_same_from_check_model():
    model = beam(2, effects=(fix(0),), material=Material("m", 210e3, 7850))
    (fault,) = check_model(model)
    assert (fault.kind, fault.message) == ("implausible", words_of(model)[0])


def test_pieces_of_a_straight_bar_may_be_short():
    points = np.linspace([0, 0, 0], [1, 0, 0], 101)
    lines = np.column_stack([np.arange(100), np.arange(1, 101)])
    mesh = Mesh.from_lines(points, lines, {f"m{i}": [i] for i in range(100)})
    thick = beam(1, section=Section.circle(0.1)).effects[0].members["beam"]
    frame = type(beam(1).effects[0])(members=dict.fromkeys(mesh.members, thick))
    assert words_of(Model(mesh, (frame,))) == []
    stub = Mesh.from_lines([[0, 0, 0], [0.05, 0, 0], [0.05, 0, 1.0]], [[0, 1], [1, 2]], {"a": [0], "b": [1]})
    frame = type(frame)(members=dict.fromkeys(stub.members, thick))
    (text,) = words_of(Model(stub, (frame,)))
    assert "member 'a' is 0.1 m deep and the member 0.05 m long" in text


def test_a_cable_may_be_thin():
    wire = Section.circle(1e-4)
    assert "sag" in words_of(beam(4, 5.0, section=wire))[0]
    assert words_of(beam(4, 5.0, section=wire, theory="bar", pretension=20.0)) == []


# -------------------------------------------------------------------------------------------- what is refused


@pytest.mark.parametrize(
    "make",
    [
        lambda: AddedMass(name="m", point=0, mass=-1.0),
        lambda: AddedMass(name="m", point=0, mass=float("nan")),
        lambda: AddedMass(name="m", point=0, mass=1.0, inertia=-np.eye(3)),
        lambda: PointMass(name="m", member="beam", position=0.1, mass=-1.0),
        lambda: PointMass(name="m", member="beam", position=0.1, mass=1.0).with_values(mass=-0.1),
        lambda: Joint(name="m", point1=0, location=np.zeros(3), M=-np.eye(6)),
        lambda: effect_classes()["sensor_mass"](name="m", points=(0,), mass=-0.1, reference=1.0),
        lambda: effect_classes()["distributed_mass"](
            name="m", member="beam", mass=-1.0, position=0.5, width=0.1, length=1.0, reference=1.0
        ),
        lambda: effect_classes()["joint_mass"](name="m", joint="J", mass=-1.0, reference=1.0),
        lambda: effect_classes()["point_inertia"](
            name="m", member="beam", position=0.1, inertia=-1.0, length=1.0, reference=1.0
        ),
        lambda: Damping.rayleigh(-1.0, 0.0),
        lambda: Damping.structural(-0.1),
        lambda: Section(1e-4, 1e-8, 1e-8, 1e-8, Ip=-1e-8),
        lambda: Material("m", 210e9, -7850),
        lambda: Section.tube(0.1, -0.01),
    ],
)
def test_negative_masses_sizes_and_dampings_are_refused(make):
    with pytest.raises((ModelError, PropertyError), match=r"cannot be negative|must be"):
        make()


def test_polygons_of_a_thousand_million_sides_are_refused_at_once():
    with pytest.raises(PropertyError, match="3 to 360"):
        Section.hollow_polygon(10**9, 0.1, 0.01)


# ----------------------------------------------------------------------------------------------------- limits


@pytest.mark.parametrize(
    "make",
    [
        lambda m: m.refined(1e-9),
        lambda m: m.refined(1e-300),
        lambda m: m.refined(counts={"beam": 10**15}),
        lambda m: m.split(10**12),
    ],
)
def test_meshes_are_not_divided_without_end(make):
    with pytest.raises(MeshError, match=r"would have .* lines, and at most 5000000 are made"):
        make(beam(1).mesh)


def test_modes_without_end_are_refused(monkeypatch):
    system = assemble(beam(200, effects=(fix(0),)))
    monkeypatch.setattr("fem.analysis.modes.MOST_VALUES", system.n_free * 50)
    with pytest.raises(ModelError, match=r"1200 modes .* at most 50 are computed"):
        solve_modes(system, n=10**9)
    with pytest.raises(ModelError, match=r"1200 modes .* at most 50 are computed"):
        solve_modes(system, max_frequency=1e9)
    assert solve_modes(system, n=20).n_modes == 20
    assert MOST_VALUES * 8 == 2e9


STUDY = """
[points]
A = [0, 0, 0]
B = [0, 0, 0.5]
[members.post]
from = "A"
to = "B"
[sections.s]
shape = "rectangle"
b = 0.02
h = 0.03
[materials.steel]
E = 210e9
rho = 7850
[[supports]]
point = "A"
[[masses]]
name = "block"
point = "B"
mass = 0.1
[[sensors]]
point = "B"
direction = "x"
mass = 0.01
[[excitations]]
point = "B"
direction = "y"
[damping]
modal = 0.01
[uncertain]
E = 0.02
[frequency]
stop = 1000
"""

CHANGES = [
    ("E = 210e9", "E = 210e12", "line 13, materials.steel.E: material 'steel': E = 210e12 Pa is implausible"),
    ("rho = 7850", "rho = 7.85", "line 14, materials.steel.rho"),
    ("b = 0.02\nh = 0.03", "b = 20\nh = 30", "line 8, sections.s: section rectangle 20 x 30 m"),
    ("mass = 0.1", "mass = 4e5", "line 20, masses[1].mass: 'block' has 4e+05 kg"),
    ("mass = 0.01", "mass = 10", "line 24, sensors[1].mass: a sensor's mass of 10 kg is implausible"),
    ("modal = 0.01", "modal = 0.5", "line 29, damping.modal: a modal damping ratio of 0.5"),
    ("E = 0.02", "E = 2", "line 31, uncertain.E: a standard deviation of 2 is implausible"),
    ("B = [0, 0, 0.5]", "B = [0, 0, 500]", "line 2, points: member 'post', 500 m long"),
    (
        "[[supports]]",
        '[[joints]]\nname = "J"\nmember1 = "post"\nposition1 = "end"\nk = { kx = 1e25 }\n[[supports]]',
        "line 19, joints[1].k.kx: joint 'J': kx is 1e+25 N/m",
    ),
]


@pytest.mark.parametrize(("old", "new", "words"), CHANGES)
def test_studies_are_warned_of_with_file_line_and_key(old, new, words, tmp_path, capsys):
    assert STUDY.count(old) == 1
    file = tmp_path / "s.toml"
    # at 50 Hz fewer elements do for 500 m
    file.write_text(STUDY.replace("stop = 1000", "stop = 50").replace(old, new))
    assert main(["check", str(file), "--quiet", "--json", str(tmp_path / "c.json")]) == 0
    assert f"s.toml, {words}" in (tmp_path / "c.json").read_text()
    assert capsys.readouterr().err == ""  # said once, among the faults
    assert main(["modes", str(file), "--number", "2"]) == 0
    assert f"dovetail: warning: s.toml, {words}" in capsys.readouterr().err
    study = load_study(file)
    assert any(words in text for text in study.implausible)
    assert set(study.implausible) <= set(study.warnings)


def test_an_error_of_the_comparison_names_implausible_values_beside_it():
    reason = StudyError("too many modes")
    odd = ("E = 210e3 Pa is implausible",)
    with pytest.raises(StudyError, match=r"^too many modes; E = 210e3 Pa is imp"), naming_implausible(odd):
        raise reason
    with pytest.raises(StudyError, match=r"^too many modes$"), naming_implausible(()):
        raise reason


def test_a_sound_study_is_not_warned_of(tmp_path):
    (tmp_path / "s.toml").write_text(STUDY)
    assert load_study(tmp_path / "s.toml").warnings == ()


TOO_MANY = [
    ("E = 210e9", "E = 210", ["line 13, materials.steel.E: ", "the mesh", "GPa: 210e9 Pa", "E = 210 Pa"]),
    ("stop = 1000", "stop = 1e9", ["frequency.stop: ", "waves at 1e+09 Hz", "lower the frequency range"]),
    ("B = [0, 0, 0.5]", "B = [0, 0, 5000]", ["line 2, points: ", "are the coordinates in mm (5 m)?"]),
    ('to = "B"', 'to = "B"\nelements = 1000000000', ["line 8, members.post.elements: ", "1e+09"]),
    ('to = "B"', 'to = "B"\nelement_size = 1e-9', ["line 8, members.post.element_size: ", "5e+08"]),
    ("[points]", "[mesh]\nelement_size = 1e-9\n[points]", ["line 3, mesh.element_size: "]),
    ("[points]", "[mesh]\nmax_elements = 3\n[points]", ["and at most 3 are made ([mesh] max_elements)"]),
    ("[points]", "[defaults]\nelement_size = 1e-9\n[points]", ["line 3, defaults.element_size: "]),
]


@pytest.mark.parametrize(("old", "new", "words"), TOO_MANY)
def test_elements_are_limited_in_all_and_the_message_names_what_asks(old, new, words, tmp_path, capsys):
    assert STUDY.count(old) == 1
    (tmp_path / "s.toml").write_text(STUDY.replace(old, new))
    assert main(["modes", str(tmp_path / "s.toml")]) == 2
    text = capsys.readouterr().err
    assert len(text.splitlines()) == 1
    for each in (*words, "member 'post' asks for the most"):
        assert each in text


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "E = 210e9",
            "E = 210e6",
            "line 13, materials.steel.E: material 'steel': E = 210e6 Pa is implausible",
        ),
        ("E = 210e9", "E = 210e3", "E looks like MPa (N/mm²): 210e9 Pa; member 'post' would have"),
        ("rho = 7850", "rho = 7.85e6", "line 14, materials.steel.rho: material 'steel': rho = 7.85e6 kg/m³"),
    ],
)
def test_a_mesh_that_only_an_implausible_material_makes_fine_is_refused(old, new, words, tmp_path, capsys):
    """With 5 km/s, k = (ρA ω²/EI)^¼ = 14.75 rad/m across the thin side: 14.1 twelfths of a wave in 0.5 m."""
    file = tmp_path / "s.toml"
    file.write_text(STUDY.replace(old, new))
    assert main(["modes", str(file)]) == 2
    text = capsys.readouterr().err
    assert len(text.splitlines()) == 1
    assert words in text
    assert "for waves at 1000 Hz, and 15 with the usual speed of sound" in text
    for meant in ('to = "B"\nelements = 8', 'to = "B"\nelement_size = 0.1'):
        file.write_text(STUDY.replace(old, new).replace('to = "B"', meant))
        assert load_study(file).implausible
    file.write_text("[mesh]\nmax_elements = 10000\n" + STUDY.replace(old, new))
    assert load_study(file).implausible


def test_a_slow_material_that_needs_no_finer_mesh_is_no_reason_to_refuse(tmp_path):
    file = tmp_path / "s.toml"
    file.write_text(STUDY.replace("E = 210e9", "E = 210e6").replace("stop = 1000", "stop = 1"))
    assert load_study(file).implausible


def test_more_elements_can_be_allowed(tmp_path):
    text = STUDY.replace('to = "B"', 'to = "B"\nelements = 30001')
    (tmp_path / "s.toml").write_text(text.replace("[points]", "[mesh]\nmax_elements = 30001\n[points]"))
    assert load_study(tmp_path / "s.toml").model.mesh.n_lines == 30001


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["frf", "--out", "o.npz", "--step", "1e-9"], "lines from 1 to 1000 Hz in steps of 1e-09 Hz"),
        (["frf", "--out", "o.npz", "--stop", "1e300", "--step", "1e-300"], "too many; at most 1000000"),
        (["compare", "--bands", "1000000000"], "argument --bands: .* from 1 to 1000 is needed"),
        (["modes", "--number", "1000000000"], "argument --number: .* from 1 to 100000 is needed"),
    ],
)
def test_commands_refuse_work_without_end(options, words, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(STUDY)
    assert main([options[0], "s.toml", *options[1:]]) == 2
    assert re.search(words, capsys.readouterr().err)
