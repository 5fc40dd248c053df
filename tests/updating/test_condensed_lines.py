"""Condensed lines say of every choice of modes what all lines say."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fem import FRF
from tests.noise import complex_normal
from updating.modal import N_NODES, ModalFitData, condense_lines, condensed_lines, fit_modes


def term(omega, pole, power):
    return 1 / (omega - pole) ** power


def weighted(values, spread):
    return np.concatenate([(values / spread).real, (values / spread).imag])


@given(
    st.integers(0, 2**32 - 1),
    st.integers(21, 3000),
    st.floats(0.02, 300.0),
    st.booleans(),
)
@settings(max_examples=40, deadline=None)
def test_inner_products_of_modal_terms_and_data_are_those_of_all_lines(seed, n, width, uneven):
    rng = np.random.default_rng(seed)
    omega = np.sort(rng.uniform(0, n, n)) if uneven else np.arange(n, dtype=float)
    spread = np.exp(rng.standard_normal((n, 2)))  # weights that differ from line to line and input to input
    H = complex_normal(rng, (n, 3, 2))
    poles = rng.uniform(0, n, 3) + 1j * width * rng.uniform(0.5, 2.0, 3)
    lines = condense_lines(omega, H, spread, poles)
    assert lines.holds(poles)
    for i in range(2):
        y = lines.target.reshape(2, -1, 3)[i]
        at_nodes = np.hstack([lines.columns(term(lines.omega[:, None], poles, power), i) for power in (1, 2)])
        full = np.hstack(
            [weighted(term(omega[:, None], poles, power), spread[:, i, None]) for power in (1, 2)]
        )
        target = weighted(H[:, :, i], spread[:, i, None])
        size = np.linalg.norm(full, axis=0)
        np.testing.assert_allclose(
            at_nodes.T @ at_nodes / np.outer(size, size), full.T @ full / np.outer(size, size), atol=1e-9
        )
        np.testing.assert_allclose(
            (at_nodes / size).T @ y, (full / size).T @ target, atol=1e-9 * np.linalg.norm(target)
        )
    total = (np.abs(H / spread[:, None, :]) ** 2).sum()
    np.testing.assert_allclose(lines.residual + (lines.target**2).sum(), total, rtol=1e-12)
    assert lines.n_values == 2 * H.size


def test_far_from_poles_many_lines_become_the_nodes_of_one_segment():
    omega, H = np.linspace(0, 1, 5000), np.ones((5000, 1, 1), dtype=complex)
    lines = condense_lines(omega, H, np.ones((5000, 1)), np.array([0.5 + 5j]))
    assert lines.omega.size == N_NODES
    # a constant is a polynomial: nothing of it is left over
    assert lines.residual == pytest.approx(0.0, abs=1e-9)


def test_a_pole_that_moves_towards_the_lines_no_longer_holds():
    omega, H = np.linspace(0, 1, 5000), np.ones((5000, 1, 1), dtype=complex)
    lines = condense_lines(omega, H, np.ones((5000, 1)), np.array([0.5 + 5j]))
    # (z + √(z² - 1)) is 3 for z = (3 + 1/3)/2 half-lengths to the side
    assert lines.holds(np.array([0.5 + 0.5 * (3.01 + 1 / 3.01) / 2]))
    assert not lines.holds(np.array([0.5 + 0.5 * (2.99 + 1 / 2.99) / 2]))


def test_few_lines_stay_as_they_are():
    omega = np.arange(float(N_NODES))
    H = np.ones((N_NODES, 2, 1)) + 2j
    lines = condense_lines(omega, H, np.full((N_NODES, 1), 2.0), np.array([3 + 1e-3j]))
    np.testing.assert_array_equal(lines.omega, omega)
    np.testing.assert_array_equal(lines.target, np.repeat([[0.5], [1.0]], N_NODES, axis=0) * np.ones(2))
    assert lines.residual == 0


@pytest.mark.parametrize("added_decay", [0.0, 3.0])
def test_a_fit_and_its_deviations_are_those_of_all_lines(added_decay, monkeypatch):
    rng = np.random.default_rng(3)
    lines = np.linspace(0.05, 100.0, 1500)
    poles = np.array([-4.0 + 120j, -2.5 + 126j, -5.0 + 400j])
    L, psi = rng.standard_normal((3, 2)) + 0j, rng.standard_normal((4, 3)) + 0j
    s = 2j * np.pi * lines[:, None] + added_decay
    p, q = s**2 / (s - poles), s**2 / (s - poles.conj())
    H = np.einsum("fr,or,ri->foi", p, psi, L) + np.einsum("fr,or,ri->foi", q, psi.conj(), L.conj())
    H += 0.1 * complex_normal(rng, H.shape) * np.abs(H).mean()
    spread = np.exp(0.3 * rng.standard_normal((1500, 2)))
    data = ModalFitData(FRF.from_arrays(lines, H, "accelerance"), np.ones(4), spread, added_decay=added_decay)
    start = poles * (1 + 0.003 * rng.standard_normal(3))
    few = fit_modes(data, start, L)
    assert data.condensed(start).omega.size < 500
    monkeypatch.setattr(condensed_lines, "N_NODES", 1500)
    assert data.condensed(start).omega.size == 1500
    full = fit_modes(data, start, L)
    assert few.n_steps == full.n_steps
    np.testing.assert_allclose(few.poles, full.poles, rtol=1e-10)
    np.testing.assert_allclose(few.shapes, full.shapes, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(few.covariance.diagonal(), full.covariance.diagonal(), rtol=1e-6)
    np.testing.assert_allclose(few.energy, full.energy, rtol=1e-6)
