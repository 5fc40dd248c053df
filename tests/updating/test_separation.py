"""What tells two explanations apart: pieces of the data, and measurements that could be taken next."""

from dataclasses import replace

import numpy as np
import pytest

import fem
from fem import FRF, PointMass
from tests.frames import beam, fix, frequencies
from updating import (
    Measurement,
    ModeTargets,
    Nuisance,
    Sensor,
    assessed_fit,
    build_problem,
    place_sensors,
    propose,
)
from updating.diagnosis import what_decides
from updating.diagnosis.separation import next_measurements
from updating.inference import formed_mode_problem


def two_cantilevers():
    """Two equal, separate cantilevers A and B; all is measured on A, at its tip."""
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]
    mesh = fem.Mesh.from_lines(points, [[0, 1], [2, 3]], {"A": [0], "B": [1]})
    tip = Sensor("tip", np.array([1.0, 0, 0]), np.array([0, 0, 1.0]))
    root = Sensor("B root", np.array([0.2, 1.0, 0]), np.array([0, 0, 1.0]))
    mesh = place_sensors(mesh, (tip, root)).refined(0.1)
    steel = fem.MemberProperties(fem.Material("steel", 210e9, 7850.0), fem.Section.rectangle(0.02, 0.01))
    held = tuple(
        fem.Support(name=n, point=mesh.nearest_point(np.array(p))[0])
        for n, p in (("SA", [0.0, 0, 0]), ("SB", [0.0, 1, 0]))
    )
    spring = fem.Joint(
        name="tie",
        point1=mesh.nearest_point(np.array([1.0, 0, 0]))[0],
        point2=mesh.nearest_point(np.array([1.0, 1, 0]))[0],
        location=np.array([1.0, 0.5, 0]),
        K=np.diag([0, 0, 2e3, 0, 0, 0.0]),
    )
    members = dict.fromkeys(mesh.members, steel)
    return fem.Model(mesh, (fem.Frame(members=members), *held, spring), fem.Damping.modal(0.01)), tip, root


def problem_of(model, sensors, drives, hidden):
    f = np.linspace(2.0, 200.0, 300)
    rows = [np.zeros((len(group), model.n_dof)) for group in (sensors, drives)]
    for group, block in zip((sensors, drives), rows, strict=True):
        for row, s in zip(block, group, strict=True):
            point = model.mesh.nearest_point(s.point)[0]
            row[6 * point : 6 * point + 3] = s.direction
    exact = fem.compute_frf(fem.assemble(model.with_effect(hidden)), f, *rows)
    noise = 0.01 * np.random.default_rng(0).standard_normal((2, *exact.H.shape))
    H = exact.H * (1 + noise[0] + 1j * noise[1])
    frf = FRF.from_arrays(f, H, exact.kind, [s.name for s in sensors], [s.name for s in drives])
    return build_problem(model, Measurement(frf, sensors, drives), ())


def mass_on(member, model):
    (effect,) = (e for e in PointMass.propose(model) if e.member == member)
    return effect.with_values(position=0.6, mass=0.3)


@pytest.fixture(scope="module")
def fits():
    model, tip, _ = two_cantilevers()
    problem = problem_of(model, (tip,), (tip,), mass_on("B", model))
    start = {"position": 0.6, "mass": 0.3}
    return problem, *(assessed_fit(problem, [mass_on(m, model)], [start], x_from=None) for m in ("B", "A"))


def test_what_decides_is_what_the_first_fits_better(fits):
    problem, right, wrong = fits
    pieces = what_decides(problem, right, wrong)
    assert pieces
    assert all(p.first_db < p.second_db for p in pieces)
    assert sum(p.share for p in pieces) <= 1 + 1e-9
    # the other way round only what is left by chance speaks
    assert sum(p.second_db - p.first_db for p in what_decides(problem, wrong, right)) < sum(
        p.second_db - p.first_db for p in pieces
    )


def test_the_same_explanation_needs_no_measurement(fits):
    problem, right, _ = fits
    proposals = next_measurements(problem, right, right)
    assert proposals
    for p in proposals:
        assert p.evidence < 1e-12
        assert p.difference_db < 1e-9


def proposed(problem, right, wrong):
    return {(p.kind, p.where): p.evidence for p in next_measurements(problem, right, wrong, most=1000)}


