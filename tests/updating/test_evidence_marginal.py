"""Laplace's evidence is exact where a model is linear."""

import numpy as np
import pytest

from updating.diagnosis.evidence.marginal import log_evidence


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
