"""Time convention and phase of FRFs are judged without a model: against closed forms, noise and odd bands."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fem import FRF, FRFKind
from fem.io import read_uff
from updating.quality import LEAST_RINGING, misphased, phase_evidence

LINES = np.arange(1.0, 400.0, 0.5)


def frf_of(shapes, natural, zeta, frequency=LINES, kind="accelerance", noise=0.0, seed=0, inputs=1) -> FRF:
    """Return Σ φφᵀ/(ω_r² - ω² + 2iζω_rω) (iω)^d, forces at the first rows, with relative noise."""
    w, w_r = 2 * np.pi * frequency[:, None], 2 * np.pi * np.asarray(natural)[None]
    q = 1 / (w_r**2 - w**2 + 2j * zeta * w_r * w)
    H = np.einsum("kr,ir,jr->kij", q, shapes, shapes[:inputs])
    H = H * (1j * w[:, :, None]) ** FRFKind(kind).derivatives
    g = np.random.default_rng(seed).standard_normal((2, *H.shape))
    H = H * (1 + noise * (g[0] + 1j * g[1]) / np.sqrt(2))
    return FRF.from_arrays(frequency, H, kind, [f"s{i}" for i in range(len(shapes))])


def beam(n=5, seed=1):
    """Return five sensors' parts in four modes, none of them near a node."""
    g = np.random.default_rng(seed)
    return g.choice([-1, 1], (n, 4)) * g.uniform(0.5, 1.5, (n, 4)), np.array([23.0, 61.0, 148.0, 290.0])


@pytest.mark.parametrize("kind", list(FRFKind))
@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_right_frfs_are_causal_and_in_phase(kind, noise):
    shapes, f = beam()
    e = phase_evidence(frf_of(shapes, f, 0.01, kind=kind, noise=noise, inputs=2))
    assert (e.direction == 1).all()
    assert (e.axis == 1).all()
    assert misphased(e) == []
    for i in range(
        2
    ):  # driven points take power; with 1 % of damping the direction is 1 within some per cent
        assert e.sense[i, i] == pytest.approx(1, abs=0.25)


@pytest.mark.parametrize("kind", list(FRFKind))
def test_conjugation_changes_the_sign_of_the_evidence_and_nothing_else(kind):
    shapes, f = beam()
    frf = frf_of(shapes, f, 0.01, kind=kind, noise=0.03)
    e = phase_evidence(frf)
    c = phase_evidence(replace(frf, H=frf.H.conj()))
    np.testing.assert_allclose(c.log_ratio, -e.log_ratio, rtol=1e-9)
    np.testing.assert_allclose(c.ringing, e.ringing, rtol=1e-9)
    (found,) = misphased(c)
    assert (found.fault, found.of, found.names) == ("conjugate", "all", ())


@pytest.mark.parametrize(("factor", "turn"), [(1j, 1), (-1j, -1), (2j, 1)])
def test_a_quarter_turn_is_found_with_its_sense(factor, turn):
    shapes, f = beam()
    frf = frf_of(shapes, f, 0.01, noise=0.03)
    (found,) = misphased(phase_evidence(replace(frf, H=factor * frf.H)), [(0, 0, 1.0)])
    assert (found.fault, found.of, found.turn) == ("quarter turn", "all", turn)
    other = misphased(phase_evidence(replace(frf, H=factor * frf.H)), [(0, 0, -1.0)])
    assert other[0].turn == -turn  # the sensor points against the force


@pytest.mark.parametrize("called", list(FRFKind))
@pytest.mark.parametrize("kind", list(FRFKind))
def test_kinds_an_odd_power_apart_are_a_quarter_turn_apart(kind, called):
    shapes, f = beam()
    frf = frf_of(shapes, f, 0.01, kind=kind)
    apart = called.derivatives - kind.derivatives
    e = phase_evidence(replace(frf, kind=called))
    assert (e.axis == (-1 if apart % 2 else 1)).all()
    if abs(apart) == 2:
        assert e.sense[0, 0].real < -0.9


