"""``found.toml`` holds the model that a run reports: read again it is the same, whatever was found."""

import re
import tomllib
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dovetail import StudyError, load_study, main
from dovetail.file import fault_table, toml_value, with_damping, with_effects, with_parameters
from dovetail.file.estimates import FittedEstimate, with_estimates
from dovetail.found import found_text
from dovetail.result import UncertainValue
from fem import FRF, ConnectionDamping, Damping, assemble, compute_frf, parameter_values, sum_contributions
from fem.effects import JointStiffness, candidate_kinds
from fem.io import read_csv, read_npz, read_uff
from fem.linalg.solvers import factorise
from fem.system import connection_stiffness
from tests.dovetail.test_effects import JOINTED, candidates, loaded
from tests.frames import STUDY, write_study
from tests.studies import fit_problem
from updating import DampingCurve, Fault, Measurement, sensor_rows
from updating.diagnosis.begin import begin
from updating.diagnosis.departures import Departure

LINES = np.array([20.0, 47.0, 130.0, 290.0])
"""Frequencies at which the reported model and the one that was read are compared [Hz]."""


def reported(study, effects, folder, faults=(), uncertain=(), departed=()):
    """Return what a run reports: fitted values of all the model's parameters, damping and effects."""
    rng = np.random.default_rng(3)
    model = study.model
    values = {}
    for ref, value in model.values().items():
        values[ref] = value * (1 + 0.03 * rng.standard_normal())
    for effect in effects:
        for ref in effect.replaces():
            values.pop(ref, None)  # it stays nominal while the effect stands for it
    curve = DampingCurve(np.array([30.0, 80.0, 200.0]), np.full(3, 0.005), 0.5, connections=True)
    zeta = curve.start * np.exp(0.4 * rng.standard_normal(5))
    fitted = model.with_values(values).with_effect(*effects)
    diagnosis = SimpleNamespace(
        modes=None,
        problem=SimpleNamespace(damping=curve, data=SimpleNamespace(frequency=np.array([10.0, 300.0]))),
        steps=[SimpleNamespace(result=SimpleNamespace(values=values, zeta=zeta))],
        model=fitted,
        findings=[SimpleNamespace(effect=e, parameters=()) for e in effects if not e.is_form],
        departures=[Departure(effect, parameter, "-", 0.9, 0.1, 0.3, 1.0) for effect, parameter in departed],
        baseline=None,
        faults=faults,
        channel_faults=(),
    )
    result = SimpleNamespace(study=study, diagnosis=diagnosis, folder=folder, uncertain=uncertain)
    return result, fitted, curve, zeta


def response(model, study, damping):
    """Return receptances, solved directly, where members and connections have damping ratios of their own."""
    system = assemble(model, reciprocal=False)
    springs = connection_stiffness(system)
    outputs, inputs = (sensor_rows(model, part).T for part in (study.sensors, study.excitations))
    H = []
    for f in LINES:
        own, others = damping(np.array([f]))
        Z = system.dynamic_stiffness(2 * np.pi * f) + 2j * own[0] * system.K
        Z = Z + 2j * (others[0] - own[0]) * springs
        H.append(outputs.T @ (system.Q @ factorise(Z, backend="superlu").solve(system.Q.T @ inputs + 0j)))
    return np.array(H)


def generic(effect):
    values = parameter_values(effect)
    for p in effect.parameters():
        size = abs(p.value) or 0.01 * min(p.upper, 1.0)
        values[p.name] = float(np.clip(p.value + 0.1234567890123 * size, p.lower, p.upper))
    return effect.with_values(**values)


def one_of_each(study):
    first = {}
    for effect in candidates(study):
        first.setdefault(effect.kind, effect)
    return first


STAND_INS = {"zone_form"}
"""Kinds whose stiffness is made of the moduli of when they are proposed, before a fit: E is 14 % off here.
The values that do the same are found by iteration."""


