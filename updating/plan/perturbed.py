"""Second tests that tell twins apart: the same one with a known mass at a place of the structure."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.effects.added_mass import AddedMass
from fem.model import Effect, Model
from updating.diagnosis.evidence.screening import Grid
from updating.diagnosis.separation import places_along
from updating.inference.formed import formed_problem
from updating.inference.heartbeat import Progress, beat
from updating.inference.parameters import Nuisance
from updating.plan.plan import Outlook, Plan
from updating.plan.planned import as_planned, planned_like
from updating.plan.visibility import Sight, needed

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Separation:
    """What a known mass does to a pair of effects that a test does not tell apart.

    Attributes
    ----------
    effect, rival : Effect
        The first of a relevant size.
    place : str
        Where the mass would be.
    mass : float
        [kg].
    alike : (float, float)
        Cosine of the angle between what both do, in the test alone and in both together [-].
    ratio : float
        Gain in log likelihood of the effect over its rival in both tests, over what is needed [-].
    """

    effect: Effect
    rival: Effect
    place: str
    mass: float
    alike: tuple[float, float]
    ratio: float


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    """What one test says: slopes by uncertain parameters and by what is uncertain in this test alone.

    Attributes
    ----------
    shared, own : ndarray (n_shared, r), (n_own, r)
    known : ndarray (n_own,)
        Precision of the latter beforehand.
    changes : ndarray (n_effects, r)
        What effects do.
    """

    shared: Floats
    own: Floats
    known: Floats
    changes: Floats

    @classmethod
    def of(cls, sight: Sight, effects: Sequence[Effect], factors: Sequence[float]) -> "_State":
        """Look at some effects, each at the position that it has, so many times a little of it."""
        look = sight.look
        m, n = len(look.share), len(look.prior_of)
        root = np.sqrt(np.tile(look.weights[:m], 2))
        changes = []
        for effect, factor in zip(effects, factors, strict=True):
            beat()
            there = {p.name: float(p.value) for p in effect.parameters()}
            change = look.changes(Grid(effect, (there,)))[0] * factor
            changes.append(np.concatenate([change.real, change.imag]) * root)
        slopes = look.slopes[:, : 2 * m] * root
        known = (look.slopes[n:, 2 * m :] ** 2).sum(axis=1)
        return cls(slopes[:n], slopes[n:], known, np.array(changes))

    def reduced(self) -> Floats:
        """Return the information of shared parameters and effects, without what is uncertain in this test."""
        rows = np.vstack([self.shared, self.changes])
        cross = rows @ self.own.T
        A = self.own @ self.own.T + np.diag(np.maximum(self.known, 1e-12))
        out: Floats = rows @ rows.T - cross @ np.linalg.solve(A, cross.T)
        return out


def perturbed(
    plan: Plan,
    study_model: Model,
    nuisances: Sequence[Nuisance],
    mass: float,
    pairs: Sequence[tuple[Outlook, Effect]],
    *,
    progress: Progress | None = None,
    **settings: Any,
) -> list[Separation]:
    """Return for each pair of twins the place where a known mass separates it best, in a second test.

    Sensors, forces and noise are those of the plan. Uncertain parameters and the form are the same in both
    tests, damping, deviations of modes and errors of channels are not.

    Parameters
    ----------
    plan : Plan
        Of a planned test.
    study_model : Model
    nuisances : sequence of Nuisance
    mass : float
        [kg].
    pairs : sequence of (Outlook, Effect)
        As of :attr:`updating.plan.plan.Plan.twins`.
    progress : callable, optional
        Called with a text and the fraction done.
    **settings
        As of :func:`updating.plan.plan.plan_test`.
    """
    say = progress or (lambda text, done: None)
    left = plan.visibility.left
    slight = [
        (o.visible.slight, next(v.slight for v in plan.visibility.effects if _is_at(v.effect, rival)))
        for o, rival in pairs
    ]
    effects = [e for pair in slight for e in pair]
    factors = [f for o, _ in pairs for f in (o.visible.amplitude(o.relevant), 1.0)]
    first = Sight(plan.visibility.problem, plan.visibility.problem.nominal(), left)
    here = _State.of(first, effects, factors)
    shared = (first.look.slopes[: len(first.look.prior_of), 2 * len(first.look.share) :] ** 2).sum(axis=1)
    alone = here.reduced()
    before = [_told(alone, shared, k) for k in range(len(pairs))]
    best: list[Separation | None] = [None] * len(pairs)
    places = places_along(study_model)
    for number, (point, place) in enumerate(places):
        say(f"a mass at {place}", number / len(places))
        known = AddedMass(name="known mass", point=point, mass=mass)
        model = study_model.with_effect(known)
        test = planned_like(plan.measurement, model)
        whole, _ = formed_problem(model, test, nuisances, **settings)
        base = whole.nominal()
        there = _State.of(Sight(as_planned(whole, base), base, left), effects, factors)
        both = alone + there.reduced()
        for k, (o, rival) in enumerate(pairs):
            gain, alike = _told(both, shared, k)
            ratio = gain / float(needed(np.zeros(1))[0])
            last = best[k]
            if last is None or ratio > last.ratio:
                best[k] = Separation(o.relevant, rival, place, mass, (before[k][1], alike), ratio)
    return [each for each in best if each is not None]


def _is_at(effect: Effect, other: Effect) -> bool:
    """Whether two are one effect at one position, of whatever size."""
    one, two = ([float(p.value) for p in e.parameters()[1:]] for e in (effect, other))
    return effect.name == other.name and np.allclose(one, two)


def _told(information: Floats, known: Floats, pair: int) -> tuple[float, float]:
    """Return the gain of the first effect of a pair over the second, and the cosine between both."""
    u = len(known)
    A = information[:u, :u] + np.diag(np.maximum(known, 1e-12))
    k = [u + 2 * pair, u + 2 * pair + 1]
    F = information[np.ix_(k, k)] - information[k, :u] @ np.linalg.solve(A, information[:u, k])
    square = F[0, 1] ** 2 / max(F[0, 0] * F[1, 1], 1e-300)
    return 0.5 * float(F[0, 0]) * max(1 - square, 0.0), float(np.sqrt(min(square, 1.0)))
