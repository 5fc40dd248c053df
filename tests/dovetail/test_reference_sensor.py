"""Responses over that of a reference sensor, to a force that nobody measured, through the commands."""

from dataclasses import replace

import numpy as np
import pytest

from dovetail import StudyError, load_study, main
from dovetail.desk import Desk
from fem import FRF, PointMass
from fem.io import write_npz
from tests.frames import MAST, MAST_SENSORS
from tests.noise import complex_normal
from updating import computed_frf
from updating.plan.planned import planned_measurement

SENSORS = f"""{MAST_SENSORS}
[[sensors]]
name = "high"
point = [0.0, 0.0, 0.75]
direction = "x"

[[excitations]]
point = [0.0, 0.0, 0.45]
name = "hammer"
direction = "x"
reference = "low"

[frequency]
start = 4.0
stop = 500.0
step = 3.0

[damping]
loss_factor = 0.02

[candidates]
kinds = ["point_mass", "member_stiffness"]
"""
MEASURED = """
[[measurements]]
file = "frf.npz"
kind = "transmissibility"
"""
HIDDEN = PointMass(name="hidden", member="mast", position=0.8, mass=0.15)


def mast(folder, mass=0.15, phase=True, seed=5):
    """Return the study of a mast that is hit by nobody knows how much, with a mass that it does not know."""
    path = folder / "study.toml"
    path.write_text(MAST + SENSORS)
    study = load_study(path)
    true = study.model.with_effect(*([replace(HIDDEN, mass=mass)] if mass else []))
    f, force = study.frequency, (study.excitations[0].as_force(),)
    H = computed_frf(true, study.sensors, force, f, "accelerance").H
    rng = np.random.default_rng(seed)
    responses = H * complex_normal(rng, (len(f), 1, 1))  # a spectrum of the force like noise
    names = [s.name for s in study.sensors]
    T = responses / responses[:, [names.index("low")]]
    T[:, :] *= 1 + 0.003 * complex_normal(rng, T.shape)
    T[:, names.index("low")] = 1.0
    T = T if phase else np.abs(T).astype(complex)
    write_npz(folder / "frf.npz", FRF.from_arrays(f, T, "accelerance", names, ["low"], ["low"]))
    path.write_text(MAST + SENSORS + MEASURED)
    return path


@pytest.fixture(scope="module")
def right(tmp_path_factory):
    return load_study(mast(tmp_path_factory.mktemp("right"), mass=0.0))


def test_a_right_model_meets_its_ratios_up_to_noise(right):
    assert right.warnings == ()
    assert right.error().all_db < 0.1  # 0.3 % of noise is 0.026 dB
    (m,) = right.measurements
    assert [s.name for s in m.sensors] == ["tip", "middle", "high"]
    assert (m.frf.quantity, m.frf.unit, m.frf.inputs) == ("transmissibility", "-", ("hammer",))


def test_a_hidden_mass_is_found_without_the_force(tmp_path):
    found = load_study(mast(tmp_path)).diagnose()
    assert found.verdict == "effect"
    (finding,) = found.findings
    values = {p.name: p for p in finding.parameters}
    assert finding.effect.name == "point_mass:mast"
    assert values["mass"].value == pytest.approx(0.15, abs=3 * values["mass"].std)
    assert values["position"].value == pytest.approx(0.8, abs=3 * values["position"].std)
    assert values["mass"].std < 0.02


def test_nothing_is_found_where_nothing_is_hidden(tmp_path):
    assert load_study(mast(tmp_path, mass=0.0)).diagnose().verdict == "nothing missing"


def test_amplitudes_of_ratios_fit_an_added_mass(tmp_path):
    fitted = load_study(mast(tmp_path, phase=False)).add("point_mass:mast", mass=0.12, position=0.75).fit()
    values = {p.name: p.value for p in fitted.added[0].parameters()}
    assert values["mass"] == pytest.approx(0.15, rel=0.05)
    assert values["position"] == pytest.approx(0.8, abs=0.01)


def test_the_desk_ranks_fits_and_maps_ratios(tmp_path):
    desk = Desk.open(mast(tmp_path))
    assert desk.nominal.frf.quantity == "transmissibility"
    ranked = desk.rank()
    assert ranked.wait(60)
    assert {p.effect.name for p in ranked.result.promises[:3]} & {"point_mass:mast"}
    desk.add("point_mass:mast", mass=0.12, position=0.75)
    fit = desk.fit_all()
    assert fit.wait(60)
    desk.take_fit(fit)
    assert desk.now.hypothesis.effects[0].mass == pytest.approx(0.15, rel=0.02)
    saved = load_study(desk.save(tmp_path / "saved.toml"))
    assert saved.error().all_db < 0.2


def test_a_test_without_a_force_is_planned(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(MAST + SENSORS)
    plan = load_study(path).plan(noise=0.01)
    assert 0.5 < plan.coverage() <= plan.coverage("seen")


def test_the_ratio_of_a_reference_to_itself_is_not_planned(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(MAST + SENSORS)
    study = load_study(path)
    planned = planned_measurement(study.model, study.sensors, study.excitations, [20.0, 30.0])
    assert [bool((row == 0).all()) for row in planned.compared[0]] == [s.name == "low" for s in study.sensors]


def test_wrong_units_of_the_reference_are_named(tmp_path):
    path = mast(tmp_path)
    path.write_text(path.read_text().replace('kind = "transm', 'scale = 9.80665\nkind = "transm'))
    (warning,) = load_study(path).warnings
    assert "responses in m/s² to a reference in g" in warning


def test_modes_are_not_identified_in_ratios(tmp_path, capsys):
    path = mast(tmp_path)
    assert main(["identify-modes", str(path)]) == 2
    assert "refer to low: their peaks are where that does not move" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('reference = "low"', 'reference = "los"', "there is no sensor 'los'"),
        ('reference = "low"', 'reference = "low"\ngain = 2.0', "its gain cancels; that of 'low' counts"),
        ('reference = "low"', 'reference = "low"\nsign = -1', "its sign cancels; that of 'low' counts"),
        ('name = "hammer"', 'name = "hammer"\nbase = "x"', "leave reference or base out"),
        ('name = "low"', 'name = "low"\nmass = 0.01\nroving = true', "stays where it is"),
        ('name = "low"', 'name = "low"\nkind = "mobility"', "refer to an acceleration"),
        ('reference = "low"', 'label = "low"', "are to an acceleration, and excitation 'hammer' is a force"),
        ('kind = "transmissibility"', 'kind = "transmissibility"\nforce_level = 3', "the force is unknown"),
        ("[damping]", "[channel_errors]\nsensors = { low = [0.02, 0, 0, 0, 0] }\n\n[damping]", "do not vary"),
    ],
)
def test_a_reference_that_cannot_be_is_refused(tmp_path, old, new, words):
    path = mast(tmp_path)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(StudyError, match=words):
        load_study(path)
