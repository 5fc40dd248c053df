"""The algebra of low-rank errors against dense Gaussians and exact evidence."""

import numpy as np
import pytest

from updating.diagnosis.evidence.marginal import LowRank, log_evidence, scale_from


@pytest.fixture
def shapes():
    rng = np.random.default_rng(3)
    return rng.standard_normal((4, 7, 2)) + 1j * rng.standard_normal((4, 7, 2))


def dense(G, s):
    return np.eye(G.shape[1]) + s**2 * G @ G.conj().transpose(0, 2, 1)


def test_solution_and_determinant_are_those_of_the_dense_covariance(shapes):
    low, C = LowRank.of(shapes, 0.7), dense(shapes, 0.7)
    X = np.random.default_rng(4).standard_normal((4, 7, 3)) + 0j
    assert low.solved(X) == pytest.approx(np.linalg.solve(C, X), abs=1e-12)
    assert low.log_det == pytest.approx(np.linalg.slogdet(C)[1].sum(), abs=1e-11)


def test_what_is_left_of_the_errors_is_their_posterior_variance(shapes):
    low, C = LowRank.of(shapes, 0.7), dense(shapes, 0.7)
    prior = 0.49 * shapes @ shapes.conj().transpose(0, 2, 1)
    left = prior - prior @ np.linalg.solve(C, prior)
    assert low.variance() == pytest.approx(np.diagonal(left, axis1=1, axis2=2).real, abs=1e-11)


def test_evidence_of_a_linear_model_is_exact():
    """y = A z + e, e ~ N(0, 1), z ~ N(m, S²): ln p(y) is that of a Gaussian in closed form."""
    rng = np.random.default_rng(5)
    A, std, mean = rng.standard_normal((6, 2)), np.array([0.5, 2.0]), np.array([0.3, -1.0])
    y = rng.standard_normal(6)
    curvature = A.T @ A + np.diag(std**-2)
    z = np.linalg.solve(curvature, A.T @ y + mean / std**2)
    fit = -0.5 * ((y - A @ z) ** 2).sum() - 3 * np.log(2 * np.pi)
    C = np.eye(6) + (A * std**2) @ A.T
    r = y - A @ mean
    exact = -0.5 * r @ np.linalg.solve(C, r) - 0.5 * np.linalg.slogdet(C)[1] - 3 * np.log(2 * np.pi)
    assert log_evidence(fit, z - mean, std, curvature) == pytest.approx(exact, abs=1e-12)


def test_scale_of_errors_that_are_all_certain_is_their_root_mean_square():
    x = np.random.default_rng(6).standard_normal(2000) * 0.01
    assert scale_from(float((x**2).sum()), x.size, 0.01, 1e3) == pytest.approx(
        np.sqrt((x**2).mean()), rel=1e-6
    )