def test_an_error_of_the_model_takes_evidence_away(fits):
    """Fits that leave far more than noise promise less."""
    problem, right, wrong = fits
    known = proposed(problem, right, wrong)
    error = 1 + 0.2 * np.sin(0.1 * problem.data.frequency)[:, None, None]
    off = replace(problem, data=replace(problem.data, H=problem.data.H * error))
    shares = [value / known[what] for what, value in proposed(off, right, wrong).items() if known[what] > 1.0]
    assert len(shares) > 10
    assert max(shares) < 1


def test_a_sensor_on_the_other_beam_separates_masses_on_either(fits):
    problem, right, wrong = fits
    proposals = next_measurements(problem, right, wrong)
    sensors = [p for p in proposals if p.kind == "sensor"]
    assert {"sensor", "excitation", "band"} <= {p.kind for p in proposals}
    assert "member B" in sensors[0].where
    assert sensors[0].direction == (0.0, 0.0, 1.0)


def test_what_the_second_explanation_can_follow_counts_for_nothing(fits):
    """The gain of a sensor, or a modulus that the present data leave free, takes evidence away."""
    problem, right, wrong = fits
    m, known = problem.data.measurement, proposed(problem, right, wrong)
    vague = replace(problem.data, measurement=replace(m, errors=replace(m.errors, gain=1.0)))
    loose = replace(problem, nuisances=(Nuisance("frame", "E:steel", 0.05),))
    for other in (replace(problem, data=vague), loose):
        found = proposed(other, right, wrong)
        shares = [found[what] / value for what, value in known.items() if value > 1.0]
        assert max(shares) < 1.02
        assert min(shares) < 0.98


@pytest.mark.parametrize("kind", ["crack", "stiffness_loss", "point_mass"])
def test_a_fit_has_the_same_frfs_and_errors_on_any_basis_of_its_problem(kind):
    """A report draws rivals by the problem of the answer, whose basis lacks the forces of their effects."""
    model, tip, root = two_cantilevers()
    effect = next(e for e in propose(model, [kind]) if e.member == "A")
    effect = effect.with_values(**effect.starts(lambda key: 1e5)[0] | {"position": 0.437})
    problem = problem_of(model, (tip, root), (tip,), mass_on("B", model))
    bare = problem.nominal()
    values = {(effect.name, p.name): p.value for p in effect.parameters()}
    rival = problem.assessed(replace(bare, effects=(effect,), values={**bare.values, **values}))
    larger = replace(problem, reduced=problem.reduced.with_forces_of([effect]))
    assert larger.reduced is not problem.reduced
    np.testing.assert_allclose(problem.frf(rival).H, larger.frf(rival).H, rtol=1e-9)
    assert larger.assessed(rival).fit_db == pytest.approx(rival.fit_db, rel=1e-9)
    # errors of pieces are those of the curves that are drawn
    for piece in what_decides(problem, bare, rival):
        f, measured = problem.measured.frequency, problem.measured
        band = (f >= piece.band[0]) & (f <= piece.band[1])
        drawn = (problem.frf(fit).select([piece.output], [piece.input]).H[band] for fit in (bare, rival))
        seen = measured.select([piece.output], [piece.input]).H[band]
        errors = [np.sqrt(np.mean((20 * np.log10(abs(H / seen))) ** 2)) for H in drawn]
        assert errors == pytest.approx([piece.first_db, piece.second_db], rel=1e-9)


def test_modes_of_a_fit_are_the_same_on_any_basis_of_its_problem():
    model = beam(8, effects=(fix(0),))
    problem, _ = formed_mode_problem(model, ModeTargets.of(frequencies(model, 4), np.full(4, 0.002)), ())
    effect = next(iter(propose(problem.reduced.model, ["crack"])))
    effect = effect.with_values(**effect.starts(lambda key: 1e5)[0] | {"position": 0.437})
    bare = problem.nominal()
    values = {(effect.name, p.name): p.value for p in effect.parameters()}
    cracked = replace(bare, effects=(effect,), values={**bare.values, **values})
    larger = replace(problem, reduced=problem.reduced.with_forces_of([effect]))
    assert larger.reduced is not problem.reduced
    one, two = (p.computed(cracked).frequency for p in (problem, larger))
    np.testing.assert_allclose(one, two, rtol=1e-9)
