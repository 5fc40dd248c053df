"""Posterior probabilities over data that could have been measured in place of those that were.

Where no hypothesis is right, a posterior of many data believes one of them nearly surely, and other data
another one. Averaged over resampled data it doubts (Huggins and Miller, arXiv 2007.14845). The model's error
is common to neighbouring lines: blocks of lines are drawn as a whole, as many as there are independent data,
with the weights of Rubin's bootstrap, K Dirichlet(1, …, 1). Optima and volumes stay as they are.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from updating.diagnosis.evidence.hypothesis import Hypothesis, values_of
from updating.inference.fit import FitProblem
from updating.inference.fit_function import ROBUST
from updating.inference.fitting import FULL_LINES
from updating.inference.scatter import form_scatter
from updating.least_squares.levels import Levels
from updating.least_squares.loss import pseudo_huber

Floats = NDArray[np.float64]

N_DRAWS = 400
"""Resampled data."""
SEED = 7
"""Of their weights, so that a diagnosis gives the same probabilities again."""
MOST_NATS = 60.0
"""Hypotheses that are further behind the best one stay where they are."""
N_MOST = 24
"""So many are evaluated at most."""


def bagged(problem: FitProblem, hypotheses: Sequence[Hypothesis]) -> Floats:
    """Return the probabilities of hypotheses (n,), averaged over resampled data; they sum to 1.

    Parameters
    ----------
    problem : FitProblem
    hypotheses : sequence of Hypothesis
    """
    score = np.array([h.score for h in hypotheses])
    near = np.argsort(-score, kind="stable")[:N_MOST]
    near = near[score[near] > score.max() - MOST_NATS]
    rng = np.random.default_rng(SEED)
    scores, weights = np.repeat(score[:, None], N_DRAWS, axis=1), None
    for k in near:
        blocks = _by_block(problem, hypotheses[k])
        there = blocks[1] > 0
        if weights is None:
            drawn = rng.standard_exponential((N_DRAWS, *there.shape)) * there
            weights = drawn * (there.sum() / drawn.sum(axis=(1, 2), keepdims=True))
        scores[k] += _log_likelihood(weights, *blocks) - _log_likelihood(there[None].astype(float), *blocks)
    scores -= np.logaddexp.reduce(scores, axis=0)
    return np.asarray(np.exp(scores).mean(axis=1))


def _by_block(problem: FitProblem, h: Hypothesis) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Return losses and sizes of blocks (n_groups, n_blocks), and n, c and σ² of each group's level."""
    lines = problem.lines_up_to(np.inf, FULL_LINES)
    varied = replace(problem, scatter=form_scatter(problem, h.fitted, h.fitted.size))
    function = varied.function(h.effects, values_of(h.effects), lines)
    r, _ = function(function.moved_to(h.fitted), False)
    line = np.nonzero(function.keep)[0]
    member = np.unique(function.groups, return_inverse=True)[1]
    levels = function.levels(counted_as=FULL_LINES)
    assert isinstance(levels, Levels)
    count = np.maximum(np.rint(levels.n).astype(int), 1)
    block = np.zeros(len(member), dtype=np.int64)
    for g, n in enumerate(count):
        own = member == g
        rank = np.unique(line[own], return_inverse=True)[1]
        block[own] = rank * min(n, rank.max() + 1) // (rank.max() + 1)
    shape = (len(count), int(block.max()) + 1)
    at = np.ravel_multi_index((member, block), shape)
    losses = np.bincount(at, pseudo_huber(r, ROBUST), shape[0] * shape[1]).reshape(shape)
    sizes = np.bincount(at, minlength=shape[0] * shape[1]).reshape(shape).astype(float)
    return losses, sizes, levels.n, levels.least, levels.noise


def _log_likelihood(
    weights: Floats, losses: Floats, sizes: Floats, n: Floats, least: Floats, noise: Floats
) -> Floats:
    """Return that of :class:`updating.least_squares.levels.Levels` with weights of blocks, (n_draws,)."""
    size = np.maximum((weights * sizes).sum(axis=2), 1e-300)
    beyond = (weights * losses).sum(axis=2) / size - noise
    counted = n * size / sizes.sum(axis=1)
    cost = np.log(least + np.maximum(beyond, 0.0)) + np.minimum(beyond, 0.0) / least
    return -0.5 * (counted * cost).sum(axis=1)
