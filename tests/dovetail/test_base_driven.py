"""Tests on a shaker table: transmissibilities in studies, files, comparisons, updates and diagnoses."""

from dataclasses import replace

import numpy as np
import pytest

from dovetail import StudyError, load_study, main
from dovetail.found import found_text
from dovetail.pipeline import analysed
from dovetail.result import result_dict
from dovetail.update import identify_study, update_study
from fem import FRF, FRFKind, PointMass, assemble, compute_base_frf, solve_modes
from fem.io import Function, read_uff, write_npz, write_uff
from fem.io.uff import read_quietly
from tests.frames import MAST, MAST_SENSORS
from tests.noise import complex_normal
from updating import mac, sensor_rows

SENSORS = f"""
[[excitations]]
base = "x"
{MAST_SENSORS}{{low}}

[frequency]
start = 4.0
stop = 500.0
step = 6.0

[damping]
loss_factor = 0.02

[candidates]
kinds = ["point_mass", "member_stiffness"]
"""
MEASURED = """
[[measurements]]
file = "{file}"
kind = "transmissibility"
"""
HIDDEN = PointMass(name="hidden", member="mast", position=0.8, mass=0.15)


def mast(folder, mass=0.15, low="", file="frf.npz", phase=True, relative=False, step="6.0"):
    """Return the study of a mast on a table, measured with a mass that it does not know."""
    path, text = folder / "study.toml", MAST + SENSORS.format(low=low)
    text = text.replace("step = 6.0", f"step = {step}")
    if relative:
        text = text.replace('direction = "x"\n', 'direction = "x"\nrelative = true\n')
    path.write_text(text)
    study = load_study(path)
    true = study.model.with_effect(*([replace(HIDDEN, mass=mass)] if mass else []))
    f = study.frequency
    rows = sensor_rows(study.model, study.sensors)
    absolute, relative = (
        compute_base_frf(assemble(true), f, rows, ["x"], relative=r).H for r in (False, True)
    )
    reads_relative = np.array([s.relative for s in study.sensors])
    H = np.where(reads_relative[:, None], relative, absolute)
    rng = np.random.default_rng(5)
    H = H * (1 + 0.003 * complex_normal(rng, H.shape))
    H = H if phase else np.abs(H).astype(complex)
    frf = FRF.from_arrays(f, H, "accelerance", [s.name for s in study.sensors], ["base x"])
    write_npz(folder / "frf.npz", frf)
    path.write_text(text + MEASURED.format(file=file))
    return path


@pytest.fixture(scope="module")
def right(tmp_path_factory):
    return load_study(mast(tmp_path_factory.mktemp("right"), mass=0.0, low="relative = true"))


def test_a_right_model_meets_its_transmissibilities_up_to_noise(right):
    assert right.warnings == ()
    assert right.error().all_db < 0.1  # 0.3 % of noise is 0.026 dB
    assert pytest.approx(right.measurements[0].frf.H, rel=0.015) == right.frf().H


def test_transmissibilities_are_named_so_and_have_no_unit(right, tmp_path, capsys):
    from viz import frf, interactive, plot_frf

    measured = right.measurements[0].frf
    assert (measured.quantity, measured.unit) == ("transmissibility", "-")
    assert "'frf.npz' transmissibility [-]: " in repr(right.measurements[0])
    assert plot_frf(measured).axes[0].get_ylabel() == "transmissibility [-]"
    assert interactive.draw(frf(measured)).layout["yaxis"]["title"]["text"] == "transmissibility<br>[dB]"
    assert right.frf().as_kind("mobility").unit == "s"
    both = FRF.from_arrays([1.0], np.ones((1, 1, 2)), "accelerance", ["a"], ["tip", "base x"], ["base x"])
    assert both.unit == "(m/s²)/N, -"
    assert both.select(inputs=["tip"]).unit == "(m/s²)/N"
    assert main(["frf", str(right.path), "--out", str(tmp_path / "f.csv")]) == 0
    assert "transmissibility [-], 3 responses to 1 excitation(s)" in capsys.readouterr().out


