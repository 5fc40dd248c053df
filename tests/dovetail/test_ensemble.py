"""Ensembles: quantiles against closed forms, the reduced basis against full models, and their folder."""

import json

import numpy as np
import pytest
from scipy.stats import norm

from dovetail import main
from dovetail.ensemble import PROBABILITIES, SampledModel, check, compute, run_ensemble
from dovetail.ensemble.quantiles import quantiles
from dovetail.units import FolderError, ThisProcess
from fem import FRFKind
from tests.studies import study_from

STUDY = """
[points]
foot = [0.0, 0.0, 0.0]
knee = [0.0, 0.0, 0.6]
elbow = [0.0, 0.0, 0.6]
tip = [0.5, 0.0, 0.6]
[members]
post = { from = "foot", to = "knee" }
arm = { from = "elbow", to = "tip" }
[materials.steel]
E = 210e9
rho = 7850.0
[sections.bar]
shape = "rectangle"
b = 0.03
h = 0.02
[[supports]]
point = "foot"
[[joints]]
name = "hinge"
point1 = "knee"
point2 = "elbow"
rigid = "x y z rx rz"
k = { kry = 4e3 }
[[sensors]]
name = "tip-z"
point = "tip"
direction = "z"
[[sensors]]
name = "knee-x"
point = "knee"
direction = "x"
[[excitations]]
sensor = "tip-z"
[damping]
modal = 0.01
[frequency]
start = 5.0
stop = 300.0
step = 5.0
[uncertain]
E = %g
rho = 0
joints = %g
damping = %g
"""


def study_of(folder, E=0.04, joints=0.0, damping=0.0):
    return study_from(folder, STUDY % (E, joints, damping))


def model_of(study, seed=1):
    return SampledModel.of(
        study.model,
        study.nuisances,
        study.damping_std,
        study.frequency,
        study.sensors,
        study.excitations,
        FRFKind.ACCELERANCE,
        seed,
    )


def test_quantiles_of_frequencies_are_those_of_the_modulus(tmp_path):
    """With a rigid knee all stiffness is in proportion to E, so that frequencies are ∝ √E and log-normal."""
    joint = 'rigid = "x y z rx rz"\nk = { kry = 4e3 }'
    text = (STUDY % (0.08, 0, 0)).replace(joint, 'rigid = "all"')
    study = study_from(tmp_path, text)
    model, n = model_of(study), 4000
    found = compute(model, ("samples", 0, n))
    bands = quantiles(found["frequency"])
    nominal = model.frequencies_and_levels(model.uncertainty.draw(1, 0))[0] / np.sqrt(
        found["values"][0, 0] / 210e9
    )
    sigma = 0.08 / 2
    p = np.array(PROBABILITIES)
    exact = np.exp(sigma * norm.ppf(p))[:, None] * nominal
    # The standard error of a quantile is √(p (1 - p)/n) over the density there.
    error = np.sqrt(p * (1 - p) / n)[:, None] * exact * sigma / norm.pdf(norm.ppf(p))[:, None]
    assert (np.abs(bands.value - exact) < 4 * error).all()
    assert (np.abs(bands.error / error - 1) < 0.5).all()


def test_standard_errors_are_the_scatter_of_quantiles():
    x = np.random.default_rng(2).exponential(size=(400, 600))
    found = quantiles(x)
    scatter = found.value.std(axis=1)
    np.testing.assert_allclose(found.error.mean(axis=1), scatter, rtol=0.12)
    assert np.isinf(quantiles(x[:15]).error[[0, 2]]).all()  # no samples beyond these quantiles
    assert np.isfinite(quantiles(x[:15]).error[1]).all()


def test_the_reduced_basis_follows_a_soft_joint_and_damping(tmp_path):
    """The knee's stiffness scatters by a factor of 1.6."""
    model = model_of(study_of(tmp_path, 0.05, 0.5, 0.5))
    errors = [check(model, k) for k in range(4)]
    assert max(e.frequency for e in errors) < 1e-6
    assert max(e.of_peak for e in errors) < 1e-4
    assert max(e.level for e in errors) < 1e-3
    drawn = compute(model, ("samples", 0, 300))
    names = [u.name for u in model.uncertainty.unknowns]
    spread = np.log(drawn["values"]).std(axis=0)
    np.testing.assert_allclose(spread, [{"frame E:steel": 0.05}.get(n, 0.5) for n in names], rtol=0.15)


def test_samples_do_not_depend_on_units(tmp_path):
    model = model_of(study_of(tmp_path, damping=0.3, joints=0.1))
    whole = compute(model, ("samples", 0, 6))
    parts = [compute(model, ("samples", k, k + 2)) for k in (0, 2, 4)]
    for key, values in whole.items():
        np.testing.assert_array_equal(values, np.concatenate([p[key] for p in parts]))


def test_a_run_continues_with_more_samples_and_refuses_another_model(tmp_path):
    study = study_of(tmp_path)
    folder, told = tmp_path / "out", []
    first = run_ensemble(model_of(study), 60, 1, folder, ThisProcess(), told.append)
    assert [s.outcome.unit for s in told] == [("check", 0, 1), ("samples", 0, 50), ("samples", 50, 60)]
    told.clear()
    more = run_ensemble(model_of(study), 100, 2, folder, ThisProcess(), told.append)
    assert [s.outcome.unit for s in told] == [("check", 1, 2), ("samples", 50, 100)]
    np.testing.assert_array_equal(more.values[:60], first.values)
    once = run_ensemble(model_of(study), 100, 2, tmp_path / "once", ThisProcess())
    np.testing.assert_array_equal(once.levels.value, more.levels.value)
    assert once.checks == more.checks
    with pytest.raises(FolderError, match="started with other settings"):
        run_ensemble(model_of(study_of(tmp_path, E=0.05)), 60, 1, folder, ThisProcess())


def test_the_command_writes_bands(tmp_path, capsys):
    study_of(tmp_path, joints=0.1, damping=0.3)
    folder, file = tmp_path / "out", tmp_path / "e.json"
    arguments = ["ensemble", str(tmp_path / "study.toml"), "--samples", "60", "--out", str(folder)]
    assert main([*arguments, "--json", str(file), "--checks", "2"]) == 0
    said = capsys.readouterr().out
    assert "60 samples of 2 uncertain parameters" in said
    assert "reduced basis against 2 full solutions" in said
    found = json.loads(file.read_text())
    assert len(found["basis"]["checks"]) == 2
    with np.load(folder / "bands.npz") as arrays:
        bands = dict(arrays)
    assert bands["amplitude"].shape == (3, 60, 2, 1)
    assert (np.diff(bands["amplitude"], axis=0) >= 0).all()
    table = np.loadtxt(folder / "frequencies.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(table[:, 2], bands["natural_frequency"][1], rtol=1e-8)
    assert (folder / "bands.png").stat().st_size > 10_000
    header = (folder / "frf-bands.csv").read_text().splitlines()[0]
    assert header.startswith("frequency [Hz],tip-z/tip-z 5 % [(m/s²)/N]")


def test_a_study_without_uncertainty_is_refused(tmp_path, capsys):
    study_of(tmp_path, E=0.0)
    assert main(["ensemble", str(tmp_path / "study.toml"), "--out", str(tmp_path / "o")]) == 2
    assert "nothing in it is uncertain" in capsys.readouterr().err
