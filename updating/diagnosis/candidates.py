"""Candidates: what may be missing from a model, and which of it the situation of the structure admits."""

from collections.abc import Sequence

from fem.declarations import Environment
from fem.effects import candidate_kinds, effect_classes
from fem.effects.plane import in_plane
from fem.model import Effect, Model, applicable
from updating.inference.belief import UNSTATED
from updating.measurement.measurement import Measurement, instruments_on


def propose(
    model: Model,
    kinds: Sequence[str] | None = None,
    exclude: Sequence[str] = (),
    test: Measurement | None = None,
    *,
    levels: bool = False,
) -> tuple[Effect, ...]:
    """Return all candidates of some kinds (default: all that a model's situation admits) for a model.

    With a measurement there are also those of its instruments: masses of sensors, stingers. Those that
    depend on amplitude come where there are several ``levels`` of force.

    Raises
    ------
    ValueError
        For a kind that does not exist.
    """
    known = candidate_kinds()
    for kind in (*(kinds or ()), *exclude):
        if kind not in known:
            msg = f"there is no candidate kind '{kind}'; allowed are {', '.join(known)}"
            raise ValueError(msg)
    model = situated(model, kinds)
    classes = [effect_classes()[kind] for kind in (kinds or known) if kind not in exclude]
    classes = [cls for cls in classes if (levels or not cls.amplitude_dependent) and admitted(cls, model) > 0]
    if test is not None:
        model = model.with_instruments(instruments_on(model.mesh, test))
    return in_plane(model, applicable((e for cls in classes for e in cls.propose(model)), model))


def released_together(candidates: Sequence[Effect]) -> tuple[Effect, ...]:
    """Return candidates such that those that release the same constraints follow one another.

    Looks solve the model without these constraints once for all of them.
    """
    order = {key: n for n, key in enumerate(dict.fromkeys(e.released() for e in candidates))}
    return tuple(sorted(candidates, key=lambda e: order[e.released()]))


def admitted(effect: Effect | type[Effect], model: Model) -> float:
    """Return the probability before any data that a model's situation admits an effect [-].

    1 where the effect may be anywhere, and where its environment is stated or an effect of the model needs
    it, too; `updating.inference.belief.UNSTATED` has the others.
    """
    needed = effect.environment
    stated = model.environment | {e.environment for e in model.effects}
    return 1.0 if needed is None or needed in stated else UNSTATED[needed]


def unstated(model: Model) -> dict[Environment, list[str]]:
    """Return the environments that a model does not state, each with the kinds of candidates that need it."""
    out: dict[Environment, list[str]] = {}
    for kind in candidate_kinds():
        cls = effect_classes()[kind]
        if cls.environment is not None and admitted(cls, model) < 1:
            out.setdefault(cls.environment, []).append(kind)
    return out


def situated(model: Model, kinds: Sequence[str] | None) -> Model:
    """Return a model that states the environments of kinds which are asked for by name."""
    needed = (effect_classes()[kind].environment for kind in kinds or ())
    return model.in_environment(*(e for e in needed if e is not None))
