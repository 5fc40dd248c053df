"""Fits to FRFs and measured modes of one structure together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fem.array_types import Bools, Complexes, Floats, Ints
from fem.model import Effect
from updating.inference.fit_function import ROBUST, Errors, FitFunction
from updating.inference.fit_result import FitResult
from updating.inference.frf_function import FrfFunction
from updating.inference.frf_inputs import FrfInputs
from updating.inference.mode_fit import ModeFunction, ModeProblem
from updating.inference.solve import Solution
from updating.least_squares.costs import Costs, pseudo_huber
from updating.least_squares.mode_levels import ModeLevels


@dataclass(frozen=True, slots=True, eq=False)
class JointLevels:
    """Levels of FRFs, and of modes behind them."""

    frf: Costs
    modes: ModeLevels

    def _parts(self, v: Floats) -> Sequence[Floats]:
        return np.split(v, [v.shape[-1] - len(self.modes.n)], axis=-1)

    @property
    def noise(self) -> Floats:
        """Mean squares that noise leaves, (n_groups,)."""
        return np.concatenate([self.frf.noise, self.modes.noise])

    @property
    def believed(self) -> JointLevels:
        """The same where every reading belongs."""
        return JointLevels(self.frf.believed, self.modes.believed)

    def cost(self, v: Floats) -> float:
        """Return the negative log likelihood at mean squares (n_groups,)."""
        return float(self.costs(v))

    def costs(self, v: Floats) -> Floats:
        """Return the negative log likelihoods at several sets of mean squares, (..., n_groups)."""
        first, second = self._parts(v)
        return self.frf.costs(first) + self.modes.costs(second)

    def weight(self, v: Floats) -> Floats:
        """Return twice its derivatives by the mean squares, (..., n_groups)."""
        first, second = self._parts(v)
        return np.concatenate([self.frf.weight(first), self.modes.weight(second)], axis=-1)

    def gain(self, v: Floats, least: Floats) -> float:
        """Return by how much the log likelihood would rise with mean squares no larger than the least."""
        (first, second), (least_frf, least_modes) = self._parts(v), self._parts(least)
        return self.frf.gain(first, least_frf) + self.modes.gain(second, least_modes)

    def is_bad(self, v: Floats) -> Floats:
        """Return the probability that the readings of each group are bad ones, (..., n_groups)."""
        first, second = self._parts(v)
        return np.concatenate([self.frf.is_bad(first), self.modes.is_bad(second)], axis=-1)


@dataclass(eq=False)
class JointFunction(FitFunction[FrfInputs]):
    """Residuals of FRFs, and of modes behind them, of the same unknowns.

    Attributes
    ----------
    frf : FrfFunction
    modes : ModeFunction
    """

    frf: FrfFunction = field(kw_only=True)
    modes: ModeFunction = field(kw_only=True)

    @classmethod
    def of(cls, frf: FrfFunction, modes: ModeFunction) -> JointFunction:
        """Return both together."""
        same = frf.problem, frf.effects, frf.variables, frf.start, frf.lines, frf.scatter
        return cls(*same, frf=frf, modes=modes)

    def __call__(self, x: Floats, gradient: bool) -> tuple[Complexes, Complexes | None]:
        """Return the residuals (m,) and their Jacobian (n, m), if asked."""
        frf, modes = self.frf, self.modes
        n = len(modes.start)
        r, J = frf(x, gradient)
        q, K = modes(x[:n], gradient)
        stacked = np.concatenate([r, q])
        if J is None or K is None:
            return stacked, None
        behind = np.zeros((len(x) - n, len(q)), dtype=complex)
        return stacked, np.hstack([J, np.vstack([K, behind])])

    @property
    def groups(self) -> Ints:
        """Band of each residual of an FRF, and kind of each of a mode, (m,)."""
        frf, modes = self.frf, self.modes
        # Groups of residuals of modes come behind those of FRFs from this number on
        return np.concatenate([frf.groups, 100 + modes.groups])

    @property
    def of_modes(self) -> Bools:
        """Which groups are those of modes, (n_groups,)."""
        return np.concatenate([self.frf.of_modes, self.modes.of_modes])

    def noise(self) -> Floats:
        """Return the mean squares of the residuals of each group that are put down to noise, (n_groups,)."""
        frf, modes = self.frf, self.modes
        return np.concatenate([frf.noise(), modes.noise()])

    def allowed_squares(self, *, usual: bool = False) -> Floats:
        """Return the mean squares that a right model may leave beyond noise, or usually does, by group."""
        return np.concatenate([part.allowed_squares(usual=usual) for part in (self.frf, self.modes)])

    def errors(self, x: Floats) -> Errors:
        """Return how far computed FRFs and modes are from the measured ones."""
        frf, modes = self.frf, self.modes
        return replace(modes.errors(x[: len(modes.start)]), frf_db=frf.errors(x).frf_db)

    def levels(self, stage: float = np.inf, counted_as: int = 0) -> JointLevels:
        """Return the levels of both."""
        frf, modes = self.frf, self.modes
        return JointLevels(frf.levels(stage, counted_as), modes.levels())

    def words_of(self, stage: float) -> str:
        """Return up to which frequency the fit goes."""
        return self.frf.words_of(stage)

    def result(self, solution: Solution) -> FitResult:
        """Return a solution as values; the level is that of the FRFs [nepers]."""
        r, _ = self.frf(solution.x, False)
        return replace(self.frf.result(solution), level=float(np.sqrt(pseudo_huber(r, ROBUST).mean())))


def mode_problem_of(problem: FrfInputs, effects: Sequence[Effect] = ()) -> ModeProblem | None:
    """Return the fit to the modes that a problem has in addition to FRFs, on a basis for given effects."""
    if problem.modes is None:
        return None
    return ModeProblem(
        reduced=problem.reduced.with_forces_of(effects),
        data=problem.modes,
        nuisances=problem.nuisances,
        damping=problem.damping,
        model_error=problem.model_error,
    )


def with_modes(problem: FrfInputs, function: FrfFunction, stage: float) -> FitFunction[FrfInputs]:
    """Return a function of FRFs with the modes of its problem up to a frequency [Hz], if it has any."""
    mode_problem = mode_problem_of(problem)
    if mode_problem is None:
        return function
    fitted = mode_problem.data.fitted
    lines = fitted[mode_problem.data.frequency[fitted] <= stage]
    if not lines.size:
        return function
    start = function.start[: len(function.variables) + len(problem.damping.start)]  # without scatter
    modes = ModeFunction(mode_problem, function.effects, function.variables, start, lines)
    return JointFunction.of(function, modes)
