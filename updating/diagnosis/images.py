"""Mirror images: explanations of measured modes that no natural frequency tells apart."""

from collections.abc import Mapping, Sequence

import numpy as np

from fem.analysis.modes import first_modes
from fem.array_types import Floats
from fem.model import Effect, Model
from fem.system import assemble
from updating.diagnosis.evidence.diagnosis import Searched
from updating.diagnosis.evidence.hypothesis import ScoredFit
from updating.diagnosis.mode_separation import FURTHER
from updating.inference.belief import TWIN_NATS
from updating.inference.mode_fit import ModeProblem

ROUNDING = 1e-3
"""Share of the changes of frequencies by which those of mirror images differ, for rounding and meshes [-]."""


def images_of(done: Searched[ModeProblem], best: ScoredFit) -> tuple[ScoredFit, ...]:
    """Return the hypotheses that a symmetry of the model makes of another one, the most probable first.

    An image has effects of the same kinds and is nearly as probable. With the values of ``best`` it changes
    all natural frequencies of the model before the fit by as much: fits differ, as each ends a little
    elsewhere. Positions along members are those of the image itself, and may err by their deviation.
    """
    kinds = sorted(e.kind for e in best.effects)
    near = [
        h
        for h in sorted(done.weighed, key=lambda h: -h.score)
        if h is not best and h.score > best.score - TWIN_NATS and sorted(e.kind for e in h.effects) == kinds
    ]
    if not kinds or not near:
        return ()
    n = done.search.fits.problem.targets.n + FURTHER
    try:
        before = _frequencies(done.model, (), n)
        change = np.log(_frequencies(done.model, best.effects, n) / before)
    except (np.linalg.LinAlgError, ValueError):
        return ()
    return tuple(h for h in near if _is_image(done.model, best, h, change, before))


def _is_image(model: Model, best: ScoredFit, other: ScoredFit, change: Floats, before: Floats) -> bool:
    """Whether another hypothesis changes the natural frequencies by as much, (n,) [-]."""
    effects, unpaired = list[Effect](), list(best.effects)
    for e in other.effects:
        # an effect on the plane of symmetry is its own image; of several of a kind the most alike is paired
        of_kind = [x for x in unpaired if x.kind == e.kind]
        one = min(of_kind, key=lambda x: (x.name != e.name, _distance(_values(x), _values(e))))
        unpaired.remove(one)
        effects.append(e.with_values(**_values(one)))
    try:
        there = np.log(_frequencies(model, effects, len(before)) / before)
        allowed = ROUNDING * np.linalg.norm(change)
        for k, e in enumerate(effects):
            for p in e.parameters():
                if p.position:
                    end = p.value + other.fitted.std[e.name, p.name]
                    moved = [*effects[:k], e.with_values(**{p.name: min(end, p.upper)}), *effects[k + 1 :]]
                    shifted = np.log(_frequencies(model, moved, len(before)) / before)
                    allowed += np.linalg.norm(shifted - there)
    except (np.linalg.LinAlgError, ValueError):
        return False
    return bool(np.linalg.norm(there - change) <= allowed)


def _values(effect: Effect) -> dict[str, float]:
    """Return the values of an effect but for its position."""
    return {p.name: p.value for p in effect.parameters() if not p.position}


def _distance(one: Mapping[str, float], two: Mapping[str, float]) -> float:
    """Return the sum of the relative differences of values [-]."""
    return sum(abs(one[k] - two[k]) / max(abs(one[k]), abs(two[k])) for k in one if one[k] != two[k])


def _frequencies(model: Model, effects: Sequence[Effect], n: int) -> Floats:
    """Return the first ``n`` natural frequencies above 0 of a model with effects, (n,) [Hz]."""
    for effect in effects:
        model = effect.added_to(model)
    found = first_modes(assemble(model, reciprocal=False), n)
    return found.frequency[found.n_rigid :]
