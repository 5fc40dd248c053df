"""Effects in series with members that give way: their matrices do not just add."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from fem.effects.giving_way import GivesWay
from fem.model import Contribution, Effect, Model, ParameterRef
from fem.reduction.reduced_model import ReducedModel
from fem.reduction.terms import ReducedTerm


def with_series(model: Model, candidates: Sequence[Effect], tried: Sequence[Effect] = ()) -> Model:
    """Return a model with those of some candidates that are in series with what gives way in members.

    The model itself where nothing gives way, or no candidate alters an element that does.

    Parameters
    ----------
    model : Model
    candidates : sequence of Effect
    tried : sequence of Effect
        Effects that are not added, but may give way.
    """
    soft = [e for e in (*model.effects, *candidates, *tried) if e.gives_way]
    added = [c for c in candidates if any(_alters(c, e, model) for e in soft)]
    added += [e for e in candidates if e not in added and any(_alters(t, e, model) for t in tried)]
    return model.with_effect(*added) if added else model


def terms_in_series(
    reduced: ReducedModel,
    effects: Sequence[Effect],
    candidates: Sequence[Effect],
    values: Mapping[ParameterRef, float],
) -> tuple[ReducedTerm, ...] | None:
    """Return what one effect, at several values, adds to a reduced model where it is in series with others.

    With its element the model's and the candidates' flexibilities change, and that of the effect depends on
    all that alters the element. None where it is in series with nothing: it then adds the same to any state.

    Parameters
    ----------
    reduced : ReducedModel
    effects : sequence of Effect
        Copies with other values.
    candidates : sequence of Effect
        Of the state to which one of them is added.
    values : mapping of (effect, parameter) to float
        Of that state; others are nominal.
    """
    effect = effects[0]
    model = with_series(reduced.model, candidates, (effect,))
    # of what gives way, each is in series with those before it
    others = [e for e in model.effects if not (isinstance(effect, GivesWay) and isinstance(e, GivesWay))]
    soft = [e for e in others if _alters(effect, e, model)]
    if not soft and not any(_alters(e, effect, model) for e in model.effects):
        return None
    model = reduced.with_values(model, values)
    out = []
    for each in effects:
        parts, wider = list(model.parts_of(each)), _with(each, model)
        for now in (model.effect(e.name) for e in soft):
            parts += [*wider.parts_of(now), *(negative(c) for c in model.parts_of(now))]
        out.append(replace(reduced.project(parts), connection=effect.connection))
    return tuple(out)


def _alters(effect: Effect, soft: Effect, model: Model) -> bool:
    """Whether an effect changes what another one does."""
    if not soft.gives_way or effect.name == soft.name or (soft.is_form and not effect.is_form):
        return False  # stretches inside of connections follow the form of sections alone
    return any(name == effect.name for name, _ in soft.refers_to(_with(effect, model)))


def _with(effect: Effect, model: Model) -> Model:
    """Return a model that has an effect, at its own value if it has it already."""
    return model if any(e.name == effect.name for e in model.effects) else model.with_effect(effect)


def negative(c: Contribution) -> Contribution:
    """Return a contribution that takes another one away."""
    parts = {key: None if (X := getattr(c, key)) is None else -X for key in "KMCD"}
    return replace(c, **parts)
