"""What effects do to the residuals of measured FRFs: exact, by low-rank updates of a solved state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from fem.array_types import Complexes, Floats, Ints
from fem.model import Effect, parameter_values
from fem.recent import Recent
from fem.reduction.local_changes import LocalChanges
from fem.reduction.terms import ReducedTerm
from updating.correlation import complex_log
from updating.inference.defaults import FULL_LINES
from updating.inference.fit_result import FitResult
from updating.inference.problem import ResidualChanges

VISIBLE = 1e-3
"""Changes of the compared FRFs below this are not seen: the directions measured do not have them [nepers]."""
LEAST_LINES = 12
"""Lines that are kept of them in any case."""
HEAVY_DAMPING = 0.3
"""Damping ratio at which resonances that shift by a half still overlap with where they were [-]."""
DAMPED_LINES, DAMPED_VALUES = 20, 400
"""Numbers of lines and values at which a heavily damped model is looked at: it is smooth."""


@dataclass(eq=False)
class FrfChanges(ResidualChanges):
    """Changes of the log ratios at a few lines.

    Of many FRFs not every value is looked at. ``at`` are the flat positions of those that are, in an array
    (n_lines, n_out, n_in), ``measured`` and ``weight`` what belongs to each. ``damping`` is the damping ratio
    of all modes if it is not that of the fit.
    """

    problem: Any
    lines: Ints
    at: Ints
    measured: Complexes
    weight: Floats
    damping: float | None = None
    # By the constraints that an effect releases: one has the responses of all DOFs to all sensors, and those
    # that release the same follow one another.
    _released: Recent = field(default_factory=lambda: Recent(2), init=False, repr=False)

    @classmethod
    def of(cls, problem: Any, base: FitResult, n_full: int | None, n_low: int, most: int) -> FrfChanges:
        """Solve the model of a fit at some lines; parameters as of :meth:`Problem.changes_at`."""
        problem = problem.unloaded(base)
        full = problem.lines_up_to(np.inf, n_lines(problem) if n_full is None else n_full)
        low = problem.lines_up_to(problem.stages[0], n_low)
        function = problem.function(base.effects, [parameter_values(e) for e in base.effects], full)
        data, lines = problem.data, np.concatenate([full, low])
        n_first = int(np.prod(data.mask[full].shape))
        flat = np.flatnonzero(data.mask[lines])
        of_full, of_low = flat[flat < n_first], flat[flat >= n_first]
        some = _some(len(of_full), most)
        at = np.concatenate([of_full[some], of_low[_some(len(of_low), most)]])
        return cls(
            base=base,
            function=function,
            x=function.moved_to(base),
            some=some,
            full_band=at < n_first,
            problem=problem,
            lines=lines,
            at=at,
            measured=data.H[lines].ravel()[at],
            weight=data.weight[lines].ravel()[at],
        )

    def heavily_damped(self) -> FrfChanges:
        """Return changes of the model's own receptances with ``HEAVY_DAMPING``, at some lines of the band.

        Those of sharp resonances that shift by more than their width do not grow with the shift.
        """
        n, shape = len(self.lines), self.problem.data.mask.shape[1:]
        line, of_line = np.divmod(self.at[self.full_band], int(np.prod(shape)))
        some = np.unique(np.linspace(0, line.max(initial=0), min(DAMPED_LINES, n)).round().astype(int))
        here = np.flatnonzero(np.isin(line, some))
        here = here[_some(len(here), DAMPED_VALUES)]
        at = np.searchsorted(some, line[here]) * int(np.prod(shape)) + of_line[here]
        out = replace(
            self,
            some=self.some[here],
            full_band=np.ones(len(here), dtype=bool),
            lines=self.lines[some],
            at=at,
            weight=np.ones(len(here)),
            damping=HEAVY_DAMPING,
        )
        out.measured = out.solved(()).H.ravel()[at]
        return out

    @cached_property
    def now(self) -> Complexes:
        """The weighted residuals of the fit, (m,)."""
        return self.residuals([self.solved(()).H])[0]

    @cached_property
    def resolution(self) -> Floats:
        """Changes of the residuals below these are not seen, (m,) [nepers]."""
        return np.full(len(self.at), VISIBLE)

    def by_terms(self, released: Sequence[tuple[str, str]], terms: Sequence[ReducedTerm]) -> Complexes:
        """Return the changes by terms added to the matrices, (n, m); NaN where there is no structure."""
        H = self.solved(tuple(released)).with_terms(terms)
        possible = np.array([bool(np.isfinite(each).all()) for each in H], dtype=bool)
        return np.where(possible[:, None], self.residuals(H) - self.now, complex("nan"))

    def has_slope(self, effect: Effect) -> bool:
        """Whether an effect changes the receptances by -Hₒ ΔZ Hᵢ: not what releases a constraint."""
        return not effect.released()

    @property
    def has_cheap_slopes(self) -> bool:
        """Return False: they need the responses at all DOFs."""
        return False

    def slopes(self) -> Callable[[Sequence[Effect]], Complexes]:
        """Return a function that gives the changes by small effects to the first order, (n, m).

        From the responses at all DOFs and the effects' own few element matrices: nothing is projected.
        """
        fields, model = self.solved(()).fields(), self.problem.reduced.model
        H = self.solved(()).H.ravel()[self.at]

        def of(effects: Sequence[Effect]) -> Complexes:
            if not effects:
                return np.zeros((0, len(self.at)), complex)
            dH = np.stack([fields.slope(model.parts_of(e), e.connection) for e in effects])
            with np.errstate(divide="ignore", invalid="ignore"):
                d = self.problem.data.seen(self.weight * dH.reshape(len(dH), -1)[:, self.at] / H)
            return np.where(np.isfinite(d), d, 0.0)

        return of

    def residuals(self, H: Sequence[Complexes]) -> Complexes:
        """Return the weighted residuals (n, m) of n receptances (n_lines, n_out, n_in)."""
        computed = np.array([each.ravel()[self.at] for each in H]).reshape(len(H), len(self.at))
        with np.errstate(divide="ignore", invalid="ignore"):
            r: Any = self.weight * self.problem.data.seen(complex_log(computed / self.measured))
        return np.where(np.isfinite(r), r, 0.0)

    @cached_property
    def _unreleased(self) -> LocalChanges:
        return self._solved_without(())

    def solved(self, released: tuple[tuple[str, str], ...]) -> LocalChanges:
        """Return the model solved at the lines, without the constraints that an effect releases."""
        if not released:
            return self._unreleased
        solved: LocalChanges = self._released.get(released, lambda: self._solved_without(released))
        return solved

    def _solved_without(self, released: tuple[tuple[str, str], ...]) -> LocalChanges:
        p, base = self.problem, self.base
        f, refs = p.data.frequency[self.lines], list(base.values)
        engine = p.engine(f, refs, base.effects, released, channels=base.channels)
        fitted = self.damping is None
        zeta = p.damping.ratio(f, base.zeta) if fitted else np.full(len(f), self.damping)
        return LocalChanges.of(engine, np.array([base.values[r] for r in refs]), zeta)


def n_lines(problem: Any) -> int:
    """Return at how many lines the responses of all DOFs are kept."""
    frf = problem.data.measurement.frf
    responses = problem.reduced.model.n_dof * (len(frf.outputs) + len(frf.inputs))
    # Largest number of responses of all DOFs, to sensors and forces at all lines, that are kept
    return min(FULL_LINES, max(20_000_000 // responses, LEAST_LINES))


def _some(n: int, most: int) -> Ints:
    """Return at most ``most`` of n positions, scattered: a fixed step might miss channels entirely."""
    return np.sort(np.random.default_rng(0).permutation(n)[:most])
