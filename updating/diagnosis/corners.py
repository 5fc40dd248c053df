"""Corners of finite size, which a structure of solid members has and its centre lines lack.

They act everywhere at once, and where beams are not the structure itself they may hide what is searched for:
the search is made with them in the model, their size and rigid-zone factor among the uncertain parameters,
and without them only if they do not pay beside what it finds.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fem.effects.solid_corner import SolidCorner
from fem.model import Effect, Model, ParameterRef, parameter_values
from updating.diagnosis.acceptance import ACCEPT_GAIN, ACCEPT_LEVEL
from updating.diagnosis.findings import Finding, Step, parameters_of, step_added, step_of
from updating.diagnosis.search import QUICK_ITERATIONS, QUICK_LINES, Search
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.parameters import Nuisance

CORNER_STD, CORNER_REACH = 0.3, 2.0
"""Relative prior deviation of the corners' size from what the sections say, and of their rigid-zone factor;
by how many of them the size may be off."""
CORNER_LEAST = 0.1
"""Corners that a short fit without these priors makes smaller are not looked at further."""
CORNER_COST = 10.0
"""By so much the negative log posterior may rise with them before what is missing has been found."""


@dataclass(frozen=True, slots=True, eq=False)
class Cornered:
    """A model with corners of finite size, and what it does without further effects.

    Attributes
    ----------
    corner : SolidCorner
        As the sections draw it.
    model : Model
        With it.
    problem : FitProblem
        The fits' with it.
    fit : FitResult
        With the uncertain parameters fitted, those of the corners among them.
    bare : FitResult or None
        What is left without it of all that was found beside it, once that is known.
    """

    corner: SolidCorner
    model: Model
    problem: FitProblem
    fit: FitResult
    bare: FitResult | None = None

    def begin(self, nominal: Step) -> Search:
        """Return a search with the corners in the model, whose second step is that they were added."""
        steps = self.without(nominal), step_added([self.corner], self.fit)
        return Search(self.problem, (), (), steps, self.fit)

    def kept(self, plain: FitProblem, last: FitResult) -> "Cornered | None":
        """Return this with what is left without it if the corners pay beside the effects of a fit, or None.

        They do if without them the cost is higher by more than ``ACCEPT_GAIN`` and the level by more than
        ``ACCEPT_LEVEL`` times.

        Parameters
        ----------
        plain : FitProblem
            Without corners.
        last : FitResult
        """
        reduced = plain.reduced.with_forces_of(last.effects)
        plain = replace(plain, reduced=reduced, n_lines=self.problem.n_lines)
        starts = [parameter_values(e) for e in last.effects]
        ways = [{"stages": plain.stages[-1:], "x_from": last}, {}]
        fits = [plain.fit(last.effects, starts, assess=False, **way) for way in ways]
        bare = plain.assessed(min(fits, key=lambda r: r.solution.cost))
        gain = bare.solution.cost - last.solution.cost
        if gain < ACCEPT_GAIN or bare.level < ACCEPT_LEVEL * last.level:
            return None
        return replace(self, bare=bare)

    def finding(self, last: FitResult) -> Finding:
        """Return the corners as a finding, with the values of the last fit."""
        values = {p.name: last.values[self.corner.name, p.name] for p in self.corner.parameters()}
        effect = self.corner.with_values(**values)
        return Finding(effect, parameters_of(effect, last), (), without=self.bare)

    def without(self, step: Step) -> Step:
        """Return a step from before as this problem's, with corners of no size."""
        absent = {(self.corner.name, p.name): p.absent for p in self.corner.parameters()}
        at = len(self.problem.nuisances) - len(absent)
        return step_of(step.label, _with_fixed(step.result, at, absent))


def with_corners(
    build: Callable[..., FitProblem],
    model: Model,
    candidates: Sequence[Effect],
    problem: FitProblem,
    before: FitResult,
) -> Cornered | None:
    """Return the model with corners of finite size unless the data speak against them.

    They are there wherever solid members are welded: what is searched for is looked for beside them if their
    size comes out within ``CORNER_REACH`` prior deviations of what the sections say and the cost rises by no
    more than ``CORNER_COST``. Whether they pay is asked in the end (:meth:`Cornered.kept`).

    Parameters
    ----------
    build : callable
        Makes the fits' problem of a model and its ``nuisances``.
    model : Model
    candidates : sequence of Effect
    problem : FitProblem
        Without corners, with the data as they are by now.
    before : FitResult
        Its fit, without effects.
    """
    corner = next((e for e in candidates if isinstance(e, SolidCorner)), None)
    if corner is None:
        return None
    corner = corner.with_values(size=1.0)
    quick = {"stages": problem.stages[-1:], "n_lines": QUICK_LINES, "max_iterations": QUICK_ITERATIONS}
    first = problem.fit([corner], [parameter_values(corner)], x_from=before, assess=False, **quick)
    if first.values[corner.name, "size"] < CORNER_LEAST:
        return None
    own = tuple(Nuisance(corner.name, p.name, CORNER_STD) for p in corner.parameters())
    nuisances = (*problem.nuisances, *own)
    drawn = model.with_effect(corner)
    reduced = build(drawn, nuisances=nuisances).reduced
    # Inside of corners the modes are stiffer than any of the model without.
    reduced = reduced.with_modes_of(problem.reduced.model, float(problem.data.frequency[-1]))
    mine = replace(problem, reduced=reduced, nuisances=nuisances)
    on = mine.fit(stages=mine.stages[-1:], x_from=before, assess=False)
    fit = min(mine.fit_anew(), on, key=lambda r: r.solution.cost)
    off = abs(fit.values[corner.name, "size"] - 1) / CORNER_STD
    if off > CORNER_REACH or fit.solution.cost > before.solution.cost + CORNER_COST:
        return None
    return Cornered(corner, drawn, mine, mine.assessed(fit))


def _with_fixed(result: FitResult, at: int, fixed: dict[ParameterRef, float]) -> FitResult:
    """Return a fit with more values that it did not vary, the first of them in place ``at``."""
    known = list(result.values.items())
    values = dict([*known[:at], *fixed.items(), *known[at:]])
    covariance, places = result.covariance, [at] * len(fixed)
    if covariance.size:
        covariance = np.insert(np.insert(covariance, places, 0.0, axis=0), places, 0.0, axis=1)
    return replace(
        result, values=values, std={**result.std, **dict.fromkeys(fixed, 0.0)}, covariance=covariance
    )