@pytest.mark.usefixtures("all_digits")
@pytest.mark.parametrize("kind", sorted(set(candidate_kinds()) - {"joint_patch", "foot_shift"}))
def test_the_reported_model_comes_back(tmp_path, kind):
    study = loaded(tmp_path, JOINTED)
    effect = generic(one_of_each(study)[kind])
    result, fitted, curve, zeta = reported(study, [effect], tmp_path)
    (tmp_path / "found.toml").write_text(found_text(result, tmp_path), encoding="utf-8")
    found = load_study(tmp_path / "found.toml")
    back = found.model
    assert back.mesh.n_lines == fitted.mesh.n_lines
    for ref, value in result.diagnosis.steps[0].result.values.items():
        assert back.values()[ref] == pytest.approx(value, rel=1e-12)
    n = fitted.n_dof
    parts = (
        tuple(c for e in m.effects if e.kind != "connection_damping" for c in e.contribute(m))
        for m in (fitted, back)
    )
    for X, Y in zip(*(sum_contributions(p, n) for p in parts), strict=True):
        assert abs(X - Y).max() <= (1e-9 if kind in STAND_INS else 1e-10) * abs(X).max()
    assert {c.key for c in fitted.constraints()} == {c.key for c in back.constraints()}
    same = response(fitted, study, lambda f: curve.ratio(f, zeta))
    again = response(back, found, lambda f: np.stack(2 * [back.damping.ratio_at(f)]))
    # of a system whose condition is 1e8 and more
    assert np.abs(again / same - 1).max() < (1e-6 if kind in STAND_INS else 1e-8)


def test_a_study_that_was_found_has_seven_digits_and_its_form_in_one_table(tmp_path):
    study = loaded(tmp_path, JOINTED)
    each = one_of_each(study)
    some = [generic(each[kind]) for kind in ("crack", "zone_form", "driver_form")]
    result, _, _, _ = reported(study, some, tmp_path)
    text = found_text(result, tmp_path)
    numbers = re.findall(r"(?<![\w.])\d[\d.]*(?:e-?\d+)?", text)
    assert max(len(n.partition("e")[0].replace(".", "").strip("0")) for n in numbers) == 7
    values = tomllib.loads(text)
    assert [e["candidate"].partition(":")[0] for e in values["effects"]] == ["crack"]
    assert {name.partition(":")[0] for name in values["fitted_form"]} == {"zone_form", "driver_form"}


def test_estimates_state_the_form_that_the_report_states(tmp_path):
    study = loaded(tmp_path, JOINTED)
    bent = one_of_each(study)["section_form"].with_values(Iy=0.9, A=0.2)
    E = UncertainValue("frame.E:steel", "Pa", 210e9, 205e9, 4e9, 1.23456e9, False)
    uncertain = [E]
    for p in ("Iy", "A"):
        uncertain.append(UncertainValue(f"{bent.name}.{p}", "-", 0.0, 0.5, 0.3, 0.1, False, bent.where))
    result, *_ = reported(study, [bent], tmp_path, uncertain=uncertain, departed=[(bent, "Iy")])
    (tmp_path / "found.toml").write_text(found_text(result, tmp_path))
    found = load_study(tmp_path / "found.toml")
    assert '"frame.E:steel" = { before = 210e9, std = 1.23e9 }  # Pa' in found.text
    assert [name for name, e in found.estimates.items() if e.outside] == [f"{bent.name}.Iy"]
    assert np.isnan(found.estimates[f"{bent.name}.Iy"].before)
    # a later fit has other deviations, and its values began where the first fit left them
    later, *_ = reported(found, [], tmp_path, uncertain=[replace(E, nominal=205e9, std=1e8)])
    text = found_text(later, tmp_path)
    assert text.count("[estimates]") == 1
    assert tomllib.loads(text)["estimates"]["frame.E:steel"] == {"before": 210e9, "std": 1e8}


def test_deviations_of_a_frame_s_form_share_a_line_for_each_kind(tmp_path):
    """They come back as they were; what has a value before, or is outside its range, has its own line."""
    known = {f"zone_form:{k}.{p}": FittedEstimate(0.1 * k + 0.01) for k in range(30) for p in ("u", "mass")}
    known |= {"frame.E:steel": FittedEstimate(1e9, 210e9), "J.kx": FittedEstimate(2.0)}
    known |= {"zone_form:1.u": FittedEstimate(0.1, outside=True), "point_mass:a.b.mass": FittedEstimate(0.5)}
    text = with_estimates("", known)
    assert len(text.splitlines()) == 8  # three of them of the heading, two of single parameters
    path = write_study(tmp_path, 0.0)
    path.write_text(path.read_text(encoding="utf-8") + text, encoding="utf-8")
    study = load_study(path)
    assert {n: (e.std, e.outside) for n, e in study.estimates.items()} == {
        n: (pytest.approx(e.std), e.outside) for n, e in known.items()
    }
    assert tomllib.loads(with_estimates("", study.estimates)) == tomllib.loads(text)


