"""The form of frames: what centre lines and nominal sections leave out of any real structure.

Members are a little heavier, and bend and twist a little otherwise, than their sections say. What lies inside
of a connection of finite size is stiffer and lighter or heavier than members that end in a point, and what
holds a clamped end gives way. All are uncertain parameters of every hypothesis: an effect is believed only
for what they cannot do within their tolerance.
"""

from fem.effects.clamp_form import ClampForm
from fem.effects.section_form import SectionForm
from fem.effects.zone_form import ZoneForm
from fem.model import Effect, Model
from updating.inference.belief import FORM_SECTION, FORM_ZONE
from updating.inference.parameters import Nuisance

FORMS = SectionForm, ZoneForm, ClampForm


def form_of(model: Model) -> tuple[tuple[Effect, ...], tuple[Nuisance, ...]]:
    """Return effects of no size that let a frame's form vary, and how far the form may vary.

    A model that has some of them already, as one that an earlier diagnosis found, keeps its own.
    """
    known = {_place(e): e for kind in FORMS for e in model.of_kind(kind)}
    every = [known.get(_place(e), e) for kind in FORMS for e in kind.propose(model)]
    std = FORM_SECTION | FORM_ZONE
    own = [Nuisance(e.name, p.name, std[p.name], 0.0) for e in every for p in e.parameters()]
    return tuple(e for e in every if e not in known.values()), tuple(own)


def with_form(model: Model, model_error: float) -> Model:
    """Return a model with the effects that let its form vary, if beams may err."""
    return model.with_effect(*form_of(model)[0]) if model_error > 0 else model


def _place(effect: Effect) -> tuple[str, str]:
    return effect.kind, effect.where