def test_a_hidden_mass_is_found_on_a_table(tmp_path):
    path = mast(tmp_path)
    found = load_study(path).diagnose()
    assert found.verdict == "effect"
    (finding,) = found.findings
    values = {p.name: p for p in finding.parameters}
    assert finding.effect.name == "point_mass:mast"
    assert values["mass"].value == pytest.approx(0.15, abs=3 * values["mass"].std)
    assert values["position"].value == pytest.approx(0.8, abs=3 * values["position"].std)
    assert values["mass"].std < 0.02
    result = analysed(load_study(path), found, tmp_path, 0.0)
    assert [p.mac > 0.9 for p in result.modes if p.nominal_index >= 0]
    assert "point_mass:mast" in found_text(result, tmp_path)
    assert result_dict(result)["verdict"]


@pytest.mark.parametrize("relative", [True, False])
def test_modes_are_identified_from_transmissibilities(tmp_path, relative):
    """The motion of the base is a constant in absolute ones, which residual terms hold."""
    study = load_study(mast(tmp_path, mass=0.0, relative=relative, step="1.0"))
    one = identify_study(study)
    found, data = one.found, one.measurement
    assert {s.relative for s in data.sensors} == {relative}
    modes = solve_modes(assemble(study.model), n=10)
    k = [0, 2, 3, 5, 8]  # the others bend across the table's motion
    assert found.modes.frequency == pytest.approx(modes.frequency[k], rel=1e-3)
    shapes = sensor_rows(study.model, data.sensors) @ modes.shapes[:, k]
    assert np.diag(mac(found.modes.shapes, shapes)) == pytest.approx(1, abs=1e-3)


@pytest.mark.slow
def test_amplitudes_of_transmissibilities_fit_an_added_mass(tmp_path):
    study = load_study(mast(tmp_path, phase=False))
    (bare,) = study.amplitudes
    assert not study.measurements
    fitted = study.add("point_mass:mast", mass=0.1, position=0.7).fit()
    values = {p.name: p.value for p in fitted.added[0].parameters()}
    assert values["mass"] == pytest.approx(0.15, rel=0.05)
    assert values["position"] == pytest.approx(0.8, abs=0.01)
    assert bare.excitations[0].name == "base x"


def test_a_universal_file_keeps_transmissibilities(tmp_path):
    path = mast(tmp_path)
    names = '[[sensors]]\nname = "tip"\nlabel = "3X+"', '[[excitations]]\nbase = "x"\nnode = 1'
    text = path.read_text().replace('[[excitations]]\nbase = "x"', names[1])
    text = text.replace('[[sensors]]\nname = "tip"', names[0])
    text = text.replace('name = "middle"', 'name = "middle"\nlabel = "4X+"')
    path.write_text(text.replace('name = "low"', 'name = "low"\nlabel = "5X+"'))
    out = tmp_path / "frf.uff"
    assert main(["frf", str(path), "--out", str(out), "--quiet"]) == 0
    read = read_uff(out).frf()
    assert read.inputs == ("1X+",)
    assert repr(read).startswith("<FRF transmissibility [-]: ")
    path.write_text(path.read_text().replace('kind = "transmissibility"\n', "").replace("frf.npz", "frf.uff"))
    study = load_study(path)
    assert pytest.approx(study.frf().H, rel=1e-12) == study.measurements[0].frf.H
    assert study.measurements[0].frf.inputs == ("base x",)