def test_numbers_that_were_found_have_units_and_meanings(tmp_path):
    study = loaded(tmp_path, JOINTED)
    each = one_of_each(study)
    some = [
        generic(each[kind]) for kind in ("point_mass", "support_flexibility", "section_form", "clamp_form")
    ]
    result, *_ = reported(study, some, tmp_path)
    text = found_text(result, tmp_path)
    assert re.search(r"^mass = [\d.]+  # kg$", text, re.MULTILINE)
    assert re.search(r"^position = [\d.]+  # m$", text, re.MULTILINE)
    assert re.search(r"^stiffness = [\d.e]+  # (N/m|N·m/rad)$", text, re.MULTILINE)
    form = next(e for e in some if e.kind == "section_form")
    changes = "relative changes: A (mass per length), Iy, Iz, J, shear (shear flexibility)"
    assert f"  # {form.where}: {changes}" in text
    mass = next(e for e in some if e.kind == "point_mass")
    assert re.search(rf'^candidate = "{re.escape(mass.name)}"  # member ', text, re.MULTILINE)
    assert ": logarithms of factors: u (stiffness)" in text
    (tmp_path / "found.toml").write_text(text, encoding="utf-8")
    later, *_ = reported(load_study(tmp_path / "found.toml"), [], tmp_path)
    assert found_text(later, tmp_path).count("  # kg\n") == text.count("  # kg\n")


def test_what_rounding_leaves_of_a_form_is_zero(tmp_path):
    study = loaded(tmp_path, JOINTED)
    bent = one_of_each(study)["section_form"].with_values(Iy=0.01, Iz=-1.8e-23)
    result, *_ = reported(study, [bent], tmp_path)
    (form,) = tomllib.loads(found_text(result, tmp_path))["fitted_form"].values()
    assert form["Iy"] == pytest.approx(0.01, rel=0.1)
    assert form["Iz"] == 0.0


def test_the_nominal_damping_of_a_fit_is_that_of_the_model(tmp_path):
    """A nominal curve is the model's at every line, not only at the knots."""
    table = "modal = { frequency = [20, 90], ratio = [1e-3, 9e-3] }"
    study = loaded(tmp_path, JOINTED.replace("modal = 0.01", table))
    assert np.ptp(study.model.damping.ratio) > 0
    frequency = np.arange(10.0, 200.0, 2.0)
    names = [tuple(s.name for s in part) for part in (study.sensors, study.excitations)]
    outputs, inputs = (sensor_rows(study.model, part) for part in (study.sensors, study.excitations))
    H = compute_frf(assemble(study.model), frequency, outputs, inputs, "receptance").H
    m = Measurement(FRF.from_arrays(frequency, H, "receptance", *names), study.sensors, study.excitations)
    curve = begin(study.model, m).damping
    for row in curve.ratio(frequency, curve.start):
        np.testing.assert_allclose(row, study.model.damping.ratio_at(frequency), rtol=1e-12)


FAULTS = (
    Fault("sensor_sign", "K", -1.0, 0.0),
    Fault("sensor_gain", "T", 1.25, 0.0),
    Fault("sensor_delay", "T", 2e-5, 0.0, "s"),
    Fault("sensor_swap", "K", 0.0, 0.0, "-", "P"),
    Fault("sensor_tilt", "P", 0.2, 0.0, "rad", "", (0.0, 0.6, 0.8)),
    Fault("sensor_position", "A", 0.03, 0.0, "m", "arm"),
    Fault("excitation_sign", "T", -1.0, 0.0),
    Fault("excitation_gain", "T", 0.8, 0.0),
    Fault("excitation_delay", "T", 1e-5, 0.0, "s"),
)


