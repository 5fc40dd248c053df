"""Responses over that of a sensor: closed forms, slopes, and first-order changes."""

from dataclasses import replace

import numpy as np
import pytest

from fem import AddedMass, Damping, Joint, PointMass, assemble, compute_frf
from fem.reduction import LocalChanges
from tests.frames import STEEL, beam, portal
from tests.noise import complex_normal
from updating import (
    Measurement,
    Nuisance,
    Sensor,
    UnmeasuredForce,
    assessed_fit,
    computed_frf,
    sensor_rows,
)
from updating.diagnosis.evidence.places import Place, Reach
from updating.diagnosis.separation import next_measurements
from updating.inference.bases import direct_responses
from updating.inference.preparation import build_problem, prepared_like

X, Z = np.eye(3)[[0, 2]]
F = np.linspace(8.0, 180.0, 60)


def test_a_free_beam_that_is_shaken_at_one_end():
    """Euler-Bernoulli: w(0) / w(L) of a free beam with a force at L, by the four boundary conditions."""
    length, b, h = 1.0, 0.03, 0.01
    model = beam(30, length)
    ends = [Sensor("0", np.zeros(3), Z), Sensor("L", np.array([length, 0, 0]), Z)]
    force = UnmeasuredForce("shaker", ends[1].point, Z, reference=ends[1])
    frf = computed_frf(model, ends[:1], [force], F, "accelerance")
    EI, m = STEEL.E * b * h**3 / 12, STEEL.rho * b * h
    beta = (m * (2 * np.pi * F) ** 2 / EI) ** 0.25 * length
    # The receptances of Bishop & Johnson, The Mechanics of Vibration, 1960, table 7.1(c), over one another.
    still = np.cos(beta) * np.sinh(beta) - np.sin(beta) * np.cosh(beta)
    ratio, far = (np.sinh(beta) - np.sin(beta)) / still, np.abs(still) > 0.05 * np.cosh(beta)
    assert far.sum() > 40
    assert frf.H[far, 0, 0] == pytest.approx(ratio[far], rel=1e-4)


def measured(model, excitations, noise=0.0, seed=1):
    """Return what sensors on a portal measure of a model, to excitations."""
    places = {p: model.mesh.points[p] for p in (3, 7, 9, 11)}
    sensors = tuple(Sensor(f"{p}{k}", xyz, d) for p, xyz in places.items() for k, d in (("x", X), ("z", Z)))
    frf = computed_frf(model, sensors, excitations, F, "accelerance")
    H = frf.H * (1 + noise * complex_normal(np.random.default_rng(seed), frf.H.shape))
    return Measurement(replace(frf, H=H), sensors, tuple(excitations))


@pytest.fixture(scope="module")
def problem():
    """One force of unknown size and one that was measured, on a portal with a load."""
    model = portal(0.2).with_effect(AddedMass(name="load", point=5, mass=0.7))
    model = model.with_damping(Damping.structural(0.02))
    reference = Sensor("reference", model.mesh.points[10], (X + Z) / np.sqrt(2))
    forces = (
        UnmeasuredForce("shaker", model.mesh.points[6], X, reference=reference),
        Sensor("hammer", model.mesh.points[4], Z),
    )
    heavier = model.with_values({("load", "mass"): 0.9})
    nuisances = [Nuisance("load", "mass", 0.1), Nuisance("frame", "E:steel", 0.03)]
    return build_problem(model, measured(heavier, forces, 0.003), nuisances)


def test_units_and_names_say_what_refers_to_what(problem):
    frf = problem.data.measurement.frf
    assert (frf.quantity, frf.unit, frf.base) == ("accelerance, transmissibility", "(m/s²)/N, -", ("shaker",))
    assert not problem.data.measurement.has_structure_poles


def test_the_reduced_model_has_the_ratios_of_the_full_one(problem):
    at = problem.nominal()
    m, model = problem.data.measurement, problem.reduced.model
    reference = m.excitations[0].reference
    zeta = problem.damping.ratio(problem.data.frequency, at.zeta)
    assert np.ptp(zeta) < 1e-12
    damped = model.with_damping(Damping.structural(0.02 + 2 * float(zeta[0])))
    rows = sensor_rows(model, (*m.sensors, reference))
    H = compute_frf(assemble(damped), F, rows, sensor_rows(model, m.excitations), "receptance").H
    T = H[:, :-1, 0] / (-((2 * np.pi * F) ** 2)[:, None] * H[:, -1:, 0])
    assert problem.receptance(at)[:, :, 0] == pytest.approx(T, rel=2e-3)
    assert problem.receptance(at)[:, :, 1] == pytest.approx(H[:, :-1, 1], rel=2e-3)
    assert direct_responses(problem, at, 12)[0] < 1e-3


