"""Far from the data: all candidates on strongly damped FRFs, the better ones on less and less damped ones.

There one start is enough, all else may move, and few lines hold everything. Each stage goes on from the last
one (successive halving: Jamieson & Talwalkar, *AISTATS* 2016).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations
from math import ceil
from typing import Any

import numpy as np

from fem.array_types import Complexes, Floats
from fem.model import Effect
from updating.correlation import log_ratio
from updating.diagnosis.evidence.fits import with_forces
from updating.diagnosis.evidence.hypothesis import Start, key_of, values_of
from updating.inference.belief import TWIN_NATS
from updating.inference.damped import DampedFrfs
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.fitting import FULL_LINES
from updating.inference.frf_function import FrfFunction
from updating.inference.problem import Problem
from updating.inference.workers import Workers


@dataclass(frozen=True, slots=True)
class HalvingStage:
    """A stage of the halving.

    Attributes
    ----------
    share : float
        Decay rate of the FRFs in parts of the band [-].
    n_lines, n_steps : int
        Lines, and steps of each fit.
    kept, least : float, int
        Share of the candidates of each sort that go on at most, and how many at least.
    """

    share: float
    n_lines: int
    n_steps: int
    kept: float
    least: int


STAGES = (
    HalvingStage(share=0.04, n_lines=14, n_steps=6, kept=0.34, least=4),
    HalvingStage(share=0.015, n_lines=24, n_steps=6, kept=0.25, least=2),
    HalvingStage(share=0.004, n_lines=40, n_steps=8, kept=0.5, least=2),
)
ROUGH_NATS = 0.5
"""A fit to damped FRFs ends when it gains less."""
BEHIND_NATS, TWINS_KEPT = 20.0, 0.5
"""Those so much behind the best do not go on but for the least; its twins do, up to this share of all."""
N_PAIRED = 3
"""Number of the best blocks of which pairs are made."""
Candidate = tuple[tuple[Effect, ...], tuple[Start, ...]]
"""Effects, and where their fit may begin: where they leave least."""


@dataclass(frozen=True, eq=False)
class Damped:
    """A problem at decay rates, where the data's misfit exceeds that of the fitted model's own damped FRFs.

    Attributes
    ----------
    measured : DampedFrfs
    result : FitResult
    """

    measured: DampedFrfs
    result: FitResult
    # By decay rate: the second stage is looked at, too.
    _known: dict[float, FitProblem | None] = field(default_factory=dict, init=False, repr=False)
    # By decay rate and effects: the most promising ones are tried before all others.
    trials: dict[tuple[float, frozenset[str]], "HalvingTrial | None"] = field(
        default_factory=dict, init=False, repr=False
    )

    @classmethod
    def of(cls, problem: Problem[Any], result: FitResult, *, bent: bool) -> "Damped | None":
        """Return the data of a fit far from them at decay rates; None of data without damped FRFs.

        What is ``bent`` is near the data, and no measure of how far the model is from them.
        """
        frfs = problem.damped_frfs()
        if frfs is None:
            return None
        return cls(frfs, frfs.problem.far_start(result) if bent else result)

    @property
    def problem(self) -> FitProblem:
        """The problem without decay."""
        return self.measured.problem

    @cached_property
    def computed(self) -> DampedFrfs | None:
        """The model's own FRFs for data, as noisy as what was measured."""
        bare = replace(self.problem, scatter=None)
        data, rng = bare.data, np.random.default_rng(0)
        parts = rng.standard_normal((2, *data.noise.shape))
        noise = np.where(data.mask, data.noise, 0.0) * (parts[0] + 1j * parts[1])
        return replace(bare, data=replace(data, H=bare.receptance(self.result) * (1 + noise))).damped_frfs()

    def for_look(self) -> FitProblem | None:
        """Return the problem for a look at single effects; None where there is none."""
        return self.at(STAGES[1].share)

    def at(self, share: float) -> FitProblem | None:
        """Return the problem at a decay rate; None where that errs by more than the model leaves.

        Lines may be too far apart for its resonances, or the band too short: the continuation of the model's
        own FRFs tells, beside its exact FRFs at the complex frequencies.
        """
        if share not in self._known:
            self._known[share] = self._at(share)
        return self._known[share]

    def _at(self, share: float) -> FitProblem | None:
        weak = self.measured.at(share)
        summed = self.computed.at(share) if weak and self.computed else None
        if weak is None or summed is None:
            return None
        # Lines at which damped FRFs of a model are compared with the sum over its lines
        problem, lines = self.problem, weak.lines_up_to(np.inf, 24)
        exact, mask = replace(weak, scatter=None).receptance(self.result, lines), weak.data.mask[lines]

        def level(H: Complexes) -> float:
            ratio = np.where(mask, log_ratio(exact, np.where(mask, H[lines], 1.0)), np.nan)
            return problem.level(ratio, lines)

        return weak if level(weak.data.H) > np.sqrt(2) * level(summed.data.H) else None