@pytest.mark.parametrize("fault", FAULTS, ids=[f.kind for f in FAULTS])
def test_faults_come_back_and_are_set_right(tmp_path, fault):
    plain = load_study(write_study(tmp_path))
    (m,) = plain.measurements
    text = (tmp_path / "study.toml").read_text(encoding="utf-8")
    study = loaded(tmp_path, text + "\n" + fault_table(fault))
    (right,) = study.measurements
    frequency, H = m.frf.frequency, m.frf.H
    kind = fault.kind.partition("_")[2]
    by = fault.value if kind in ("sign", "gain") else np.exp(-2j * np.pi * frequency * fault.value)[:, None]
    if kind in ("sign", "gain", "delay"):
        i = m.frf.outputs.index(fault.sensor) if fault.kind.startswith("sensor") else None
        if i is None:  # a force that is more than was said
            j = m.frf.inputs.index(fault.sensor)
            np.testing.assert_allclose(right.frf.H[:, :, j], H[:, :, j] * by, rtol=1e-12)
        else:
            factor = by if np.ndim(by) else np.full((len(frequency), 1), by)
            np.testing.assert_allclose(right.frf.H[:, i], H[:, i] / factor, rtol=1e-12)
    elif kind == "swap":
        i, j = (m.frf.outputs.index(n) for n in (fault.sensor, fault.other))
        np.testing.assert_array_equal(right.frf.H[:, i], H[:, j])
        np.testing.assert_array_equal(right.frf.H[:, j], H[:, i])
    elif kind == "tilt":
        (sensor,) = (s for s in study.sensors if s.name == fault.sensor)
        (before,) = (s for s in plain.sensors if s.name == fault.sensor)
        assert np.degrees(np.arccos(sensor.direction @ before.direction)) == pytest.approx(np.degrees(0.2))
        (used,) = (s for s in right.sensors if s.name == fault.sensor)
        assert used.direction == pytest.approx(sensor.direction)
    else:
        assert set(right.frf.outputs) == set(m.frf.outputs) - {fault.sensor}


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ('kind = "sensor_sing"\nsensor = "K"', "did you mean 'sensor_sign'"),
        ('kind = "sensor_sign"\nsensor = "Q"', "there is no sensor 'Q'"),
        ('kind = "sensor_gain"\nsensor = "K"\nvalue = -2', "a positive number"),
        ('kind = "sensor_tilt"\nsensor = "K"\nvalue = 0.1\ntowards = "x"', "square to the direction"),
        ('kind = "sensor_swap"\nsensor = "K"\nother = "K"', "with itself"),
    ],
)
def test_faults_that_cannot_be_meant(tmp_path, entry, message):
    text = write_study(tmp_path).read_text(encoding="utf-8")
    with pytest.raises(StudyError) as caught:
        loaded(tmp_path, f"{text}\n[[faults]]\n{entry}\n")
    assert message in str(caught.value)


NAMES = (
    'a "quoted" name',
    "back\\slash",
    "new\nline",
    "</script><b>",
    "tab\there",
    "DEL\x7f",
    "ünïcode 梁",
    "a.b = [c]",
)


@pytest.mark.usefixtures("all_digits")
@pytest.mark.parametrize("name", NAMES, ids=range(len(NAMES)))
def test_names_survive(tmp_path, name):
    quoted = toml_value(name)
    text = (
        JOINTED.replace("[members.arm]", f"[members.{quoted}]")
        .replace('"arm"', quoted)
        .replace('name = "bolt"', f"name = {quoted}")
    )
    text = text.replace("[materials.steel]", f"[materials.{quoted}]").replace('"steel"', quoted)
    study = loaded(tmp_path, text)
    effects = [
        next(e for e in candidates(study) if e.kind == "point_mass" and e.member == name),
        next(e for e in candidates(study) if isinstance(e, JointStiffness) and e.joints == (name,)),
    ]
    result, *_ = reported(study, effects, tmp_path)
    (tmp_path / "found.toml").write_bytes(found_text(result, tmp_path).encode())
    back = load_study(tmp_path / "found.toml").model
    for ref, value in result.diagnosis.steps[0].result.values.items():
        assert back.values()[ref] == pytest.approx(value, rel=1e-12)
    assert {e.name for e in effects} <= {e.name.removeprefix("known ") for e in back.effects}


def test_a_known_effect_is_found_again(tmp_path):
    """What a joint's known effect has released is proposed as it is by now, and written in its place."""
    study = loaded(tmp_path, JOINTED)
    free = next(e for e in candidates(study) if type(e) is JointStiffness and e.released())
    held = next(e for e in candidates(study) if type(e) is JointStiffness and not e.released())
    result, *_ = reported(study, [free.with_values(stiffness=4e5), held.with_values(stiffness=2e5)], tmp_path)
    (tmp_path / "found.toml").write_text(found_text(result, tmp_path), encoding="utf-8")
    found = load_study(tmp_path / "found.toml")
    again = {e.name: e for e in candidates(found)}
    for effect, value in ((free, 4e5), (held, 2e5)):
        assert again[effect.name].assumed == value
        assert again[effect.name].released() == ()
    keys = {c.key for c in found.model.constraints()}
    assert all(keys.issuperset(e.released()) for e in again.values())
    second = again[free.name].with_values(stiffness=7e5)
    later, *_ = reported(found, [second], tmp_path)
    (tmp_path / "later.toml").write_text(found_text(later, tmp_path), encoding="utf-8")
    last = load_study(tmp_path / "later.toml").model
    assert last.effect(f"known {free.name}").stiffness == 7e5
    entries = tomllib.loads((tmp_path / "later.toml").read_text(encoding="utf-8"))["effects"]
    assert len(entries) == 2


