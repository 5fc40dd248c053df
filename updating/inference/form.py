"""The form of frames and tests: what centre lines, nominal sections and a test's description leave out.

Members are a little heavier, and bend and twist a little otherwise, than their sections say. What lies inside
of a connection of finite size is stiffer and lighter or heavier than members that end in a point, and what
holds a clamped end gives way. Sensors and exciters add mass, stingers stiffness. All are uncertain parameters
of every hypothesis: an effect is believed only for what they cannot do within their tolerance.
"""

from fem.effects.clamp_form import ClampForm
from fem.effects.instrument_form import DriverForm, SensorForm
from fem.effects.section_form import SectionForm
from fem.effects.zone_form import ZoneForm
from fem.model import Effect, Model
from fem.sections.tolerance import constants_std
from updating.inference.belief import FORM_CLAMP, FORM_CORNER, FORM_JOINT, FORM_SECTION, LIGHT, STATED_MASS
from updating.inference.parameters import Nuisance
from updating.measurement.measurement import Measurement, instruments_on

FORMS = SectionForm, ZoneForm, ClampForm
TEST_FORMS = SensorForm, DriverForm
Usual = dict[str, tuple[float, float]]
"""Mean and standard deviation of parameters by name [unit of the parameter]."""
USUAL_FORM: dict[str, Usual] = {
    "section": {key: (0.0, std) for key, std in FORM_SECTION.items()},
    "corner": FORM_CORNER,
    "joint": FORM_JOINT,
    "clamp": FORM_CLAMP,
}
"""What is believed of parts of the form by their place, unless a study says otherwise."""


def form_of(
    model: Model, measurement: Measurement | None = None
) -> tuple[tuple[Effect, ...], tuple[Nuisance, ...]]:
    """Return effects of no size that let the form of a frame and of a test vary, and how far it may vary.

    A model that has some of them already, as one that an earlier diagnosis found, keeps its own.
    """
    known = {_place(e): e for kind in (*FORMS, *TEST_FORMS) for e in model.of_kind(kind)}
    each = [(e, _usual(model, e)) for kind in FORMS for e in kind.propose(model)]
    if measurement is not None:
        each += _of_test(model, measurement)
    chosen = [(known.get(_place(e), e), usual) for e, usual in each]
    varied = [
        Nuisance(e.name, p.name, std, mean)
        for e, usual in chosen
        for p in e.parameters()
        for mean, std in [usual[p.name]]
        if std > 0  # 0 means an exact description
    ]
    return tuple(e for e, _ in chosen if e not in known.values()), tuple(varied)


def place_of(form: Effect) -> str:
    """Return where in a frame a part of its form is: section, clamp, joint or corner."""
    if isinstance(form, ZoneForm):
        return "joint" if form.around else "corner"
    return "clamp" if isinstance(form, ClampForm) else "section"


def _usual(model: Model, form: Effect) -> Usual:
    """Return what is known of a part of the form: as stated, as learned from other frames, or as usual."""
    place = place_of(form)
    known = {**USUAL_FORM[place], **model.belief.form.get(place, {})}
    if not isinstance(form, SectionForm):
        return known
    member = form.members[0]
    section, stated = form.frame.members[member].section, model.tolerances_of(member)
    std: dict[str, float] = {}
    for tolerance in stated:
        std |= constants_std(tolerance, section)
    for tolerance in stated:  # what is measured counts before what follows from sizes
        std |= tolerance.shares
    return known | {key: (0.0, value) for key, value in std.items()}


def with_form(model: Model, model_error: float, measurement: Measurement | None = None) -> Model:
    """Return a model with the effects that let its form vary, if beams may err."""
    return model.with_effect(*form_of(model, measurement)[0]) if model_error > 0 else model


def _of_test(model: Model, measurement: Measurement) -> list[tuple[Effect, Usual]]:
    """Return what the instruments add, with means and standard deviations [kg, N/m]."""
    errors, tested = measurement.errors, model.with_instruments(instruments_on(model.mesh, measurement))
    stated = [s.mass for s in (*measurement.sensors, *measurement.other_sensors) if s.mass > 0]
    usual = STATED_MASS * sum(stated) / len(stated) if stated else errors.sensor_mass
    out: list[tuple[Effect, Usual]] = []
    for sensors in SensorForm.propose(tested) if usual > 0 else ():
        out.append((sensors, {"mass": (0.0, min(usual, LIGHT * sensors.reference))}))
    for driver in DriverForm.propose(tested) if errors.driver_mass + errors.stinger > 0 else ():
        m, k = driver.references
        mass, across = min(errors.driver_mass, LIGHT * m), min(errors.stinger, LIGHT * k)
        out.append((driver, {"mass": (0.0, mass), "across": (0.0, across)}))
    return out


def _place(effect: Effect) -> tuple[str, str]:
    return effect.kind, effect.where
