"""The population of a fleet: what scatters and by how much, and which units are not of it.

The parameters that the fits of regular units give scatter normally about μ, with Σ, which has the fits' own
errors in it: all units are measured alike. Of the parameters only combinations count that the data know
better than the priors. The logarithm of a regular unit's rest is normal. An outlier's distance in the
parameters, its rest, or both are anything beyond the median of the regular ones: uniform in the logarithm up
to what a unit has that is drawn from the priors of the fits, or whose FRFs are unrelated to the model's, or
to the largest of the fleet. The shares of both classes, μ, Σ and the rest's
normal are estimated together by expectation and maximisation (Dempster, Laird and Rubin, *J. R. Stat. Soc. B*
39, 1977, 1). Nothing else decides what an outlier is.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from fem.array_types import Complexes, Floats, Ints

ITERATIONS, CHANGE = 200, 1e-6
"""Steps at most, and the change of all probabilities at which they end [-]."""
GAUSSIAN = 1.4826
"""Standard deviation of a normal quantity over its median absolute deviation [-]."""


class PopulationError(ValueError):
    """Too few units for a population."""


@dataclass(frozen=True, slots=True, eq=False)
class Population:
    """What the units of a fleet have in common.

    Attributes
    ----------
    mean, scatter : ndarray (n,), (n, n)
        μ and Σ of the parameters' x; combinations that the data do not determine have no scatter.
    determined : ndarray (n,)
        How far the data determine each parameter, from 0 to 1 [-].
    n_determined : int
        Combinations that they determine.
    common : ndarray of complex (n_lines, n_out, n_in)
        Median rest of all units: the error of the model.
    spread : ndarray (n_lines, n_out, n_in)
        Robust standard deviation of the rest about it, noise included; NaN where most units do not count.
    rest_mean, rest_std : float
        Of the logarithm of a regular unit's mean square rest, in units of the spread.
    share : float
        Share of outliers.
    distance : ndarray (n_units,)
        Squared distance of each unit in the parameters; of regular ones χ² with ``n_determined`` degrees of
        freedom.
    rest : ndarray (n_units,)
        Mean square rest in units of the spread.
    probability : ndarray (n_units,)
        That the unit is an outlier.
    odds : ndarray (n_units,)
        The logarithm of its odds, by which units are ranked.
    by_parameters : ndarray (n_units,)
        Probability that an outlier is one in the parameters alone.
    """

    mean: Floats
    scatter: Floats
    determined: Floats
    n_determined: int
    common: Complexes
    spread: Floats
    rest_mean: float
    rest_std: float
    share: float
    distance: Floats
    rest: Floats
    probability: Floats
    odds: Floats
    by_parameters: Floats

    @property
    def order(self) -> Ints:
        """Units from the most to the least probable outlier."""
        return np.argsort(-self.odds, kind="stable")

    def scaled_residual(self, residual: Complexes) -> Floats:
        """Return the rest of a unit in units of the spread, (n_lines, n_out, n_in), NaN where not counted."""
        return np.abs(residual - self.common) / (np.sqrt(2) * self.spread)


def find_population(x: Floats, covariance: Floats, prior: Floats, residual: Complexes) -> Population:
    """Return the population of the units of a fleet.

    Parameters
    ----------
    x : ndarray (n_units, n)
    covariance : ndarray (n_units, n, n)
        Of each x, by its own data and the priors.
    prior : ndarray (n,)
        Standard deviations of the priors of x.
    residual : ndarray of complex (n_units, n_lines, n_out, n_in)
        NaN where a value does not count.

    Raises
    ------
    PopulationError
        For fewer units than a covariance of the parameters needs.
    """
    W, back = _determined(covariance, prior)
    middle = np.median(x, axis=0)
    y, (n_units, n) = (x - middle) @ W, (len(x), W.shape[1])
    if n_units < n + 2:
        msg = f"{n_units} units are too few for the scatter of {n} parameters; at least {n + 2} are needed"
        raise PopulationError(msg)
    common, spread = _common(residual)
    with np.errstate(invalid="ignore"):
        rest = np.nanmean((np.abs(residual - common) ** 2 / (2 * spread**2)).reshape(n_units, -1), axis=1)
    log_rest = np.log(rest)
    deviation = GAUSSIAN * np.median(np.abs(y - np.median(y, axis=0)), axis=0)
    mean, scatter = np.median(y, axis=0), np.diag(np.maximum(deviation**2, 1e-12))
    a = float(np.median(log_rest))
    b = float(GAUSSIAN * np.median(np.abs(log_rest - a)))
    # Mean square |ln(a / b)| of unrelated FRFs, a and b independent complex normal: π²/12 in amplitude, π²/3
    # in phase [-]
    unrelated = float(np.log(np.nanmean((5 * np.pi**2 / 12) / (2 * spread**2))))
    share, odds, parameters = 0.05, np.zeros(n_units), np.zeros(n_units)
    regular, distance = np.ones(n_units), np.zeros(n_units)
    for _ in range(ITERATIONS):
        off = y - mean
        distance = np.einsum("ui,ui->u", off, np.linalg.solve(scatter, off.T).T)
        # What a unit from the priors of the fits has, whose y are standard normal.
        farthest = float(np.log(np.trace(np.linalg.inv(scatter))))
        density = _log_densities(log_rest, distance, n, (a, b), (unrelated, farthest))
        outlying = np.logaddexp.reduce(density[:, 1:], axis=1)
        odds = np.log(share / 3) + outlying - np.log1p(-share) - density[:, 0]
        parameters = np.exp(density[:, 2] - outlying)
        before, regular = regular, 1 / (1 + np.exp(np.clip(odds, -700, 700)))
        if np.abs(regular - before).max() < CHANGE:
            break
        # Half a unit of each class beforehand: a fleet without outliers has a share that is not 0.
        share = float((n_units - regular.sum() + 0.5) / (n_units + 1))
        mean = np.average(y, axis=0, weights=regular)
        scatter = np.cov(y.T, aweights=regular).reshape(n, n)
        a = float(np.average(log_rest, weights=regular))
        b = float(np.sqrt(np.average((log_rest - a) ** 2, weights=regular)))
    return Population(
        mean=middle + back @ mean,
        scatter=back @ scatter @ back.T,
        determined=(W * back).sum(axis=1),
        n_determined=n,
        common=common,
        spread=spread,
        rest_mean=a,
        rest_std=b,
        share=share,
        distance=distance,
        rest=rest,
        probability=1 - regular,
        odds=odds,
        by_parameters=parameters,
    )


def _determined(covariance: Floats, prior: Floats) -> tuple[Floats, Floats]:
    """Return W (n, k), by which y = xᵀ W are the combinations that the data determine, and x ≈ back y.

    In units of the priors these are the eigenvectors of the median unit's covariance with a variance below
    half: its data say more than the prior.
    """
    C = np.median(covariance, axis=0) / np.outer(prior, prior)
    variance, vectors = np.linalg.eigh((C + C.T) / 2)
    E = vectors[:, variance < 0.5]
    return E / prior[:, None], prior[:, None] * E


def _common(residual: Complexes) -> tuple[Complexes, Floats]:
    """Return the median of each value over the units, and its robust standard deviation in each part."""
    import warnings

    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "All-NaN", RuntimeWarning)
        common = np.nanmedian(residual.real, axis=0) + 1j * np.nanmedian(residual.imag, axis=0)
        off = residual - common
        parts = np.concatenate([np.abs(off.real), np.abs(off.imag)])
        spread = GAUSSIAN * np.nanmedian(parts, axis=0)
    most = np.isfinite(residual).mean(axis=0) > 0.5  # few units have no scatter of their own
    return common, np.where(most & (spread > 0), spread, np.nan)


def _log_densities(
    log_rest: Floats, distance: Floats, n: int, regular: tuple[float, float], most: tuple[float, float]
) -> Floats:
    """Return ln densities of ln rest and ln distance, of regular units and of three kinds of outlier.

    Outliers in the rest, in the parameters, and in both: (n_units, 4).

    Parameters
    ----------
    log_rest, distance : ndarray (n_units,)
    n : int
        Degrees of freedom of a regular unit's distance.
    regular : (float, float)
        Mean and standard deviation of a regular unit's ln rest.
    most : (float, float)
        Up to where ln rest and ln distance of outliers reach, or to the largest of all units.
    """
    a, b = regular
    log_distance = np.log(np.maximum(distance, 1e-300))
    regular_rest = scipy.stats.norm.logpdf(log_rest, a, b)
    regular_distance = scipy.stats.chi2.logpdf(distance, n) + log_distance  # of the logarithm
    far = float(np.log(scipy.stats.chi2.median(n)))
    wide_rest = _log_uniform(log_rest, a, most[0])
    wide_distance = _log_uniform(log_distance, far, most[1])
    return np.stack(
        [
            regular_rest + regular_distance,
            wide_rest + regular_distance,
            regular_rest + wide_distance,
            wide_rest + wide_distance,
        ],
        axis=1,
    )


def _log_uniform(x: Floats, low: float, high: float) -> Floats:
    """Return the logarithm of a uniform density from one value to another, or to the largest of all.

    Below, it is that of the smallest number: ranks need finite odds.
    """
    return np.log(np.maximum((x > low) / (max(float(x.max()), high) - low), 1e-300))
