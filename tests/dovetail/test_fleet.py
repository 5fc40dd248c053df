"""Fleets: populations drawn from known ones, and units of a small frame from files to the page."""

import json
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.fleet import STUDY, auc, draw_fleet, judged
from dovetail import load_study, main
from dovetail.fleet import (
    Fleet,
    PopulationError,
    between_units,
    diagnose_outliers,
    find_population,
    run_fleet,
    typical_measurement,
)
from dovetail.units import ThisProcess
from fem import assemble, compute_frf
from fem.io import read_npz, write_npz
from updating import sensor_rows

FEW = STUDY.replace("step = 2.0", "step = 6.0")
"""The study with a third of the lines."""


def drawn_units(n=400, n_outliers=20, seed=3):
    """Return x, covariance, prior and residuals of a population whose μ, Σ and outliers are known."""
    rng = np.random.default_rng(seed)
    scatter = np.array([[4e-4, 1e-4, 0], [1e-4, 1e-4, 0], [0, 0, 0]])
    x = rng.multivariate_normal([0.03, -0.01, 0.0], scatter, n)
    residual = 0.01 * (rng.normal(size=(2, n, 60, 3, 2)) * [[[[[1]]]], [[[[1j]]]]]).sum(axis=0)
    residual += 0.05 * np.sin(np.arange(60))[:, None, None]  # the model's own error
    wrong = np.arange(n) < n_outliers
    residual[wrong, 20:24] += 0.05
    x[-1] += [0.2, 0, 0]  # far in the parameters alone
    covariance = np.tile(np.diag([1e-6, 1e-6, 0.09]), (n, 1, 1))  # the third is not determined
    wrong[-1] = True
    return x, covariance, np.array([0.1, 0.1, 0.3]), residual, wrong, scatter


def test_population_and_outliers_are_those_drawn():
    x, covariance, prior, residual, wrong, scatter = drawn_units()
    p = find_population(x, covariance, prior, residual)
    n = len(x)
    assert auc(p.odds, wrong) == 1.0
    assert ((p.probability > 0.5) == wrong).mean() > 0.99
    assert p.n_determined == 2
    np.testing.assert_allclose(p.determined, [1, 1, 0], atol=1e-12)
    # Means have the standard error σ/√n, variances √(2/n).
    assert (np.abs(p.mean[:2] - [0.03, -0.01]) < 4 * np.sqrt(np.diag(scatter)[:2] / n)).all()
    np.testing.assert_allclose(np.diag(p.scatter)[:2], np.diag(scatter)[:2], rtol=4 * np.sqrt(2 / n))
    np.testing.assert_allclose(p.spread, 0.01, rtol=0.2)
    assert p.by_parameters[-1] > 0.5
    assert p.by_parameters[:20].max() < 0.5
    assert abs(p.share - wrong.mean()) < 3 * np.sqrt(wrong.mean() / n)


def test_a_population_without_outliers_has_few_probable_ones():
    x, covariance, prior, residual, _, _ = drawn_units(n_outliers=0)
    p = find_population(x[:-1], covariance[:-1], prior, residual[:-1])
    assert (p.probability > 0.5).sum() <= 4
    assert p.share < 0.03


def test_too_few_units_have_no_population():
    x, covariance, prior, residual, _, _ = drawn_units(n=3, n_outliers=0)
    with pytest.raises(PopulationError, match="3 units are too few for the scatter of 2 parameters"):
        find_population(x, covariance, prior, residual)


