"""What a test could see and name of the effects that matter to its user."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fem.declarations import Relevant
from fem.effects.places import members_mass
from fem.linalg.solvers import one_thread
from fem.model import Effect, Model, ParameterRef
from updating.diagnosis.evidence.diagnosis import Searched, prepare_search
from updating.diagnosis.evidence.hypothesis import Odds, near_to
from updating.forecast.grid import distance
from updating.inference.defaults import EXPLAINED_LEVEL
from updating.inference.heartbeat import Progress
from updating.inference.parameters import Nuisance
from updating.measurement.measurement import Measurement
from updating.plan.planned import as_planned, usual_discrepancy, with_likely_shifts
from updating.plan.visibility import Visibility, Visible, size_of, sized, visibility

SHOWN = ("named", "located", "seen", "not seen")
"""What a test says of an effect, the most first."""
USUAL = Relevant()
"""Sizes that are relevant unless it is said otherwise."""


@dataclass(frozen=True, slots=True, eq=False)
class Outlook:
    """An effect at a position, and whether the test sees and names a relevant size of it.

    Attributes
    ----------
    visible : Visible
    relevant : Effect
        Of the size that its user calls relevant.
    seen, located, named : bool
    """

    visible: Visible
    relevant: Effect
    seen: bool
    located: bool
    named: bool

    @property
    def shown(self) -> str:
        """The most that the test says of the relevant size: a word of ``SHOWN``."""
        return next((what for what in SHOWN[:-1] if getattr(self, what)), SHOWN[-1])

    def least(self, what: str = "named") -> Effect | None:
        """Return the effect at its least size that is ``seen``, ``located`` or ``named``.

        On the side of none on which the relevant size is; None if no plausible size is.
        """
        effect = getattr(self.visible, what)
        return None if effect is None else _towards(effect, self.relevant)


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """What a test could see and name.

    Attributes
    ----------
    visibility : Visibility
    model : Model
    measurement : Measurement or None
        The test: measured, or as its model would give it; None of measured modes.
    sizes : Relevant
    relevant : tuple of Outlook
        Effects at one place, of kinds for which a relevant size is stated.
    is_explained : bool
        Whether the model explains measured data. Where it does not, what it leaves of them hides effects.
    """

    visibility: Visibility
    model: Model
    measurement: Measurement | None
    sizes: Relevant
    relevant: tuple[Outlook, ...]
    is_explained: bool = True

    @property
    def is_measured(self) -> bool:
        """Whether the data are measured ones."""
        return self.visibility.discrepancy is None

    def coverage(self, what: str = "named") -> float:
        """Return the share of relevant effects that are ``seen``, ``located`` or ``named``."""
        return share(self.relevant, what)

    @property
    def kinds(self) -> dict[str, list[Outlook]]:
        """Relevant effects by the name of their kind, in the order of the candidates.

        Stiffnesses of translation and of rotation are two kinds.
        """
        out: dict[str, list[Outlook]] = {}
        for o in self.relevant:
            kind = o.relevant.kind
            rotates = kind.endswith(("stiffness", "flexibility")) and "rad" in o.relevant.parameters()[0].unit
            out.setdefault(kind.replace("_", " ") + ", rotation" * rotates, []).append(o)
        return out

    def sizes_of(self, what: str = "named") -> list[dict[str, Any]]:
        """Return for each kind and unit the least and largest sizes ``seen``, ``located`` or ``named``.

        Sizes are effects, None where no plausible one is; the largest is None if that is so at ``blind`` of
        the ``n`` places.
        """
        out = []
        for some in self.kinds.values():
            kind, unit = some[0].relevant.kind, some[0].relevant.parameters()[0].unit
            shown = [e for o in some if (e := o.least(what)) is not None]
            shown.sort(key=size_of)
            blind = len(some) - len(shown)
            ends = {"least": shown[0] if shown else None, "most": shown[-1] if shown and not blind else None}
            out.append({"kind": kind, "unit": unit, "n": len(some), "blind": blind, **ends})
        return out

    def hidden(self, some: Sequence[Outlook]) -> list[tuple[ParameterRef, Effect | None]]:
        """Return the uncertain parameters that hide most of effects of one kind.

        With each comes the least size that would be seen if it and those before it were known exactly: at the
        place that is then the best one.
        """
        outlooks, out = {id(o.visible): o for o in some}, list[tuple[ParameterRef, Effect | None]]()
        for ref, x, amplitude in self.visibility.hidden_by([o.visible for o in some]):
            effect = x.at(amplitude)
            out.append((ref, None if effect is None else _towards(effect, outlooks[id(x)].relevant)))
        return out

    @property
    def twins(self) -> tuple[tuple[Outlook, Effect], ...]:
        """Relevant effects that are seen but not named, with their rivals; pairs once, the closest first.

        Of equally close positions of a pair that which is seen best.
        """
        found: dict[frozenset[str], tuple[Outlook, Effect]] = {}
        some = [o for o in self.relevant if o.seen and not o.named]
        for o in sorted(some, key=lambda o: (-round(o.visible.alike, 9), o.visible.least)):
            rival = o.visible.rival
            found.setdefault(frozenset((o.relevant.name, rival.name)), (o, rival))
        return tuple(found.values())


def _towards(effect: Effect, other: Effect) -> Effect:
    """Return an effect of the same size on the side of none on which another one is."""
    p, value = effect.parameters()[0], float(effect.parameters()[0].value)
    if distance(p, value) * distance(p, float(other.parameters()[0].value)) >= 0:
        return effect
    mirrored = p.absent**2 / value if p.log else 2 * p.absent - value
    return sized(effect, mirrored)


def share(some: Sequence[Outlook], what: str) -> float:
    """Return the share of effects that are ``seen``, ``located`` or ``named``; NaN without any."""
    return float(np.mean([getattr(o, what) for o in some])) if some else np.nan


@one_thread()
def plan_test(
    model: Model,
    measurement: Measurement,
    nuisances: Sequence[Nuisance] = (),
    *,
    kinds: Sequence[str] | None = None,
    exclude: Sequence[str] = (),
    sizes: Relevant = USUAL,
    model_error: float = EXPLAINED_LEVEL,
    discrepancy: float | None = None,
    progress: Progress | None = None,
    **settings: Any,
) -> Plan:
    """Return what a test that is planned could see and name.

    Parameters
    ----------
    model : Model
    measurement : Measurement
        The test as its model would give it (:func:`updating.plan.planned.planned_measurement`).
    nuisances, kinds, exclude, model_error
        As of :func:`updating.diagnosis.diagnose.diagnose`.
    sizes : Relevant
    discrepancy : float, optional
        Level that a right model leaves besides noise; what beams usually leave unless given [nepers].
    progress : callable, optional
        Called with a text and the fraction done.
    **settings
        Damping, band and lines, as of :func:`updating.diagnosis.diagnose.diagnose`.
    """
    say = progress or (lambda text, done: None)
    say("reducing the model", 0.0)
    settings |= {"kinds": kinds, "exclude": exclude, "model_error": model_error}
    fit_problem, formed, candidates = prepare_search(model, measurement, nuisances, **settings)
    base = fit_problem.nominal()
    problem = as_planned(fit_problem, base)
    odds = Odds.of(candidates, problem.reduced.model)
    discrepancy = usual_discrepancy(model_error) if discrepancy is None else discrepancy
    seen = visibility(
        problem, base, candidates, odds, discrepancy, lambda text, done: say(text, 0.1 + 0.9 * done)
    )
    return _plan(seen, formed.model, measurement, sizes)


@one_thread()
def plan_from_search(
    searched: Searched[Any],
    sizes: Relevant = USUAL,
    progress: Progress | None = None,
    measurement: Measurement | None = None,
) -> Plan:
    """Return what measured data could still have shown besides what a diagnosis has found.

    Parameters
    ----------
    searched : Searched
    sizes : Relevant
    progress : callable, optional
        Called with a text and the fraction done.
    measurement : Measurement, optional
        The data, where they are FRFs.
    """
    search, best = searched.search, searched.best
    measured = search.fits.problem
    scatter = with_likely_shifts(search.fits.ranking.scatter(measured, best.fitted))
    problem = replace(measured, scatter=scatter)
    candidates = [c for c in search.compatible_with(best.effects) if not c.amplitude_dependent]
    say = progress or (lambda text, done: None)
    seen = visibility(problem, best.fitted, candidates, search.fits.odds, None, say)
    return replace(
        _plan(seen, problem.reduced.model, measurement, sizes), is_explained=search.fits.is_near(best)
    )


@one_thread()
def with_averages(plan: Plan, now: int, more: int, progress: Progress | None = None) -> Plan:
    """Return what a test could see and name after more averages: with less noise, and the same error.

    Parameters
    ----------
    plan : Plan
    now, more : int
        Averages whose noise the plan has, and further ones.
    progress : callable, optional
        Called with a text and the fraction done.
    """
    seen = plan.visibility
    say = progress or (lambda text, done: None)
    again = visibility(
        seen.problem,
        seen.base,
        seen.forecast.candidates,
        seen.odds,
        seen.discrepancy,
        say,
        averaged=now / (now + more),
    )
    found = _plan(again, plan.model, plan.measurement, plan.sizes)
    return replace(found, is_explained=plan.is_explained)


def _plan(seen: Visibility, model: Model, measurement: Measurement | None, sizes: Relevant) -> Plan:
    mass, scale, forecast = members_mass(model), seen.problem.surroundings, seen.forecast
    stated = {}
    for i in range(len(forecast.owner)):
        effect = forecast.effect_at(i, 0.0)
        value = None if len(near_to(effect)) > 1 else effect.relevant(sizes, mass, scale)
        if value is not None:
            stated[i] = value
    # Sizes of the others, which are rivals of these, are solved for where they are asked for.
    some = seen.at(np.array(list(stated), dtype=np.int64))
    found = tuple(_outlook(x, value) for x, value in zip(some, stated.values(), strict=True))
    return Plan(seen, model, measurement, sizes, found)


def _outlook(x: Visible, value: float) -> Outlook:
    relevant = sized(x.effect, value)
    amplitude = x.amplitude(relevant)
    seen, located, named = (amplitude >= each for each in x.enough)
    return Outlook(x, relevant, seen, located, named)
