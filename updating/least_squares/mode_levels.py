"""The cost of residuals with known noise, a discrepancy of unknown size, and readings that may be bad."""

from dataclasses import dataclass, replace

import numpy as np

from fem.array_types import Floats, Ints

SHARES = np.append(0.0, np.geomspace(0.02, 1.0, 12))
"""Sizes of a discrepancy between the least and the largest, all as probable [-]."""
MEAN_SQUARE = float((SHARES**2).mean())
"""Their mean square."""


@dataclass(frozen=True, slots=True, eq=False)
class ModeLevels:
    """The negative log likelihood of residuals by the mean square v of each group, up to a constant.

    A group is one reading: the frequency, the damping ratio or the shape of one mode. Readings of one kind
    have a discrepancy τ in common, whose size τ_k has the prior probability p_k. Of each kind the cost is

        -ln Σ_k p_k Π_i [(1 - π) s⁻ⁿ exp(-N v / 2s²) + π b⁻ⁿ exp(-N v / 2b²)],  s² = σ_i² + τ_k².

    The second term is that of a bad reading, which may be anything within the wide deviation b. Where n
    values are independent of N residuals, as one component of a shape is lost to its scale, n stands in the
    first place alone.

    Attributes
    ----------
    kind : ndarray of int (n_groups,)
        Rising.
    n : ndarray (n_groups,)
        Independent data of each group.
    size : ndarray (n_groups,)
        Residuals of each group, N.
    variance : ndarray (n_groups,)
        σ² of one of the data.
    discrepancy : ndarray (n_groups, n_sizes)
        τ², each as probable as the others.
    bad : ndarray (n_groups,)
        b².
    bad_prior : float
        π; 0 where every reading belongs.
    """

    kind: Ints
    n: Floats
    size: Floats
    variance: Floats
    discrepancy: Floats
    bad: Floats
    bad_prior: float = 0.0

    @classmethod
    def up_to(
        cls,
        kind: Ints,
        n: Floats,
        size: Floats,
        variance: Floats,
        largest: Floats,
        bad: Floats,
        bad_prior: float = 0.0,
        least: Floats | float = 0.0,
    ) -> "ModeLevels":
        """Return levels whose discrepancy may be of any order of magnitude between two sizes, (n_groups,)."""
        low, high = np.square(least * np.ones(len(kind)))[:, None], largest[:, None] ** 2
        return cls(kind, n, size, variance, low + (high - low) * SHARES**2, bad, bad_prior)

    @property
    def noise(self) -> Floats:
        """Mean squares that noise leaves, (n_groups,)."""
        return self.n * self.variance / self.size

    @property
    def believed(self) -> "ModeLevels":
        """The same where every reading belongs."""
        return replace(self, bad_prior=0.0) if self.bad_prior else self

    @property
    def _log_prior(self) -> float:
        return float(np.log(self.bad_prior)) if self.bad_prior else -np.inf

    def _parts(self, v: Floats) -> tuple[Floats, Floats, Floats]:
        """Return s², and the log likelihoods of readings that belong, and of bad ones, (..., n_groups, n)."""
        total, v = self.variance[:, None] + self.discrepancy, v[..., None]
        n, size, bad = self.n[:, None], self.size[:, None], self.bad[:, None]
        belong = np.log1p(-self.bad_prior) - 0.5 * n * np.log(total) - 0.5 * size * v / total
        strange = self._log_prior - 0.5 * n * np.log(bad) - 0.5 * size * v / bad
        return total, belong, strange

    def _of_kinds(self, each: Floats) -> Floats:
        """Return the sums over the groups of each kind, (..., n_kinds, n_sizes)."""
        return np.add.reduceat(each, np.unique(self.kind, return_index=True)[1], axis=-2)

    def _log_mean(self, each: Floats) -> Floats:
        """Return the logarithms of the likelihood of all kinds, over all sizes of the discrepancy."""
        of_kinds = self._of_kinds(each)
        return (np.logaddexp.reduce(of_kinds, axis=-1) - np.log(of_kinds.shape[-1])).sum(axis=-1)

    def _shares(self, v: Floats) -> tuple[Floats, Floats, Floats]:
        """Return s², how probable each size is, and that a reading belongs if it is so."""
        total, belong, strange = self._parts(v)
        either = np.logaddexp(belong, strange)
        of_kinds = self._of_kinds(either)
        size = np.exp(of_kinds - np.logaddexp.reduce(of_kinds, axis=-1)[..., None])
        member = np.unique(self.kind, return_inverse=True)[1]
        return total, size[..., member, :], np.exp(belong - either)

    def cost(self, v: Floats) -> float:
        """Return the negative log likelihood at mean squares (n_groups,)."""
        return float(self.costs(v))

    def costs(self, v: Floats) -> Floats:
        """Return the negative log likelihoods at several sets of mean squares, (..., n_groups)."""
        _, belong, strange = self._parts(v)
        return -self._log_mean(np.logaddexp(belong, strange))

    def weight(self, v: Floats) -> Floats:
        """Return twice its derivatives by the mean squares, (..., n_groups)."""
        total, size, belong = self._shares(v)
        each = belong / total + (1 - belong) / self.bad[:, None]
        return self.size * (size * each).sum(axis=-1)

    def gain(self, v: Floats, least: Floats) -> float:
        """Return by how much the log likelihood would rise with mean squares no larger than the least.

        By something unknown: it may move a mode as far as a bad reading is off, so that one mode speaks for
        it by no more than the odds against a bad reading.
        """
        now = np.logaddexp(*self._parts(v)[1:])
        then = np.logaddexp(*self._parts(np.minimum(v, least))[1:])
        return float(self._log_mean(np.minimum(then, now - self._log_prior)) - self._log_mean(now))

    def is_bad(self, v: Floats) -> Floats:
        """Return the probability that each reading is a bad one, (..., n_groups)."""
        _, size, belong = self._shares(v)
        return (size * (1 - belong)).sum(axis=-1)

    def discrepancy_square(self, v: Floats) -> Floats:
        """Return the expected square of the discrepancy of each group, E[τ²], (n_groups,)."""
        return (self._shares(v)[1] * self.discrepancy).sum(axis=-1)

    def discrepancy_share(self, v: Floats) -> Floats:
        """Return the share of the residuals that is discrepancy, E[τ² / (σ² + τ²)], (n_groups,) [-]."""
        total, size, _ = self._shares(v)
        return (size * self.discrepancy / total).sum(axis=-1)
