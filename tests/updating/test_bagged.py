"""Probabilities of hypotheses, averaged over resampled blocks of lines."""

from dataclasses import replace

import numpy as np
import pytest

from dovetail import load_study
from tests.frames import write_study
from updating.diagnosis.evidence import bagged as module
from updating.diagnosis.evidence.bagged import _by_block, _log_likelihood, bagged
from updating.least_squares.levels import Levels


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    return load_study(write_study(tmp_path_factory.mktemp("bar"))).diagnose()


def test_blocks_hold_all_residuals_and_unit_weights_change_nothing(found):
    searched = found.searched
    best = searched.best
    losses, sizes, n, least, noise = _by_block(searched.problem, best)
    v = losses.sum(axis=1) / sizes.sum(axis=1)
    assert (sizes > 0).sum(axis=1) == pytest.approx(np.rint(n))
    ones = (sizes > 0)[None].astype(float)
    (plain,) = _log_likelihood(ones, losses, sizes, n, least, noise)
    assert plain == pytest.approx(-Levels(n, least, noise).cost(v))


def test_probabilities_sum_to_one_and_are_those_of_the_posterior_without_resampling(found, monkeypatch):
    searched = found.searched
    ranked = sorted(searched.hypotheses, key=lambda h: -h.score)
    again = bagged(searched.problem, ranked)
    assert again.sum() == pytest.approx(1.0)
    np.testing.assert_array_equal(again, bagged(searched.problem, ranked))
    monkeypatch.setattr(module, "_log_likelihood", lambda *a: np.zeros(1))
    own = np.exp(np.array([h.score for h in ranked]) - searched.evidence)
    np.testing.assert_allclose(bagged(searched.problem, ranked), own / own.sum(), atol=1e-9)


def test_two_hypotheses_of_equal_fit_stay_as_probable(found):
    searched = found.searched
    twin = replace(searched.best, prior=searched.best.prior - 1.0)
    p = bagged(searched.problem, [searched.best, twin])
    np.testing.assert_allclose(p, np.array([np.e, 1.0]) / (1 + np.e))


def test_a_result_has_them_beside_the_posterior(found):
    assert len(found.resampled) == len(found.posterior)
    assert sum(found.resampled) == pytest.approx(1.0)
