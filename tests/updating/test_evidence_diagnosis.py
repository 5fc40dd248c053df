"""The search by evidence on a small frame: what is hidden, nothing, and what the library lacks."""

import pytest

from dovetail import load_study
from dovetail.file import without_held_out
from dovetail.file.contents import measured
from tests.frames import write_study
from updating import EFFECT, NOTHING, UNEXPLAINED, diagnose, propose
from updating.diagnosis.evidence import Search, prepare_search, search_of_problem, searched
from updating.inference import ALONE, TWIN_NATS
from updating.inference.workers import workers


def asked(folder, mass):
    study = load_study(write_study(folder, mass))
    return study, [without_held_out(study, m) for m in measured(study)]


def how(study, kinds):
    return {"damping_std": study.damping_std, "kinds": kinds, "model_error": 0.1}


def diagnosed(folder, *, mass, kinds):
    study, measurements = asked(folder, mass)
    said = []
    progress = lambda text, done: said.append((text, done))  # noqa: E731
    found = diagnose(study.model, measurements, study.nuisances, progress=progress, **how(study, kinds))
    assert said[0][1] == 0.0
    assert all(0 <= done <= 1 for _, done in said)
    return found


def test_a_hidden_mass_is_named_with_its_probability(tmp_path):
    found = diagnosed(tmp_path, mass=0.25, kinds=["point_mass", "member_stiffness"])
    assert found.verdict == EFFECT
    (finding,) = found.findings
    assert finding.effect.kind == "point_mass"
    assert finding.effect.where.startswith("member arm")
    values = {p.name: p.value for p in finding.parameters}
    assert values["mass"] == pytest.approx(0.25, rel=0.1)
    assert values["position"] == pytest.approx(0.3, abs=0.02)
    total = sum(p for _, p in found.posterior)
    assert total == pytest.approx(1.0, abs=1e-9)
    assert sum(p for names, p in found.posterior if finding.effect.name in names) > 0.95
    assert [s.label for s in found.steps][1:] == ["uncertain parameters fitted", f"{found.steps[-1].label}"]
    assert found.steps[-1].fit_db < 0.3 * found.steps[1].fit_db


def by_evidence(study, measurement, kinds, crew=ALONE):
    """Return the search alone, without verdict and report."""
    prepared = prepare_search(study.model, measurement, study.nuisances, **how(study, kinds))
    quiet = lambda text, done: None  # noqa: E731
    return searched(search_of_problem(*prepared, progress=quiet, crew=crew), quiet)


@pytest.mark.slow
def test_two_processes_find_what_one_finds(tmp_path):
    study, (measurement,) = asked(tmp_path, 0.25)

    def found(crew):
        done = by_evidence(study, measurement, ["point_mass", "member_stiffness"], crew)
        return {tuple(sorted(h.key)): h.score for h in done.search.known.values()}, done.best.key

    alone, best = found(ALONE)
    with workers(2) as crew:
        together, found_best = found(crew)
        assert crew.pool is not None
    assert found_best == best
    assert together == pytest.approx(alone, rel=1e-9)


def test_with_one_maximum_the_deviations_are_those_of_its_fit(tmp_path, monkeypatch):
    """A mass and its position vary on scales of their own, the mass as a share of where its fit began."""
    fits, polished = [], Search.polished
    monkeypatch.setattr(Search, "polished", lambda self, h: polished(self, fits.append(h) or h))
    study, (measurement,) = asked(tmp_path, 0.25)
    done = by_evidence(study, measurement, ["point_mass"])
    (effect,) = done.best.effects
    (alone,) = (h.fitted for h in fits)
    for name in ("mass", "position"):
        ref = effect.name, name
        assert done.best.fitted.std[ref] == pytest.approx(alone.std[ref], rel=0.02)


def test_nothing_is_found_where_nothing_is_hidden(tmp_path):
    found = diagnosed(tmp_path, mass=0.0, kinds=["point_mass", "member_stiffness"])
    assert found.verdict == NOTHING
    assert found.findings == ()


def test_what_the_library_lacks_stays_unexplained(tmp_path):
    found = diagnosed(tmp_path, mass=0.25, kinds=["member_torsion"])
    assert found.verdict == UNEXPLAINED
    assert found.posterior[-1][0] == ("unknown",)
    assert found.posterior[-1][1] > 0.5
    assert found.searched.unknown_probability == found.posterior[-1][1]


def test_the_best_so_far_is_named_where_nothing_explains_the_data(tmp_path):
    found = diagnosed(tmp_path, mass=0.25, kinds=["member_stiffness"])
    assert found.verdict == UNEXPLAINED
    assert found.findings == ()
    assert "best so far, not explained: member stiffness at member " in found.reason
    assert len(found.steps) == 2


def with_hidden(folder, mass, name, **values):
    """Return a study of the bent frame in which a candidate is hidden beside a mass, and its measurement."""
    known = {e.name: e for e in propose(load_study(write_study(folder, 0.0)).model)}
    study = load_study(write_study(folder, mass, others=[known[name].with_values(**values)]))
    return study.model, [without_held_out(study, m) for m in measured(study)], study.nuisances


@pytest.mark.slow
def test_of_two_hidden_effects_both_are_named(tmp_path):
    told = with_hidden(tmp_path, 0.25, "member_stiffness:post", change=-0.2)
    found = diagnose(*told, kinds=["point_mass", "member_stiffness"], model_error=0.1)
    assert found.verdict == EFFECT
    values = {f.effect.name: {p.name: p for p in f.parameters} for f in found.findings}
    assert set(values) == {"point_mass:arm", "member_stiffness:post"}
    assert values["point_mass:arm"]["mass"].value == pytest.approx(0.25, rel=0.05)
    change = values["member_stiffness:post"]["change"]
    assert abs(change.value + 0.2) < 2 * change.std


@pytest.mark.slow
def test_a_law_that_does_the_same_is_named_as_a_twin(tmp_path):
    """A foundation with a little loss is nearly a soft support, which has a parameter less."""
    told = with_hidden(tmp_path, 0.0, "foundation:foot.ry", stiffness=2e4, loss_factor=0.03)
    found = diagnose(*told, kinds=["support_flexibility", "foundation"], model_error=0.3)
    (finding,) = found.findings
    assert finding.effect.name == "support_flexibility:foot.ry"
    (twin,) = finding.twins
    assert twin.name == "foundation:foot.ry"
    assert found.searched.best.score - TWIN_NATS < twin.score < found.searched.best.score
    assert len(finding.proposals) == 1  # measurements that would separate them
    probability = dict(found.posterior)
    assert probability[finding.effect.name,] > probability[twin.name,] > 0.05


def test_a_weak_effect_is_found_where_the_form_is_right(tmp_path):
    study, measurements = asked(tmp_path, 0.01)
    found = diagnose(
        study.model, measurements, study.nuisances, kinds=["point_mass", "member_stiffness"], model_error=0.0
    )
    assert found.verdict == EFFECT
    (finding,) = found.findings
    mass, position = finding.parameters
    assert mass.value == pytest.approx(0.01, rel=0.15)
    assert position.value == pytest.approx(0.3, abs=0.01)