def test_single_channels_are_named():
    shapes, f = beam()
    frf = frf_of(shapes, f, 0.01, noise=0.02, inputs=3)
    H = frf.H.copy()
    H[:, [1, 4]] = H[:, [1, 4]].conj()
    (rows,) = misphased(phase_evidence(replace(frf, H=H)))
    assert (rows.of, rows.names) == ("sensor", ("s1", "s4"))
    H = frf.H.copy()
    H[:, :, 1] *= 1j
    (column,) = misphased(phase_evidence(replace(frf, H=H)))
    assert (column.fault, column.of, column.names) == ("quarter turn", "excitation", ("in2",))
    H = frf.H.copy()
    H[:, 2, 0] = H[:, 2, 0].conj()
    (one,) = misphased(phase_evidence(replace(frf, H=H)))
    assert (one.of, one.names) == ("FRF", ("s2/in1",))


def test_a_band_with_an_antiresonance_alone_says_nothing():
    """The phase rises through an antiresonance, as it does through the resonance of a conjugated FRF."""
    frf = frf_of(np.array([[1.0, 1.2]]), [20.0, 200.0], 0.005, kind="receptance")
    lowest = LINES[np.argmin(np.abs(frf.H[:, 0, 0]))]
    part = frf.select(band=(lowest - 16, lowest + 16))
    turned = np.unwrap(np.angle(part.H[:, 0, 0]))
    assert turned[-1] - turned[0] > 2  # a rise of nearly π: not that of a pole
    e = phase_evidence(part)
    assert not e.direction.any()
    assert misphased(e) == []


def test_a_band_inside_one_resonance_is_no_quarter_turn():
    """At every line of it the receptance is imaginary rather than real."""
    frf = frf_of(np.ones((1, 1)), [100.0], 0.1, np.linspace(97, 103, 80), "receptance")
    e = phase_evidence(frf)
    assert e.lines[0, 0] < -0.8
    assert misphased(e) == []


def test_pure_noise_says_nothing():
    g = np.random.default_rng(4).standard_normal((2, 600, 40, 1))
    e = phase_evidence(FRF.from_arrays(np.arange(1.0, 601.0), g[0] + 1j * g[1]))
    assert not e.direction.any()


def test_polynomials_over_the_band_do_not_ring():
    """What the window leaves of a smooth FRF is no ringing: here of polynomials up to the fourth degree."""
    x = np.linspace(-1, 1, 500)
    H = np.stack([np.polynomial.legendre.legval(x, np.eye(5)[p]) for p in range(5)], axis=1)
    e = phase_evidence(FRF.from_arrays(np.linspace(10, 500, 500), H * np.exp(0.3j)))
    assert np.isnan(e.log_ratio).all()
    assert LEAST_RINGING < 0.01


@given(
    st.integers(0, 10**6),
    st.sampled_from([0.0005, 0.005, 0.03, 0.15]),
    st.sampled_from([0.0, 0.1, 0.5]),
    st.booleans(),
    st.sampled_from(list(FRFKind)),
)
@settings(max_examples=60, deadline=None)
def test_no_right_measurement_is_called_wrong(seed, zeta, noise, even, kind):
    """Modes drawn anywhere, dense or few, in any band, on even or logarithmic lines, with noise."""
    g = np.random.default_rng(seed)
    n = int(g.integers(1, 20))
    low = g.uniform(2, 200)
    high = low + np.exp(g.uniform(np.log(10), np.log(400)))
    n_lines = int(g.choice([40, 150, 600]))
    lines = np.linspace(low, high, n_lines) if even else np.geomspace(low, high, n_lines)
    frf = frf_of(g.standard_normal((4, n)), np.sort(g.uniform(5, 450, n)), zeta, lines, kind, noise, seed)
    assert not any(m.fault == "conjugate" for m in misphased(phase_evidence(frf)))


@pytest.mark.shared
@pytest.mark.parametrize(
    "file",
    [
        "southampton-frame/accelerance_3x3.uff",
        "independent-cases/a-frame-nothing-missing/frf.uff",
        "independent-cases/cross-beam-two-sensor-faults/frf.uff",
        "independent-cases/lap-joint-soft-about-x/frf.uff",
        "independent-cases/portal-tower-soft-bases/frf.uff",
    ],
)
def test_measured_and_independent_frfs_pass_and_their_conjugates_do_not(shared, file):
    frf = read_uff(shared / "data" / file).frf()
    assert misphased(phase_evidence(frf)) == []
    (found,) = misphased(phase_evidence(replace(frf, H=frf.H.conj())))
    assert (found.fault, found.of) == ("conjugate", "all")