def test_two_masses_on_one_member_have_two_names(tmp_path):
    study = loaded(tmp_path, JOINTED)
    mass = next(e for e in candidates(study) if e.kind == "point_mass").with_values(mass=0.1, position=0.1)
    text = with_effects(JOINTED, [mass])
    text = with_effects(text, [replace(mass, mass=0.2, position=0.3)])
    back = [e for e in loaded(tmp_path, text).model.effects if e.kind == "point_mass"]
    assert [(e.mass, e.position) for e in back] == [(0.1, 0.1), (0.2, 0.3)]


def test_values_without_a_place_have_a_table(tmp_path):
    study = loaded(
        tmp_path,
        STUDY.replace('shape = "rectangle"', 'shape = "hollow_rectangle"').replace(
            "h = 0.012 }", "h = 0.012, t = 0.002 }"
        ),
    )
    refs = [ref for ref in study.model.values() if ref[0] == "section_shear"]
    assert refs
    values = {ref: round(1.1 + 0.1 * k, 1) for k, ref in enumerate(refs)}
    text = with_parameters(study.text, values)
    again = loaded(tmp_path, text)
    assert {ref: again.model.values()[ref] for ref in refs} == values
    assert with_parameters(text, values) == text  # in place the second time
    with pytest.raises(StudyError, match=r"values\.section_shear\.ky:x.*no such parameter"):
        loaded(tmp_path, text.replace('"ky:', '"ky:x').replace('"k:', '"ky:x'))


@pytest.mark.parametrize(
    "table",
    [
        "modal = 0.01",
        "modal = { frequency = [5], ratio = [0.1] } # a guess",
        "alpha = 1.0\n[damping.modal]\nratio=[0.1]\nfrequency=[1]",
        "",
    ],
)
def test_damping_takes_the_place_of_what_was_there(tmp_path, table):
    text = STUDY.replace("[damping]\nmodal = 0.01", f"[damping]\n{table}" if table else "")
    new = Damping.modal([0.01, 0.02], [10.0, 90.0], powers=True)
    others = np.array([10.0, 90.0]), np.array([0.03, 0.04])
    written = with_damping(text, new, others)
    model = loaded(tmp_path, written).model
    np.testing.assert_array_equal(
        model.damping.ratio_at([10.0, 30.0, 90.0]), new.ratio_at([10.0, 30.0, 90.0])
    )
    assert model.damping.ratio_at(30.0) == pytest.approx(0.01 * 2 ** (np.log(3) / np.log(9)))
    (own,) = model.of_kind(ConnectionDamping)
    np.testing.assert_array_equal(own.ratio, others[1])
    kept = loaded(tmp_path, with_damping(written, Damping.modal(0.005, 1.0), None)).model
    assert kept.damping.ratio_at(30.0) == 0.005
    assert len(kept.of_kind(ConnectionDamping)) == 1


def test_labels_of_the_study_are_those_of_the_files(tmp_path, capsys):
    """What `frf` writes is read by the same study: by labels, also where the numbers are not the mesh's."""
    labels = {"P": "7X+", "K": "12X-", "T": "3X+", "A": "5Z+"}
    text = STUDY
    for name, label in labels.items():
        text = text.replace(f'name = "{name}"', f'name = "{name}"\nlabel = "{label}"', 1)
    (tmp_path / "plain.toml").write_text(text, encoding="utf-8")
    names = [s.name for s in load_study(tmp_path / "plain.toml").sensors]
    for suffix in ("npz", "uff", "csv"):
        file = tmp_path / f"m.{suffix}"
        assert main(["frf", str(tmp_path / "plain.toml"), "--out", str(file)]) == 0
        capsys.readouterr()
        frf = {"npz": read_npz, "csv": read_csv}.get(suffix, lambda f: read_uff(f).frf())(file)
        assert frf.outputs == tuple(labels[n] for n in names)
        study = loaded(tmp_path, text + f'\n[[measurements]]\nfile = "m.{suffix}"\n')
        (m,) = study.measurements
        assert m.frf.outputs == tuple(names)
        # modal and structural damping differ by 0.4 dB here; a channel at another place by many
        assert fit_problem(study).nominal().fit_db < 1.0
        assert not [note for note in study.assumptions if "turned round" in note]
    points = read_uff(tmp_path / "m.uff").points
    for s in study.sensors:
        np.testing.assert_allclose(points.at(int(labels[s.name][:-2])), s.point, atol=1e-6)