def test_units_from_files_to_the_page(tmp_path, capsys):
    drawn = draw_fleet(tmp_path, 5, 14, 2, FEW)
    (tmp_path / "unit-0003.npz").write_bytes(b"no measurement")
    folder, file = tmp_path / "out", tmp_path / "fleet.json"
    command = ["fleet", str(drawn.study), *map(str, drawn.files), "--out", str(folder), "--json", str(file)]
    assert main(command) == 0
    said = capsys.readouterr().out
    found = json.loads(file.read_text())
    wrong = {f.name for f, e in zip(drawn.files, drawn.effects, strict=True) if e is not None}
    assert {u["file"].rpartition("/")[2] for u in found["units"][:2]} == wrong
    assert [f["file"].rpartition("/")[2] for f in found["failures"]] == ["unit-0003.npz"]
    assert "1 unit failed" in said
    by_name = {p["name"]: p for p in found["population"]}
    assert 0 < by_name["frame E:steel"]["scatter"] < 0.03
    page = (folder / "fleet.html").read_text()
    assert "unit-0003.npz" in page
    assert len((folder / "ranking.csv").read_text().splitlines()) == 14
    assert (folder / "fleet.png").stat().st_size > 10_000
    before = {f: f.stat().st_mtime_ns for f in (folder / "units").iterdir()}
    assert main(command) == 0  # nothing is fitted anew
    assert {f: f.stat().st_mtime_ns for f in (folder / "units").iterdir()} == before


def test_the_typical_unit_is_the_mean_one_with_the_error_that_all_share(tmp_path):
    """All units' readings at c are 10 % too large, which the model lacks."""
    drawn = draw_fleet(tmp_path, 5, 14, 0, FEW)
    for file in drawn.files:
        frf = read_npz(file)
        write_npz(file, replace(frf, H=frf.H * np.array([1, 1, 1.1, 1, 1])[:, None]))
    fleet = Fleet.of(drawn.study.read_text(), drawn.study, drawn.files)
    triaged = run_fleet(fleet, drawn.files, tmp_path / "out", ThisProcess())
    study = load_study(drawn.study)
    typical = typical_measurement(triaged).frf
    ends = [sensor_rows(study.model, part) for part in (study.sensors, study.excitations)]
    H = compute_frf(assemble(study.model), typical.frequency, *ends).H
    ratio = np.log(np.abs(typical.H / H))
    # E, ρ and damping of 14 units scatter about the nominal ones; the median of their noise is smaller.
    expected = np.log([1, 1, 1.1, 1, 1])
    assert np.median(ratio, axis=(0, 2)) == pytest.approx(expected, abs=3 * 0.012 / np.sqrt(14))
    between = between_units(triaged, study)
    assert {n.parameter: n.std for n in between.nuisances} == pytest.approx(
        {"E:steel": 0.01, "rho:steel": 0.005}, rel=4 / np.sqrt(2 * 14)
    )
    assert between.damping_std == pytest.approx(0.1, rel=4 / np.sqrt(2 * 14))
    assert 0.1 <= between.form_share < 0.4


@pytest.mark.slow
def test_causes_of_outliers(tmp_path):
    """Of six outliers the right effect is found, alone or among what the data cannot tell from it."""
    drawn = draw_fleet(tmp_path, 2, 60, 6)
    fleet = Fleet.of(drawn.study.read_text(), drawn.study, drawn.files)
    triaged = run_fleet(fleet, drawn.files, tmp_path / "out", ThisProcess())
    records, failures = diagnose_outliers(triaged, 6, tmp_path / "out", ThisProcess())
    assert not failures
    found = [judged(e, records.get(f)) for f, e in zip(drawn.files, drawn.effects, strict=True) if e]
    assert set(found) <= {"right", "twin"}


@pytest.mark.slow
def test_three_hundred_units_of_a_small_frame(tmp_path):
    """Outliers of 0.5 to 3 dB among units with 1 % of noise, moduli, densities and damping that scatter."""
    drawn = draw_fleet(tmp_path, 1, 300, 24)
    fleet = Fleet.of(drawn.study.read_text(), drawn.study, drawn.files)
    p = run_fleet(fleet, drawn.files, tmp_path / "out", ThisProcess()).population
    wrong = np.array([e is not None for e in drawn.effects])
    assert auc(p.odds, wrong) >= 0.99
    assert ((p.probability > 0.5) & ~wrong).sum() <= 6
    scatter = np.sqrt(np.diag(p.scatter))[:6]
    np.testing.assert_allclose(scatter, [0.01, 0.005, 0.1, 0.1, 0.1, 0.1], rtol=4 / np.sqrt(2 * 276))
