"""Amplitudes without phase: only ln |H| is compared, fitted and searched."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dovetail import load_study
from dovetail.report import quadrature_shapes
from fem import FRF
from fem.io import read_frf, write_npz
from tests.frames import write_study
from tests.studies import fit_problem
from updating import Measurement, Sensor
from updating.inference import prepare


def of_amplitudes(folder, mass):
    """Return a study with the amplitudes of FRFs that have a hidden mass."""
    path = write_study(folder, mass)
    frf = read_frf(folder / "frf.npz")
    write_npz(folder / "frf.npz", replace(frf, H=np.abs(frf.H).astype(complex)))
    return load_study(path)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return of_amplitudes(tmp_path_factory.mktemp("amplitudes"), 0.25)


def test_a_hidden_mass_is_found_by_amplitudes_alone(study):
    found = study.diagnose()
    assert found.verdict == "effect"
    (finding,) = found.findings
    values = {p.name: p for p in finding.parameters}
    assert finding.effect.name == "point_mass:arm"
    assert values["mass"].value == pytest.approx(0.25, abs=3 * values["mass"].std)
    assert values["position"].value == pytest.approx(0.3, abs=3 * values["position"].std)
    assert values["mass"].std < 0.015  # the masses of sensors are uncertain, too
    assert found.faults == ()
    outcome = {c.name: c.outcome for c in found.gates.checks}
    assert outcome["phase"] == outcome["sensors and forces"] == "not run"


def test_no_phase_and_no_measured_shape_is_shown(study):
    compared = study.compare()
    assert {t.meta["quantity"] for t in compared.plot().data if t.meta} == {"magnitude"}
    problem = fit_problem(study)
    diagnosis = SimpleNamespace(problem=problem, measured=problem.measured)
    result = SimpleNamespace(diagnosis=diagnosis)
    assert quadrature_shapes(result.diagnosis, study.solve_modes(3)) == {}


def test_residuals_and_slopes_are_those_of_the_logarithm_of_amplitudes(study):
    problem = fit_problem(study)
    lines = problem.lines_up_to(np.inf, 20)
    function = problem.function((), (), lines)
    r, J = function(function.start, True)
    H = problem.receptance(problem.nominal(), lines)
    size = np.abs(problem.data.H[lines])
    weighted = problem.data.weight[lines] * np.log(np.abs(H) / size)
    assert r == pytest.approx(weighted[function.keep], abs=1e-10)
    assert not J.imag.any()
    step = np.zeros(len(function.start))
    step[-3] = 1e-5
    ahead, behind = (function(function.start + s * step, False)[0] for s in (1, -1))
    assert J[-3].real == pytest.approx(((ahead - behind) / 2e-5).real, rel=1e-4, abs=1e-6)


def test_noise_of_amplitudes_is_estimated_from_one_part():
    """Smooth amplitudes with 2 % of noise: the median of its square is that of one normal variable."""
    f = np.arange(10.0, 410.0)
    smooth = (1 + f / 400)[:, None, None] * np.ones((1, 3, 1))
    H = smooth * (1 + 0.02 * np.random.default_rng(3).standard_normal(smooth.shape))
    ends = tuple(Sensor(name, np.zeros(3), np.array([0.0, 0.0, 1.0])) for name in "abc")
    frf = FRF.from_arrays(f, H.astype(complex), "accelerance", list("abc"), ["a"])
    data = prepare(Measurement(frf, ends, ends[:1], phase=False))
    assert np.median(data.noise) == pytest.approx(0.02, rel=0.1)
    assert data.noise_level == pytest.approx(0.02, rel=0.15)
    assert (data.H.real > 0).all()