@pytest.mark.parametrize("phase", [True, False])
def test_slopes_of_residuals_are_those_of_differences(problem, phase):
    """Of parameters, damping, small deviations and errors of channels alike."""
    data = replace(problem.data, measurement=replace(problem.data.measurement, phase=phase))
    problem = replace(problem, data=data)
    scattered = replace(problem, scatter=problem.small_deviations(problem.nominal()))
    assert scattered.scatter.n_channels > 0
    candidate = PointMass(name="more", member="beam", position=0.11, mass=0.2)
    values = {"mass": 0.2, "position": 0.11}
    function = scattered.function([candidate], [values], np.arange(0, len(F), 7))
    rng = np.random.default_rng(3)
    x, n = function.start.copy(), len(function.variables)
    x[:n] += 0.1 * rng.standard_normal(n)
    _, J = function(x, True)
    for k in range(len(x)):
        step = 1e-5 * np.eye(len(x))[k]
        slope = (function(x + step, False)[0] - function(x - step, False)[0]) / 2e-5
        assert J[k] == pytest.approx(slope, abs=1e-4 * np.abs(slope).max() + 1e-5)


def test_first_order_changes_are_those_of_small_effects(problem):
    """What screening and forecasts read: low-rank updates, and slopes from the fields of responses."""
    f = problem.data.frequency[::7]
    zeta = np.full(len(f), 0.01)
    base = LocalChanges.of(problem.engine(f), np.zeros(0), zeta)
    little = Joint(name="spring", point1=9, location=problem.reduced.model.mesh.points[9], K=np.eye(6) * 1e-3)
    H = problem.engine(f, (), (little,)).evaluate(np.zeros(0), zeta, gradient=False)[0]
    exact = H - base.H
    (changed,) = base.receptances([little])
    assert changed - base.H == pytest.approx(exact, abs=1e-3 * np.abs(exact).max())
    slope = base.fields().slope(problem.reduced.model.parts_of(little))
    assert slope == pytest.approx(exact, abs=1e-3 * np.abs(exact).max())


def test_forces_at_a_place_reach_ratios_as_an_effect_there_does(problem):
    """What localisation scans: the change by a little is in the span of the shapes of its place."""
    f, zeta = problem.data.frequency[::7], np.full(len(problem.data.frequency[::7]), 0.01)
    base = LocalChanges.of(problem.engine(f), np.zeros(0), zeta)
    little = PointMass(name="little", member="beam", position=0.11, mass=1e-6)
    (changed,) = base.receptances([little])
    (shapes,) = Reach(problem.reduced.model, base).of([Place("point", "beam at 0.110 m", "beam", (little,))])
    change = (changed - base.H).transpose(0, 2, 1)[..., None]
    assert shapes.shape[:3] == change.shape[:3]
    scale = np.abs(shapes).max(axis=2, keepdims=True)
    Q, _ = np.linalg.qr(shapes / np.where(scale > 0, scale, 1.0))
    left = change - Q @ (np.swapaxes(Q.conj(), 2, 3) @ change)
    assert np.linalg.norm(left) < 1e-3 * np.linalg.norm(change)


def test_a_spring_at_the_reference_is_not_seen_by_a_force_there(problem):
    """Beyond the point where force and reference are, T is that of the rest driven by a known motion."""
    model = portal(0.2).with_damping(Damping.structural(0.02))
    at = model.mesh.points[6]
    force = (UnmeasuredForce("shaker", at, X, reference=Sensor("r", at, X)),)
    spring = Joint(name="spring", point1=6, location=at, K=np.diag([5e4, 0, 0, 0, 0, 0]))
    alone, loaded = (measured(m, force).frf.H[:, :, 0] for m in (model, model.with_effect(spring)))
    assert loaded == pytest.approx(alone, rel=1e-5, abs=1e-9 * np.abs(alone).max())


def test_checks_of_channels_see_responses_per_force(problem):
    at = problem.nominal()
    known = problem.as_forces(at)
    assert known.data.measurement.frf.base == ()
    assert known.data.measurement.has_structure_poles
    ratio = known.data.H / known.receptance(at)
    assert ratio == pytest.approx(problem.data.H / problem.receptance(at))
    assert known.as_forces(at) is known


def test_new_sensors_are_proposed_by_what_their_ratios_differ_by(problem):
    starts = {"mass": 0.3, "position": 0.11}, {"mass": 0.3, "position": 0.25}
    members = {e.member: e for e in PointMass.propose(problem.reduced.model)}
    candidates = [members[m].with_values(**s) for m, s in zip(("beam", "left"), starts, strict=True)]
    first, second = (assessed_fit(problem, [c], [s]) for c, s in zip(candidates, starts, strict=True))
    proposals = next_measurements(problem, first, second, most=1)
    (sensor,) = (p for p in proposals if p.kind == "sensor")
    new = Sensor("new", np.array(sensor.point), np.array(sensor.direction))
    m = problem.data.measurement
    frf = computed_frf(problem.reduced.model, [new], m.excitations, F, m.frf.kind)
    there = replace(problem, data=prepared_like(problem, Measurement(frf, (new,), m.excitations)))
    d = 20 * np.log10(np.abs(there.receptance(first) / there.receptance(second)))
    assert sensor.difference_db == pytest.approx(np.sqrt((d**2).mean()), rel=0.1)