@pytest.mark.parametrize(
    ("types", "labels", "kind", "factor"),
    [
        ((12, 12), ("g", "g"), FRFKind.ACCELERANCE, 1.0),
        ((11, 12), ("mm/s", "g"), FRFKind.MOBILITY, 1e-3 / 9.80665),
        ((8, 12), ("mm", "m/s^2"), FRFKind.RECEPTANCE, 1e-3),
        ((8, 8), ("mm", "m"), FRFKind.ACCELERANCE, 1e-3),
    ],
)
def test_units_of_both_motions_count(tmp_path, types, labels, kind, factor):
    f, values = np.array([1.0, 2.0, 3.0]), np.array([1 + 2j, 3j, 4.0])
    record = Function(5, "3X+", "1X+", "", "", f, values, 18, *types, "Hz", *labels, ("T",), 0, 0, "", "Hz")
    write_uff(tmp_path / "t.uff", functions=[record])
    frf = read_quietly(tmp_path / "t.uff").frf()
    assert frf.kind == kind
    assert frf.H[:, 0, 0] == pytest.approx(factor * values, rel=1e-12)


def test_a_force_in_place_of_the_base_is_refused_where_the_file_says_otherwise(tmp_path):
    path = mast(tmp_path)
    f = load_study(path).measurements[0].frf
    units = (18, 12, 12, "Hz", "g", "g")
    records = [
        Function(5, f"{3 + i}X+", "1X+", "", "", f.frequency, f.H[:, i, 0], *units, ("T",), 0, 0, "", "Hz")
        for i in range(3)
    ]
    write_uff(tmp_path / "frf.uff", functions=records)
    text = path.read_text().replace("frf.npz", "frf.uff")
    for k, name in enumerate(("tip", "middle", "low"), 3):
        text = text.replace(f'name = "{name}"', f'name = "{name}"\nlabel = "{k}X+"')
    force = text.replace('base = "x"', 'sensor = "tip"\nlabel = "1X+"')
    path.write_text(force.replace('kind = "transmissibility"\n', ""))
    with pytest.raises(StudyError, match=r"are to an acceleration, and excitation 'tip' is a force"):
        load_study(path)
    path.write_text(force.replace('kind = "transmissibility"', 'kind = "accelerance"'))
    assert load_study(path).measurements[0].frf.unit == "(m/s²)/N"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('kind = "transm', 'scale = 9.80665\nkind = "transm', "responses in m/s² to a base in g"),
        ('base = "x"', 'base = "y"\nlabel = "base x"', "hardly moves at its sensors"),
    ],
)
def test_wrong_units_and_directions_of_the_base_are_named(tmp_path, old, new, words):
    path = mast(tmp_path)
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    (warning,) = load_study(path).warnings
    assert words in warning


@pytest.mark.parametrize("phase", [True, False])
def test_updating_takes_transmissibilities_with_and_without_phase(tmp_path, phase):
    path = mast(tmp_path, mass=0.0, phase=phase)
    soft = path.read_text().replace("E = 210e9", "E = 195e9")
    path.write_text(soft + '\n[[update.parameters]]\neffect = "frame"\nparameter = "E:steel"\n')
    result = update_study(load_study(path))
    E = next(p for p in result.updated.parameters if p.name == "frame E:steel")
    assert E.value == pytest.approx(210e9, abs=4 * E.std)
    assert E.std < 0.03 * E.value
    assert not any(len(e.internal.ground) for e in result.updated.model.effects)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('[[supports]]\npoint = "foot"\n', "", "nothing holds the structure along the motion of its base"),
        ('base = "x"', 'base = "up"', "excitations.1..base"),
        ('base = "x"', 'base = "x"\nsensor = "tip"', "at a sensor or moves the base; give one of the two"),
        (
            '[[excitations]]\nbase = "x"',
            '[[excitations]]\npoint = "tip"\ndirection = "x"\n\n[[sensors]]\nname = "r"\npoint = "tip"\n'
            'direction = "z"\nrelative = true',
            "the base rests in this study",
        ),
    ],
)
def test_a_study_that_cannot_have_a_moving_base_is_refused(tmp_path, old, new, words):
    path = tmp_path / "study.toml"
    text = MAST + SENSORS.format(low="")
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(StudyError, match=words):
        load_study(path)
