"""FRFs at complex frequencies, the halving of candidates on them, and what a covariance says of absence."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.hidden.cases import make_case
from tests.noise import complex_normal
from tests.updating.test_evidence_blocks import hiding
from updating import build_problem, propose
from updating.diagnosis.evidence import Damped, Search, gains_without, halving, left_out, values_of
from updating.inference import LEAST_INSIDE, Continuation
from updating.inference.damped import damped


@pytest.fixture(scope="module")
def problem():
    case = make_case(3, "portal", "nothing")
    return build_problem(case.model, case.measurement, case.nuisances)


def with_receptance(problem, H):
    data = problem.data
    H = np.broadcast_to(H[:, None, None], data.H.shape).copy()
    return replace(problem, data=replace(data, H=H, mask=np.ones(data.mask.shape, dtype=bool)))


def oscillator(problem, omega):
    """Return 1 / (ω₀² - ω² + 2iζω₀ω) with its resonance in the middle of the band."""
    f = problem.data.frequency
    resonance = np.pi * (f[0] + f[-1])
    return 1 / (resonance**2 - omega**2 + 0.02j * resonance * omega)


@pytest.mark.parametrize("share", [0.04, 0.015])
def test_damped_frfs_are_those_at_complex_frequencies(problem, share):
    f = problem.data.frequency
    own = damped(with_receptance(problem, oscillator(problem, 2 * np.pi * f)), share)
    exact = oscillator(problem, 2 * np.pi * f - 1j * own.decay)
    assert own.decay == pytest.approx(2 * np.pi * share * (f[-1] - f[0]))
    there = own.data.mask[:, 0, 0]
    error = np.abs(own.data.H[there, 0, 0] - exact[there]) / np.abs(exact[there])
    assert error.max() < 1e-6  # a rational function continues itself, also beyond the band


@pytest.mark.parametrize("share", [0.04, 0.015])
def test_what_is_not_rational_is_summed(problem, share):
    """√(iω + a) has no poles; the sum errs by the part of the kernel that lies beyond the band."""
    f = problem.data.frequency

    def root(omega):
        return oscillator(problem, omega) * np.sqrt(1 + 1j * omega / omega[-1].real)

    own = damped(with_receptance(problem, root(2 * np.pi * f)), share)
    exact, there = root(2 * np.pi * f - 1j * own.decay), own.data.mask[:, 0, 0]
    error = np.abs(own.data.H[there, 0, 0] - exact[there]) / np.abs(exact[there])
    assert error.max() < 1 - LEAST_INSIDE
    assert np.median(error) < 2 / np.pi * np.arctan(2 * share) / 10


def test_noise_is_not_raised(problem):
    f = problem.data.frequency
    H = oscillator(problem, 2 * np.pi * f)
    rng = np.random.default_rng(0)
    noisy = H * (1 + 0.02 * complex_normal(rng, len(f)))
    own = damped(with_receptance(problem, noisy), 0.015)
    exact = oscillator(problem, 2 * np.pi * f - 1j * own.decay)
    there = own.data.mask[:, 0, 0]
    assert np.median(np.abs(own.data.H[there, 0, 0] / exact[there] - 1)) < 0.02


def test_a_roving_hammer_is_continued_as_the_responses_to_one_force(problem):
    """The poles are the same: a denominator over all forces would have eight times as many."""
    f, rng = problem.data.frequency, np.random.default_rng(1)
    H = oscillator(problem, 2 * np.pi * f)[:, None, None] * rng.uniform(0.5, 2, (1, 8, 1))
    H = H * (1 + 0.02 * complex_normal(rng, H.shape))
    responses, forces = Continuation.of(f, H), Continuation.of(f, np.swapaxes(H, 1, 2))
    np.testing.assert_array_equal(forces.poles, responses.poles)
    np.testing.assert_allclose(np.swapaxes(forces.at(2.0)[0], 1, 2), responses.at(2.0)[0], rtol=1e-9)


def test_the_model_is_computed_at_the_same_frequencies(problem):
    own = replace(damped(problem, 0.015), scatter=None)
    refs = [(n.effect, n.parameter) for n in problem.nuisances]
    values = [problem.reduced.model.values()[ref] for ref in refs]
    zeta = problem.damping.ratio(problem.data.frequency, problem.damping.start)
    H, dH, _ = own.engine(problem.data.frequency, refs).evaluate(np.array(values), zeta)
    # analytic below the real axis: from nearby decay rates the one between follows (Cauchy)
    near = [replace(own, decay=own.decay * k) for k in (0.999, 1.001)]
    both = [p.engine(p.data.frequency, refs).evaluate(np.array(values), zeta, False)[0] for p in near]
    np.testing.assert_allclose(sum(both) / 2, H, rtol=1e-4)
    step = [1.001 * values[0], *values[1:]], [0.999 * values[0], *values[1:]]
    up, down = (own.engine(problem.data.frequency, refs).evaluate(np.array(s), zeta, False)[0] for s in step)
    slope = (up - down) / (0.002 * values[0])
    # the step's square over that of the resonances' width, 3 % in stiffness: (0.001 / 0.03)²
    assert np.abs(slope - dH[0]).max() < 1e-3 * np.abs(slope).max()


def test_lines_beside_a_gap_are_left_out(problem):
    data = problem.data
    n = len(data.frequency)
    kept = np.r_[0 : n // 2 - n // 20, n // 2 + n // 20 : n]
    parts = {
        name: getattr(data, name)[kept] for name in ("frequency", "H", "mask", "noise", "weight", "held_out")
    }
    own = damped(replace(problem, data=replace(data, **parts)), 0.015)
    edge = n // 2 - n // 20
    assert own.data.held_out[edge - 1]
    assert own.data.held_out[edge]
    assert damped(problem, 0.015).data.mask[edge - 1].any()


def test_amplitudes_cannot_be_damped(problem):
    measurement = problem.data.measurement
    H = np.abs(measurement.frf.H).astype(complex)
    bare = replace(measurement, frf=replace(measurement.frf, H=H), phase=False)
    assert damped(replace(problem, data=replace(problem.data, measurement=bare)), 0.04) is None


@pytest.fixture(scope="module")
def soft(problem):
    """Return a search of data in which a foot turns far more easily than it should, and its first fit."""
    springs = {e.name: e for e in propose(problem.reduced.model, ["support_flexibility"])}
    grid = sorted(
        springs["support_flexibility:S1.ry"].starts(problem.surroundings), key=lambda v: v["stiffness"]
    )
    hidden = springs["support_flexibility:S1.ry"].with_values(**grid[len(grid) // 4])
    known = hiding(problem, [hidden])
    search = Search(known, (), propose(known.reduced.model, ["support_flexibility", "point_mass"]))
    return search, search.full((), ()), hidden


@pytest.mark.slow
def test_far_from_the_data_the_soft_connection_is_found(soft):
    search, base, hidden = soft
    assert search.fits.is_far(base)
    assert Damped(search.fits.free(base).damped_frfs(), base.fitted).for_look() is not None
    best = max(search.extended(base, set()), key=lambda h: h.score)
    assert best.key == {hidden.name}
    assert best.effects[0].stiffness == pytest.approx(hidden.stiffness, rel=0.05)


def test_the_covariance_tells_which_directions_a_block_does_not_need(soft):
    search, base, hidden = soft
    free = search.fits.free(base)
    block = [e for e in search.candidates if e.name.startswith("support_flexibility:S1.r")]
    start = [hidden if e.name == hidden.name else e.with_values(**search.amid([e])[1][0]) for e in block]
    h = search.fits.from_result(free, base.fitted, start, values_of(start), 16)
    names = [e.name for e in h.effects]
    gains = dict(zip(names, gains_without(free, h, [{n} for n in names], search.fits.odds), strict=True))
    assert gains.pop(hidden.name) < -50
    for name, gain in gains.items():
        rest = [e for e in h.effects if e.name != name]
        real = search.fits.quickly(free, h, rest, values_of(rest)).score - h.score
        assert gain > 0
        assert gain == pytest.approx(real, abs=5)
    assert left_out(free, h, names, search.fits.odds) == set(gains)


def test_lines_too_far_apart_for_the_resonances_are_not_damped(soft):
    search, base, _ = soft
    free = search.fits.free(base)
    data = replace(free.data, H=1.2 * free.receptance(base.fitted))
    names = "frequency", "H", "mask", "noise", "weight", "held_out"
    sparse = replace(data, **{name: getattr(data, name)[::40] for name in names})
    assert Damped(replace(free, data=data).damped_frfs(), base.fitted).at(0.004) is not None
    assert Damped(replace(free, data=sparse).damped_frfs(), base.fitted).at(0.004) is None


def test_a_fit_to_damped_frfs_begins_where_least_is_left(monkeypatch):
    """From the middle of its grid a stiff spring went to zero, and the verdict was "unexplained"."""
    left = {"soft": 0.4, "stiff": 0.1, "rigid": 0.3}

    def begun(problem, stage, effects, start):
        function = SimpleNamespace(
            misfit=lambda x: np.array([left[start]]),
            minimise=lambda x, *rest, **how: SimpleNamespace(cost=0.0, start=start),
            result=lambda solution: solution.start,
        )
        return function, start

    monkeypatch.setattr(halving, "_begun", begun)
    trial = halving._fitted((None, halving.STAGES[0]), ((), tuple(left)))
    assert trial is not None
    assert trial.result == "stiff"
