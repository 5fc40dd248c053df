"""Second tests that tell twins apart: the same one with a known mass, or without one of the supports."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fem.array_types import Complexes, Floats
from fem.effects.added_mass import AddedMass
from fem.effects.support import Support
from fem.model import Effect, Model, ModelError, ParameterRef
from updating.diagnosis.separation import places_along
from updating.forecast.forecast import MOST_COMPARED
from updating.forecast.grid import Grid
from updating.forecast.information import Information, without
from updating.forecast.look import Look
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.formed import formed_problem
from updating.inference.heartbeat import Progress, beat
from updating.inference.parameters import Nuisance
from updating.plan.plan import Outlook, Plan
from updating.plan.planned import as_planned, planned_like
from updating.plan.visibility import needed


@dataclass(frozen=True, slots=True, eq=False)
class Change:
    """A known change of the structure for a second test.

    Attributes
    ----------
    text : str
        In words: ``"a mass of 0.2 kg on member beam at 0.5 m"``.
    model : Model
        The changed structure.
    """

    text: str
    model: Model


@dataclass(frozen=True, slots=True, eq=False)
class Separation:
    """What a known change does to a pair of effects that a test does not tell apart.

    Attributes
    ----------
    effect, rival : Effect
        The first of a relevant size.
    change : str
        What is changed.
    alike : (float, float)
        Cosine of the angle between what both do, in the test alone and in both together [-].
    ratio : float
        Gain in log likelihood of the effect over its rival in both tests, over what is needed [-].
    """

    effect: Effect
    rival: Effect
    change: str
    alike: tuple[float, float]
    ratio: float


def with_masses(model: Model, mass: float) -> list[Change]:
    """Return changes by a known mass, at places along all members."""
    return [
        Change(
            f"a mass of {mass:.3g} kg on {place}",
            model.with_effect(AddedMass(name="known mass", point=point, mass=mass)),
        )
        for point, place in places_along(model)
    ]


def without_supports(model: Model) -> list[Change]:
    """Return changes by the release of one support each."""
    return [
        Change(
            f"support {e.name} released",
            replace(model, effects=tuple(o for o in model.effects if o is not e)),
        )
        for e in model.of_kind(Support)
    ]


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    """What one test says: slopes by uncertain parameters and by what is uncertain in this test alone.

    Attributes
    ----------
    shared, errors : ndarray (n_shared, r), (n_errors, r)
    known : ndarray (n_errors,)
        Precision of the latter beforehand.
    changes : ndarray (n_effects, r)
        What effects do; NaN of those that the structure cannot have.
    """

    shared: Floats
    errors: Floats
    known: Floats
    changes: Floats

    @classmethod
    def of(
        cls,
        look: Look,
        effects: Sequence[Effect],
        factors: Sequence[float],
        refs: Sequence[ParameterRef],
    ) -> "_State":
        """Look at some effects, each at the position that it has, so many times a little of it.

        ``refs`` are the uncertain parameters that tests share. One that a structure does not have changes
        nothing there.
        """
        m, n = len(look.share), len(look.prior_of)
        root = np.sqrt(np.tile(look.weights[:m], 2))
        changes = []
        for effect, factor in zip(effects, factors, strict=True):
            beat()
            there = {p.name: float(p.value) for p in effect.parameters()}
            try:
                change: Complexes = look.changes(Grid(effect, (there,)))[0] * factor
            except ModelError:  # of a support that was released
                change = np.full(m, np.nan, dtype=complex)
            changes.append(np.concatenate([change.real, change.imag]) * root)
        slopes = look.slopes[:, : 2 * m] * root
        shared = np.zeros((len(refs), 2 * m))
        for row, ref in zip(slopes[:n], look.prior_of, strict=True):
            shared[refs.index(ref)] = row
        known = (look.slopes[n:, 2 * m :] ** 2).sum(axis=1)
        return cls(shared, slopes[n:], known, np.array(changes))

    def reduced(self) -> Floats:
        """Return the information of shared parameters and effects, without what is uncertain in this test."""
        rows = np.vstack([self.errors, self.shared, self.changes])
        return without(rows @ rows.T, np.diag(np.maximum(self.known, 1e-12)))


def perturbed(
    plan: Plan,
    changes: Sequence[Change],
    nuisances: Sequence[Nuisance],
    pairs: Sequence[tuple[Outlook, Effect]],
    *,
    progress: Progress | None = None,
    **settings: Any,
) -> list[Separation]:
    """Return for each pair of twins the known change that separates it best, in a second test.

    Sensors, forces and noise are those of the plan. Uncertain parameters and the form are the same in both
    tests, damping, deviations of modes and errors of channels are not. Pairs that no change leaves possible
    are left out.

    Parameters
    ----------
    plan : Plan
        Of a planned test.
    changes : sequence of Change
        Of the study's model.
    nuisances : sequence of Nuisance
    pairs : sequence of (Outlook, Effect)
        As of :attr:`updating.plan.plan.Plan.twins`.
    progress : callable, optional
        Called with a text and the fraction done.
    **settings
        As of :func:`updating.plan.plan.plan_test`.
    """
    say = progress or (lambda text, done: None)
    discrepancy = plan.visibility.discrepancy
    effects = [e for o, rival in pairs for e in (o.visible.slight, plan.visibility.slight(rival))]
    factors = [f for o, _ in pairs for f in (o.visible.amplitude(o.relevant), 1.0)]

    def look_at(problem: FitProblem, base: FitResult) -> Look:
        return Look.of(problem, base, None, 0, MOST_COMPARED, discrepancy, bounded=False)

    assert plan.measurement is not None
    first = look_at(plan.visibility.problem, plan.visibility.base)
    refs = first.prior_of
    alone = _State.of(first, effects, factors, refs).reduced()
    known = (first.slopes[: len(refs), 2 * len(first.share) :] ** 2).sum(axis=1)
    before = [_separation(alone, known, k) for k in range(len(pairs))]
    enough = float(needed(np.zeros(1))[0])
    best: list[Separation | None] = [None] * len(pairs)
    for number, change in enumerate(changes):
        say(change.text, number / len(changes))
        test = planned_like(plan.measurement, change.model)
        fit_problem, _ = formed_problem(change.model, test, nuisances, **settings)
        base = fit_problem.nominal()
        there = _State.of(look_at(as_planned(fit_problem, base), base), effects, factors, refs)
        both = alone + there.reduced()
        for k, (o, rival) in enumerate(pairs):
            gain, alike = _separation(both, known, k)
            last = best[k]
            if np.isfinite(gain) and (last is None or gain / enough > last.ratio):
                best[k] = Separation(o.relevant, rival, change.text, (before[k][1], alike), gain / enough)
    return [each for each in best if each is not None]


def _separation(information: Floats, known: Floats, pair: int) -> tuple[float, float]:
    """Return the gain of the first effect of a pair over the second, and the cosine between both."""
    u = len(known)
    some = [*range(u), u + 2 * pair, u + 2 * pair + 1]
    precision = np.diag(np.maximum(known, 1e-12))
    found = Information.of_matrix(information[np.ix_(some, some)], u, 2).beyond(precision)
    square = float(found.cosines_squared[0, 1])
    return 0.5 * float(found.lengths[0]) * (1 - square), float(np.sqrt(square))