@dataclass(frozen=True, slots=True, eq=False)
class HalvingTrial:
    """Effects fitted to damped FRFs.

    Attributes
    ----------
    result : FitResult
    cost : float
        Negative log posterior [nats].
    """

    result: FitResult
    cost: float

    @property
    def candidate(self) -> Candidate:
        """The effects, and a start where they are."""
        effects = self.result.effects
        return effects, (Start(values_of(effects), self.result),)


def halved(
    damped: Damped, workers: Workers, blocks: Sequence[Candidate], singles: Sequence[Candidate]
) -> list[HalvingTrial]:
    """Return the best of candidates on weakly damped FRFs, of each sort the best first.

    Parameters
    ----------
    damped : Damped
        With all that may vary, and what the candidates stand beside; its effects are the first of each.
    workers : Workers
    blocks, singles : sequence of (tuple of Effect, tuple of Start)
        Springs of whole connections, and effects that were looked at before: these begin at the second
        stage. Pairs of the best blocks join them there.
    """
    n_base = len(damped.result.effects)
    sorts: dict[str, Sequence[Candidate]] = {"block": blocks}
    best: dict[str, list[HalvingTrial]] = {}
    for number, stage in enumerate(STAGES):
        damped_problem = damped.at(stage.share)
        if damped_problem is not None:
            best = _tried(damped, damped_problem, workers, stage, sorts)
            sorts = {sort: [t.candidate for t in trials] for sort, trials in best.items()}
        if number == 0:
            first = [t.candidate for t in best.get("block", ())][:N_PAIRED]
            pairs = [_together(a, b, n_base) for a, b in combinations(first, 2)]
            sorts = {**sorts, "single": singles, "pair": pairs}
    return [t for trials in best.values() for t in trials]


def _together(one: Candidate, two: Candidate, n_base: int) -> Candidate:
    """Return two blocks together, each found with the same base."""
    (a, (start, *_)), (b, (more, *_)) = one, two
    return (*a, *b[n_base:]), (Start((*start.values, *more.values[n_base:]), start.near),)


def _tried(
    damped: Damped,
    problem: FitProblem,
    workers: Workers,
    stage: HalvingStage,
    sorts: Mapping[str, Sequence[Candidate]],
) -> dict[str, list[HalvingTrial]]:
    """Return the candidates of each sort that go on, the best first."""
    keys = {sort: [(stage.share, key_of(c[0])) for c in candidates] for sort, candidates in sorts.items()}
    every = {key: c for sort in sorts for key, c in zip(keys[sort], sorts[sort], strict=True)}
    new = [key for key in every if key not in damped.trials]
    fitted = workers.map(_fitted, (problem, stage), [every[key] for key in new])
    damped.trials.update(zip(new, fitted, strict=True))
    out = {sort: [t for key in keys[sort] if (t := damped.trials[key])] for sort in sorts}
    for sort, there in out.items():
        there.sort(key=lambda t: t.cost)
        near, twins = (
            sum(t.cost < there[0].cost + behind for t in there) for behind in (BEHIND_NATS, TWIN_NATS)
        )
        twins = min(twins, ceil(TWINS_KEPT * len(there)))
        del there[max(stage.least, twins, min(near, ceil(stage.kept * len(there)))) :]
        out[sort] = list({key_of(t.result.effects): t for t in reversed(there)}.values())[::-1]
    return out


def _fitted(shared: tuple[FitProblem, HalvingStage], candidate: Candidate) -> HalvingTrial | None:
    """Return a fit; None where there is no structure: more mass taken away than there is."""
    (problem, stage), (effects, starts) = shared, candidate
    try:
        function, x = min((_begun(problem, stage, effects, start) for start in starts), key=_misfit)
        solution = function.minimise(x, np.inf, stage.n_steps, counted_as=FULL_LINES, tolerance=ROUGH_NATS)
    except np.linalg.LinAlgError:
        return None
    return HalvingTrial(function.result(solution), solution.cost)


def _begun(
    problem: FitProblem, stage: HalvingStage, effects: tuple[Effect, ...], start: Start
) -> tuple[FrfFunction, Floats]:
    """Return the residuals of effects on the lines of a stage, and where they begin."""
    problem = with_forces(problem, effects, start.values)
    function = problem.function(effects, start.values, problem.lines_up_to(np.inf, stage.n_lines))
    return function, function.moved_to(start.near)


def _misfit(begun: tuple[FrfFunction, Floats]) -> float:
    """Return the mean square of the residuals at a start."""
    function, x = begun
    return float(function.misfit(x).mean())
