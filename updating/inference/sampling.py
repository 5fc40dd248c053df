"""Samples of a posterior where its linearised normal approximation is not enough."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fem.array_types import Floats
from fem.summary import fields_summary


class MissingExtraError(ImportError):
    """A library that an optional part needs is not installed; the message says how to get it."""


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Samples of unknowns.

    Attributes
    ----------
    values : ndarray (n_samples, n)
    acceptance : float
        Part of the moves that were accepted; 0.2 to 0.5 is usual [-].
    correlation_time : float
        Steps after which a walker has forgotten where it was, the longest of all unknowns.
    """

    values: Floats
    acceptance: float
    correlation_time: float

    __repr__ = fields_summary

    def quantile(self, q: float) -> Floats:
        """Return a quantile of each unknown, (n,)."""
        return np.quantile(self.values, q, axis=0)

    @property
    def n_independent(self) -> float:
        """The effective number of independent samples."""
        return len(self.values) / max(self.correlation_time, 1.0)


def sample(
    log_probability: Callable[[Floats], float],
    mean: Floats,
    covariance: Floats,
    n_steps: int,
    *,
    n_walkers: int | None = None,
    seed: int = 0,
) -> Samples:
    """Sample a probability density by an ensemble of walkers (Goodman and Weare, 2010), with emcee.

    The walkers start as draws of the normal approximation; the first fifth of the steps is thrown away.

    Parameters
    ----------
    log_probability : callable
        Logarithm of the density of x (n,), up to a constant; -inf outside bounds.
    mean, covariance : ndarray (n,), (n, n)
    n_steps : int
        For each walker.
    n_walkers : int, optional
        Twice the number of unknowns and two more unless given.
    seed : int

    Raises
    ------
    MissingExtraError
        If emcee is not installed.
    """
    try:
        import emcee
    except ImportError as error:
        msg = "samples need emcee, which is not installed; install it with: python -m pip install emcee"
        raise MissingExtraError(msg) from error
    n = len(mean)
    n_walkers = 2 * n + 2 if n_walkers is None else n_walkers
    random = np.random.default_rng(seed)
    start: list[Floats] = []
    for _ in range(100 * n_walkers):
        x = random.multivariate_normal(mean, covariance, method="eigh")
        if np.isfinite(log_probability(x)):
            start.append(x)
        if len(start) == n_walkers:
            break
    else:
        msg = "hardly any draw of the normal approximation is within the bounds; widen them"
        raise ValueError(msg)
    sampler = emcee.EnsembleSampler(n_walkers, n, log_probability)
    sampler.random_state = np.random.RandomState(seed).get_state()
    sampler.run_mcmc(np.array(start), n_steps)
    burn = n_steps // 5
    with np.errstate(divide="ignore", invalid="ignore"):
        time = sampler.get_autocorr_time(discard=burn, quiet=True, tol=0)
    longest = float(np.nanmax(time)) if np.isfinite(time).any() else np.nan
    values = sampler.get_chain(discard=burn, flat=True)
    return Samples(values, float(np.mean(sampler.acceptance_fraction)), longest)
