"""A verdict against chance: simulated measurements, what they give, and what is dropped for it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from dovetail.report import words
from dovetail.validation.cases import CaseSettings, draw_case
from fem.model import Effect, parameter_values
from tests.hidden.cases import make_case
from updating.diagnosis.acceptance import Limits, whole_level
from updating.diagnosis.bootstrap import Bootstrap, bootstrap, simulated
from updating.diagnosis.diagnose import diagnose, propose
from updating.diagnosis.findings import Finding, parameters_of, step_of
from updating.diagnosis.screening import Grid
from updating.diagnosis.search import Search
from updating.inference import preparation
from updating.inference.preparation import build_problem

SILENT = lambda text, done: None  # noqa: E731


@pytest.fixture(scope="module")
def nothing():
    """A small frame with nothing hidden, its truth from exact dynamic stiffness matrices."""
    case = draw_case(CaseSettings(7, small=True), "null", 1)
    problem = build_problem(case.model, case.measurement, case.nuisances, connections=True)
    return case, problem, problem.fit()


def test_simulated_measurements_have_the_noise_of_the_real_one(nothing):
    _, problem, null = nothing
    data = problem.data
    many = np.stack([d.H for d in simulated(problem, null, 60)])
    exact = many.mean(axis=0)
    scatter = (many / exact - 1)[:, data.mask]
    for part in (scatter.real, scatter.imag):
        # √2/√120 of a standard deviation from 60 values, averaged over thousands
        assert (part.std(axis=0, ddof=1) / data.noise[data.mask]).mean() == pytest.approx(1.0, abs=0.02)
    model = problem.receptance(null)
    off = np.abs(np.log(exact / model))[data.mask]
    assert np.median(off) < 3 * np.median(data.noise[data.mask]) / math.sqrt(60)
    assert not np.array_equal(many[0], simulated(problem, null, 1, seed=1)[0].H)
    assert np.array_equal(many[0], simulated(problem, null, 1)[0].H)


def test_a_simulated_measurement_comes_from_a_finer_mesh(monkeypatch):
    # the mesh is to leave something
    monkeypatch.setattr(preparation, "with_higher_mass", lambda model: model)
    case = make_case(1)
    problem = build_problem(case.model, case.measurement, case.nuisances)
    null = problem.nominal()
    quiet = replace(problem, data=replace(problem.data, noise=np.zeros_like(problem.data.noise)))
    (data,) = simulated(quiet, null, 1)
    finer = case.model.with_mesh(case.model.mesh.split(2))
    again = build_problem(finer, case.measurement, case.nuisances)
    mask = problem.data.mask
    fine, own = (np.abs(np.log(data.H / p.receptance(p.nominal())))[mask] for p in (again, problem))
    # the two bases are not the same, which shows where a small FRF has an antiresonance
    assert np.median(own) > 5 * np.median(fine)


def test_where_nothing_is_hidden_chance_leaves_what_the_measurement_leaves(nothing):
    case, problem, null = nothing
    candidates = propose(case.model, ("member_stiffness", "joint_mass", "point_mass"))
    steps = tuple(step_of(label, fit) for label, fit in (("nominal", problem.nominal()), ("fitted", null)))
    begin = Search(problem, (), (), steps, null)
    after, (tried,) = bootstrap(begin, candidates, Limits(1.0, 1.0), 5, SILENT)
    assert after is begin
    assert tried.effect == ""
    assert math.isnan(tried.gain)
    assert null.level == pytest.approx(np.mean(tried.levels), rel=0.15)
    assert all(0.98 < g < 1.03 for g in tried.gains)
    assert any(g != 1 for g in tried.gains)  # though the search itself leaves so little alone


def test_an_effect_that_chance_could_have_made_is_dropped_and_a_real_one_stays():
    case = make_case(0)  # a member is heavier
    problem = build_problem(case.model, case.measurement, case.nuisances, model_error=0.0)
    candidates = propose(case.model, ("member_density", "point_mass"))
    hidden = case.hidden
    assert isinstance(hidden, Effect)
    real = next(e for e in candidates if (e.kind, e.where) == (hidden.kind, hidden.where))
    idle = next(e for e in candidates if e.kind == "point_mass")
    starts = [parameter_values(hidden), Grid.of(problem, idle).points[0]]
    null, both = problem.fit(), problem.fit([real, idle], starts)
    found = tuple(Finding(e, parameters_of(e, both), ()) for e in both.effects)
    fits = {"nominal": problem.nominal(), "uncertain": null, "both": both}
    begin = Search(problem, found, ((), ()), tuple(step_of(n, f) for n, f in fits.items()), both)
    after, tried = bootstrap(begin, candidates, Limits(1.0, 1.0), 2, SILENT)
    assert [t.effect for t in tried] == [idle.name, real.name]
    assert [t.believed for t in tried] == [False, True]
    assert tried[0].gain < 1.02
    assert tried[1].gain > 1.5
    assert tried[1].chance == 1 / 3
    (left,) = after.findings
    assert left.effect.name == real.name
    assert [s.label for s in after.steps[:2]] == ["nominal", "uncertain"]
    assert whole_level(after.current) == pytest.approx(whole_level(both), rel=0.03)


@pytest.mark.slow
def test_a_diagnosis_says_what_chance_gives_and_drops_what_is_no_more(monkeypatch):
    case = make_case(0)

    def told(gains):
        monkeypatch.setattr(
            "updating.diagnosis.bootstrap._by_chance", lambda *a: (gains, (0.01,) * len(gains))
        )
        return diagnose(
            case.model, [case.measurement], case.nuisances, kinds=["member_density"], n_simulated=len(gains)
        )

    found = told((1.0, 1.01, 1.02))
    assert found.verdict == "effect"
    (tried,) = found.tried
    assert tried.believed
    assert "1.020 at most" in words.chance_text(tried, found)
    assert "at most 25 %" in words.chance_text(tried, found)
    lost = told((1.0, 100.0, 1.02))
    assert lost.findings == ()
    assert lost.verdict != "effect"
    assert [t.effect for t in lost.tried] == [tried.effect, ""]
    (note,) = (n for n in lost.notes if "was dropped" in n)
    assert "in 1 of 3 simulated measurements" in note
    assert "with nothing missing the fit leaves" in words.chance_text(lost.tried[1], lost)
    beside = replace(lost, findings=found.findings)  # as beside a strained joint, which is not on trial
    assert "with nothing else missing the fit leaves" in words.chance_text(lost.tried[1], beside)
    assert [s.label for s in lost.steps] == ["nominal model", "uncertain parameters fitted"]


def test_chance_counts_equal_gains_as_reached():
    tried = Bootstrap("e", 1.2, (1.1, 1.2, 1.3), (0.1,) * 3)
    assert tried.chance == 3 / 4
    assert not tried.believed
