"""What data say of the form does not depend on the priors with which it was fitted."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from benchmarks.independent.learned_form import held_out
from updating.inference.learned_form import FormData, learned

U, MASS = ("corner", "u"), ("corner", "mass")
KINDS = U, MASS, U
NOW = np.array([[0.1, -0.2, 0.1], [0.25, 0.22, 0.25]])
NOISE = np.array([[0.02, 0.01, 0.0], [0.01, 0.03, 0.002], [0.0, 0.002, 0.01]])


def seen(x):
    """Return what data x with that noise say, from a fit with the present priors."""
    data = np.linalg.inv(NOISE)
    C = np.linalg.inv(data + np.diag(NOW[1] ** -2.0))
    value = C @ (data @ x + NOW[0] / NOW[1] ** 2)
    return FormData(KINDS, NOW, data, np.linalg.solve(C, value) - NOW[0] / NOW[1] ** 2)


def test_the_evidence_of_other_priors_is_that_of_a_normal_distribution():
    x = np.array([0.3, -0.5, 0.0])
    case = seen(x)
    priors = {U: (-0.3, 0.7), MASS: (0.2, 0.1)}
    mean, std = np.array([priors[kind] for kind in KINDS]).T
    exact = [
        multivariate_normal.logpdf(x, m, NOISE + np.diag(s**2)) for m, s in ((mean, std), (NOW[0], NOW[1]))
    ]
    assert case.log_evidence(priors) - case.log_evidence({}) == pytest.approx(exact[0] - exact[1], rel=1e-9)


def test_means_and_deviations_are_learned_and_predict_what_was_held_out():
    rng = np.random.default_rng(5)
    mean, std = np.array([0.6, -0.35, 0.6]), np.array([0.1, 0.05, 0.1])
    truth = mean + std * rng.standard_normal((30, 3))
    cases = {str(i): seen(x + rng.multivariate_normal(np.zeros(3), NOISE)) for i, x in enumerate(truth)}
    priors = learned(list(cases.values()))
    assert priors[U] == (pytest.approx(0.6, abs=0.06), pytest.approx(0.1, abs=0.06))
    assert priors[MASS] == (pytest.approx(-0.35, abs=0.06), pytest.approx(0.05, abs=0.05))
    gains = dict(held_out(cases, {U, MASS}))
    assert len(gains) == 30
    assert sum(gains.values()) > 30


def test_one_frame_changes_little_of_what_is_usual():
    far = seen(NOW[0] + 3 * NOW[1])
    mean, std = learned([far])[U]
    assert NOW[0, 0] + 0.3 * NOW[1, 0] < mean < NOW[0, 0] + 2.5 * NOW[1, 0]
    assert std > 0.5 * NOW[1, 0]


def test_data_that_say_nothing_teach_nothing():
    blind = FormData(KINDS, NOW, np.zeros((3, 3)), np.zeros(3))
    for kind, pair in learned([blind]).items():
        assert pair == pytest.approx(NOW[:, KINDS.index(kind)], rel=0.02)
