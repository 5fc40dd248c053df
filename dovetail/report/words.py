"""A diagnosis in words: names, numbers with their uncertainty, and the verdict."""

import math
import re
from collections.abc import Iterable, Sequence

from dovetail.result import ADDED, RunResult, UncertainValue, added_parameters, by_frfs
from dovetail.spots import axis_text, spot_label, spot_text
from fem.declarations import Site
from fem.lengths import shown_length
from fem.model import DIRECTIONS, Effect, Model, Parameter, inverse
from fem.summary import percent
from updating.diagnosis.candidates import unstated
from updating.diagnosis.departures import Departure
from updating.diagnosis.diagnosis import Diagnosis
from updating.diagnosis.findings import EffectParameter, Finding, Ranked
from updating.diagnosis.separation import Decisive, Proposal
from updating.diagnosis.verdict import EFFECT, FAULT, NOTHING, UNEXPLAINED, UNFINISHED, Explanation, Verdict
from updating.inference.belief import UNSTATED
from updating.inference.fit_result import FitResult
from updating.quality.faults import Fault

_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"))
_DIRECTION = re.compile(r", (r?)([xyz])$")
_DIRECTIONS = re.compile(r", (r?)([xyz])\b(?![\w.])")
_MANY = re.compile(r"\b(supports|joints|members) ([^,]+(?:, [^,]+){2,}), (?!about|along)([^,]+)")


def place(where: str) -> str:
    """Return a place with its direction spelt out (``joint J, rx``: joint J, about x) and long lists cut."""
    where = _DIRECTION.sub(lambda m: f", {'about' if m[1] else 'along'} {m[2]}", where)
    return _MANY.sub(lambda m: f"{m[2].count(',') + 2} {m[1]} ({m[2].partition(',')[0]} … {m[3]})", where)


def direction_text(direction: str) -> str:
    """Return a direction spelt out (``rx``: about x); other texts as they are."""
    known = direction in DIRECTIONS
    return f"{'about' if direction[0] == 'r' else 'along'} {direction[-1]}" if known else direction


def directions(text: str) -> str:
    """Return a sentence with the directions of places spelt out, as :func:`place` does at its end."""
    return _DIRECTIONS.sub(lambda m: f", {'about' if m[1] else 'along'} {m[2]}", text)


def effect_label(kind: str, where: str) -> str:
    """Return an effect in words, such as ``joint stiffness: joint J, about x``."""
    return f"{kind.replace('_', ' ')}: {place(where)}"


def frf_parts(d: Diagnosis) -> str:
    """Return which parts of FRFs were measured, in words."""
    return "Amplitude and phase" if d.problem.data.phase else "Amplitude"


def number(value: float, digits: int = 3) -> str:
    """Return a number with the given significant digits, an en dash where there is none."""
    if not math.isfinite(value):
        return "rigid" if value == math.inf else "–"
    size = abs(value)
    if value and not 1e-3 <= size < 1e5:
        mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
        return f"{mantissa}·10{_superscript(int(exponent))}".replace("-", "−")
    decimals = max(0, digits - 1 - (math.floor(math.log10(size)) if value else 0))
    return f"{value:.{decimals}f}".replace("-", "−")


def _superscript(exponent: int) -> str:
    return str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def with_unit(
    value: float, unit: str, std: float = math.nan, like: float | None = None, digits: int = 3
) -> str:
    """Return a value with its standard deviation, as many digits as that leaves, and its unit.

    Newtons and pascals get a prefix where the value is large; that of ``like`` if it is given.
    """
    if not math.isfinite(value):
        return number(value)
    factor, prefix = 1.0, ""
    if unit == "m":
        shown, unit = shown_length(1.0)
        factor = 1.0 / shown
    if unit[:1] == "N" or unit == "Pa":
        size = abs(value if like is None else like)
        factor, prefix = next(((f, p) for f, p in _PREFIXES if size >= f), (1.0, ""))
    after = f"\u00a0{prefix}{unit}" if unit != "-" else ""
    value, std = value / factor, std / factor
    if not math.isfinite(std) or std <= 0:
        return number(value, digits) + after
    decimals = 1 - math.floor(math.log10(std))
    if not -3 <= decimals <= 6:
        return f"{number(value)} ± {number(std, 2)}{after}"
    rounded, spread = round(value, decimals) + 0.0, round(std, decimals)  # no "−0"
    if not rounded and value > 0 and unit[:1] == "N":  # a stiffness of 0 would be none
        return f"{number(value, 2)} ± {number(std, 2)}{after}"
    shown = max(decimals, 0)
    return f"{rounded:.{shown}f} ± {spread:.{shown}f}{after}".replace("-", "−")


def as_stiffness(p: EffectParameter) -> EffectParameter:
    """Return a compliance as a stiffness; others as they are."""
    other = p.reciprocal if p.name == "compliance" else None
    return p if other is None else other


def absent_value(p: Parameter) -> float:
    """Return the value at which a parameter's effect is absent, that of a compliance as a stiffness."""
    return inverse(p.absent) if p.name == "compliance" else p.absent


def fitted_text(p: EffectParameter) -> str:
    """Return a fitted value with its standard deviation, or that it is at its bound, where it has none.

    Where the deviation is large, with the interval that it means on the scale of the fit.
    """
    if p.at_bound:
        return f"{with_unit(p.value, p.unit)} (at its bound)"
    # From a third of the value on, value ± std is off by half of the deviation where 1/value is normal.
    if p.scale == "linear" or not abs(p.value) / 3 < p.std < math.inf:
        return with_unit(p.value, p.unit, p.std)
    low, high = (with_unit(x, p.unit, like=p.value, digits=2) for x in p.interval)
    ends = f"above {low}" if math.isinf(p.interval[1]) else f"{low.split(chr(160))[0]} to {high}"
    return f"{with_unit(p.value, p.unit, digits=2)} ({ends})"


def parameter_text(p: EffectParameter, of: Parameter | None = None) -> str:
    """Return ``stiffness 147 ± 10 N·m/rad instead of 2980 N·m/rad``, the last where the model has a value."""
    p = as_stiffness(p)
    text = f"{p.name.replace('_', ' ')} {fitted_text(p)}"
    absent = math.nan if of is None else absent_value(of)
    if math.isnan(absent) or absent in (0, p.value):
        return text
    if not math.isfinite(absent):
        return f"{text} instead of rigid"
    return f"{text} instead of {with_unit(absent, p.unit, like=near(absent, p.value))}"


def explanation_text(e: Explanation, model: Model) -> str:
    """Return an explanation with the values of its effects, and the numbers of their nodes and elements."""
    shown = (as_stiffness(p) for parameters in e.parameters for p in parameters)
    values = [f"{p.name} {fitted_text(p)}" for p in shown]
    spots = "".join(spot_label(x, model) for x in e.effects)
    return (f"{e.label}: {', '.join(values)}" if values else e.label) + spots


def near(value: float, other: float) -> float | None:
    """Return ``other`` if it is near enough to share a unit's prefix with ``value``."""
    return other if 1e-4 < abs(value / other if other else 0.0) < 1e4 else None


def parameters_text(parameters: Sequence[EffectParameter]) -> str:
    """Return parameters with their values, on one line."""
    return ", ".join(parameter_text(p) for p in parameters)


def digits_apart(value: float, others: Iterable[float]) -> int:
    """Return the decimals, 2 to 4, that show how a value differs from others."""
    known = [x for x in others if math.isfinite(x) and x != value]
    return next((n for n in (2, 3) if all(f"{x:.{n}f}" != f"{value:.{n}f}" for x in known)), 4)


def against_text(first: float, second: float) -> str:
    """Return two errors [dB] with the decimals that show their difference."""
    n = digits_apart(first, [second])
    return f"{first:.{n}f} dB against {second:.{n}f} dB"


def equal_fit_text(d: Verdict, finding: Finding, ranked: Sequence[Ranked]) -> str:
    """Return which other effects fit the data as well as a finding, which only priors make less probable."""
    accepted = next((r for r in ranked if r.name == finding.effect.name), None)
    if accepted is None or not finding.equal_fits:
        return ""
    texts = []
    for r in finding.equal_fits[:4]:
        p = percent(float(sum(p for names, p in d.posterior if r.name in names)))
        n = digits_apart(accepted.similarity, [r.similarity])
        errors = against_text(r.fit_db, accepted.fit_db)
        like = f"similarity {r.similarity:.{n}f}; probability, alone or with others, {p}"
        texts.append(f"{ranked_label(r)} ({errors}, {like})")
    more = " …" if len(finding.equal_fits) > 4 else ""
    return f"these data are fitted as well by {'; '.join(texts)}{more}: the prior decides, not the data"


def no_rival_text(d: Verdict, finding: Finding, ranked: Sequence[Ranked]) -> str:
    """Return what was fitted in place of a finding that has no rival, in a sentence."""
    without = (
        x for x in d.explanations if x.known and finding.effect.name not in {e.name for e in x.effects}
    )
    other = max((x for x in without if x.effects), key=lambda x: x.probability, default=None)
    if other is not None:
        return (
            f"The most probable explanation without it that was fitted is {other.label}, and nothing else: "
            f"{percent(other.probability)}."
        )
    if len(ranked) > 1:
        return "Each other candidate that was fitted in its place contains it."
    return "No other candidate was promising enough to be fitted to all lines."


def extension_text(finding: Finding, twin: Ranked) -> str:
    """Return which candidate does the same as a found effect and more, with its further parameters."""
    known = {p.name for p in finding.parameters}
    more = parameters_text([p for p in twin.parameters if p.name not in known])
    return f"also consistent with {ranked_label(twin)}, whose {more} these data do not require"


def finding_text(finding: Finding) -> str:
    """Return an effect with its values and the model's, on one line."""
    known = {p.name: p for p in finding.effect.parameters()}
    values = ", ".join(parameter_text(p, known.get(p.name)) for p in finding.parameters)
    return f"{effect_label(finding.effect.kind, finding.effect.where)}, {values}"


def compliance_text(finding: Finding) -> str:
    """Return a found stiffness as a compliance; empty of an effect without one."""
    form = finding.compliance
    return f"as a compliance: {fitted_text(form)}" if form is not None and form.value else ""


def added_text(effect: Effect, fit: FitResult | None) -> str:
    """Return an effect that was added by hand, with its values, on one line."""
    values = parameters_text(added_parameters(effect, fit))
    return f"{effect.name} ({place(effect.where)}), {values}" if values else effect.name


_INSIDE = {"u": "", "plane": " in the plane of its members"}
"""What is stiffer or softer of a connection, by the parameter of its form: the logarithm of a factor."""
_SECTION = {
    "A": "mass per length",
    "Iy": "bending stiffness about y",
    "Iz": "bending stiffness about z",
    "J": "torsional stiffness",
    "shear": "shear flexibility",
    "mass": "mass of the connection",
}
"""What is higher or lower of a section or connection, by the parameter of its form."""


def departure_label(d: Departure) -> str:
    """Return in short which way a section or connection differs from the drawing, for pictures."""
    if d.unit != "-":
        return f"adds {'more' if d.value > 0 else 'less'} {ADDED.get(d.parameter, d.parameter)} than stated"
    if d.parameter in _INSIDE:
        return f"{'stiffer' if d.value > 0 else 'softer'} than drawn"
    return f"{_SECTION.get(d.parameter, d.parameter)} {'higher' if d.value > 0 else 'lower'} than drawn"


def departure_text(d: Departure) -> str:
    """Return how a section, connection or instrument differs, with effects that may be there instead."""
    if d.unit != "-":
        change = f"{with_unit(abs(d.value), d.unit, d.std)} {'more' if d.value > 0 else 'less'}"
        what = f"{ADDED.get(d.parameter, d.parameter)} is {change} than stated"
    elif d.parameter in _INSIDE:
        change = with_unit(100 * abs(math.expm1(d.value)), "%", 100 * math.exp(d.value) * min(d.std, 3.0))
        what = f"the connection is {change} {'stiffer' if d.value > 0 else 'softer'}{_INSIDE[d.parameter]}"
    else:
        change = with_unit(100 * abs(d.value), "%", 100 * d.std)
        higher = "higher" if d.value > 0 else "lower"
        what = f"{_SECTION.get(d.parameter, d.parameter)} is {change} {higher} than drawn"
    text = f"{place(d.where)}: {what}; outside the usual range with a probability of {percent(d.probability)}"
    if not d.rivals:
        return text
    others = "; ".join(
        f"{' and '.join(effect_label(e.kind, e.where) for e in effects)} (probability {percent(p)})"
        for effects, p in d.rivals
    )
    return f"{text}. Possible instead: {others}"


def far_text(parameters: Sequence[UncertainValue]) -> str:
    """Return a warning of uncertain parameters far from nominal; empty without any."""
    far = [f"{u.words} ({u.moved:+.1f})".replace("-", "−") for u in parameters if u.far]
    if not far:
        return ""
    return (
        f"Beware of uncertain parameters far from nominal, in prior standard deviations: {', '.join(far)}. "
        "They may stand in for something else that the model has wrong."
    )


FAULT_NAMES = {
    "sensor_sign": "wrong sign",
    "sensor_gain": "wrong gain",
    "sensor_delay": "delay",
    "sensor_swap": "swapped labels",
    "sensor_tilt": "tilt",
    "sensor_position": "wrong place",
    "excitation_sign": "force with wrong sign",
    "excitation_gain": "force with wrong gain",
    "excitation_delay": "force with delay",
    "excitation_swap": "forces with swapped labels",
    "excitation_tilt": "tilted force",
    "excitation_position": "force at wrong place",
}
"""Kinds of faults in words."""


def fault_value(fault: Fault) -> str:
    """Return a fault's value with its unit: angles in degrees, delays in µs."""
    if fault.kind.endswith("swap"):
        return f"with {fault.other}"
    if fault.unit == "rad":
        return with_unit(math.degrees(fault.value), "°", math.degrees(fault.std))
    if fault.unit == "s":
        return with_unit(1e6 * fault.value, "µs", 1e6 * fault.std)
    if fault.unit == "m":
        return with_unit(1e3 * fault.value, "mm", 1e3 * fault.std)
    return with_unit(fault.value, fault.unit, fault.std)


def fault_text(fault: Fault) -> str:
    """Return a fault of a sensor or a force in words."""
    name, value = fault.sensor, fault_value(fault)
    instead = f", or {fault.other} instead (the data are the same)" if fault.other else ""
    along = f"{value} along {fault.other}"
    if fault.shift:
        along = f"at {fault.other}, {value}"
    elif fault.direction:
        along = f"{value} towards {axis_text(fault.direction)}"
    text = {
        "sensor_sign": f"{name} reads with the opposite sign{instead}",
        "sensor_gain": f"{name} reads {value} times the motion",
        "sensor_delay": f"{name} reads {value} late",
        "sensor_swap": f"{name} and {fault.other} have each other's labels",
        "sensor_tilt": f"{name} is tilted by {value}",
        "sensor_position": f"{name} sits {along} from its stated place",
        "excitation_sign": f"the force at {name} has the opposite sign{instead}",
        "excitation_gain": f"the force at {name} is recorded {value} times as large as it is",
        "excitation_delay": f"the force at {name} is recorded {value} late",
        "excitation_swap": f"the forces at {name} and {fault.other} have each other's labels",
        "excitation_tilt": f"the force at {name} is tilted by {value}",
        "excitation_position": f"the force at {name} acts {along} from its stated place",
    }[fault.kind]
    return f"{text} ({tolerance_text(fault)})" if fault.tolerance else text


def tolerance_text(fault: Fault) -> str:
    """Return how many of its tolerances an error of a channel is; empty of what has none."""
    if not fault.tolerance:
        return ""
    size = 1 / fault.value if fault.kind == "excitation_gain" else fault.value
    size = size - 1 if fault.kind.endswith("gain") else size
    return f"{abs(size) / fault.tolerance:.1f} times its tolerance"


def fault_remedy(fault: Fault) -> str:
    """Return the remedy for a fault."""
    of, kind = fault.kind.split("_", 1)
    force = of == "excitation"
    calibrate = "multiply its FRFs by" if force else "divide its readings by"
    late = "the phase of its FRFs" if force else "its phase"
    return {
        "sign": "turn its direction round in the study, or set its sign to −1",
        "gain": f"check its calibration: {calibrate} {number(fault.value)}",
        "delay": f"check its filter and channel: take the delay off {late}",
        "swap": "exchange the two labels",
        "tilt": "set its direction in the study to the real one",
        "position": "set its place in the study to the real one"
        + ("" if fault.shift or fault.tolerance else "; it was left out"),
    }[kind]


def ranked_label(r: Ranked) -> str:
    """Return a candidate in words."""
    return effect_label(r.kind, r.where)


def headline(d: Verdict) -> str:
    """Return the verdict in plain sentences."""
    change = d.baseline is not None
    known = d.every_fault
    faults = " and ".join(map(fault_text, known[:3])) + (" …" if len(known) > 3 else "")
    if d.verdict == EFFECT and is_open(d):
        what = f"Something has changed{states_text(d)}" if change else "The model lacks something"
        return f"{what}. These data leave open which of {len(d.credible)} explanations is right."
    if d.verdict == EFFECT:
        text = _since(d, sentences(d.findings))
        if d.images:
            text = f"{text.removesuffix('.')}, {images_text(d)}."
        if by_frfs(d) and d.steps[-1].level > d.limit:
            text += " That explains the misfit only in part."
        return f"{text} In addition, {faults}." if faults else text
    if d.verdict == NOTHING and change:
        return f"Nothing has changed{states_text(d)} that these data can show."
    if d.verdict == NOTHING and by_frfs(d) and d.more_than_noise:
        return "The model lacks nothing that stands out from the error of beam theory."
    if d.verdict == NOTHING:
        return "The model lacks nothing that these data can show."
    if d.verdict == FAULT:
        return f"The measurement is at fault, not the model: {faults}."
    if d.verdict == UNFINISHED:
        best = f" Best so far: {sentences(d.findings)}" if d.findings else " Nothing has been found so far."
        return f"The search was ended early, and other answers may be more probable.{best}"
    if d.verdict == UNEXPLAINED:
        text = "The model does not fit the data, and no effect known to the program explains why."
        return f"{text} The measurement has been corrected: {faults}." if faults else text
    return d.verdict


def images_text(d: Verdict) -> str:
    """Return the mirror images of what was found, and what tells them apart; empty without any."""
    if not d.images:
        return ""
    labelled = " or ".join(" and ".join(effect_label(e.kind, e.where) for e in x.effects) for x in d.images)
    image = "its mirror image" if len(d.images) == 1 else f"one of its {len(d.images)} mirror images"
    tells = f". One sensor would: {d.next_measurements[0]}" if d.next_measurements else ""
    return f"or {image}, {labelled}: these data cannot tell which{tells}"


def is_open(d: Verdict) -> bool:
    """Whether other explanations than the one reported are together more probable than it.

    Findings by FRFs have twins instead, which their sentences name.
    """
    return d.modes is not None and not d.sure


def states_text(d: Verdict) -> str:
    """Return which states a change lies between, such as `` since the baseline (a → d)``."""
    names = ""
    if by_frfs(d) and d.baseline is not None:
        measured = (problem.data.measurement.name for problem in (d.baseline.problem, d.problem))
        names = f" ({' → '.join(measured)})"
    return f" since the baseline{names}"


def _since(d: Verdict, text: str) -> str:
    if d.baseline is None:
        return text
    return f"Change{states_text(d)}: {text[:1].lower()}{text[1:]}"


def values_found(d: Verdict) -> list[str]:
    """Return the effects found with their values, a line each."""
    spots = (spot_text(f.effect, d.model) for f in d.findings)
    lines = [
        finding_text(f) + (f"; {spot}" if spot else "") for f, spot in zip(d.findings, spots, strict=True)
    ]
    if not lines or not is_open(d):
        return lines
    first = d.reported is d.explanations[0]
    return ["The most probable explanation:" if first else "The simplest probable explanation:", *lines]


def sentences(findings: Sequence[Finding]) -> str:
    """Return findings as plain sentences, one for all directions of the same thing."""
    groups: dict[tuple[object, ...], list[Finding]] = {}
    for f in findings:
        site = f.effect.where
        one = (f.effect.statement, site.thing, site.at, _change(f) > 0) if site.detail else (f.effect.name,)
        groups.setdefault(one, []).append(f)
    return " ".join(map(sentence, groups.values()))


def sentence(findings: Sequence[Finding]) -> str:
    """Return findings of one kind at one thing as a plain sentence, the effect's statement where it has one.

    Fields of a statement: ``where`` (place and direction), ``thing`` (the place alone), ``direction``,
    ``member`` and ``at`` of a place along a member, and ``label``; by the sign of the change ``stiffer``,
    ``heavier`` and ``tension``; by the number of places ``are`` and ``act``.
    """
    finding = findings[0]
    site = finding.effect.where
    direction = " and ".join(direction_text(f.effect.where.detail) for f in findings)
    thing = place(Site(site.thing, site.at or None))
    where = f"{thing}, {direction}" if direction else thing
    change = _change(finding)
    more = change > 0
    several = "supports" in thing or "joints" in thing
    statement = finding.effect.statement or "the model lacks {label}"
    text = statement.format(
        label=" and ".join(effect_label(f.effect.kind, f.effect.where) for f in findings),
        where=where,
        thing=thing,
        direction=direction,
        member=place(site.thing),
        at=site.at,
        stiffer="stiffer" if more else "softer",
        heavier="heavier" if more else "lighter",
        tension="tension" if more else "compression",
        are="are" if several else "is",
        act="act" if several else "acts",
    )
    n = sum(len(f.alternatives) for f in findings)
    if n:
        others = "another effect" if n == 1 else f"one of {n} other effects"
        text += f", or it is {others} that these data cannot distinguish from it"
    return f"{text[0].upper()}{text[1:]}."


def _change(finding: Finding) -> float:
    """Return how the first parameter differs from its value in the model."""
    first = finding.parameters[0]
    absent = next((p.absent for p in finding.effect.parameters() if p.name == first.name), 0.0)
    return first.value - absent


def step_label(label: str) -> str:
    """Return the label of a step with the added effect's direction spelt out, behind a plus sign."""
    added = label.removesuffix(" added")
    return f"+ {place(added)}" if added != label else label


def decisive_text(piece: Decisive) -> str:
    """Return a piece of the data that decides, in words."""
    return (
        f"{piece.output} / {piece.input} from {piece.band[0]:.4g} to {piece.band[1]:.4g} Hz: "
        f"{against_text(piece.first_db, piece.second_db)}"
    )


def evidence_text(evidence: float) -> str:
    """Return an expected log likelihood ratio as odds."""
    if evidence < 1:
        return "hardly any"
    odds = evidence / math.log(10)
    return f"{math.exp(evidence):.0f} to 1" if odds < 4 else f"10{_superscript(int(min(odds, 99)))} to 1"


def proposal_text(proposal: Proposal) -> str:
    """Return a measurement that would separate twins, in words."""
    what = {"sensor": "a sensor on ", "excitation": "a force on ", "band": ""}[proposal.kind]
    return f"{what}{proposal.where}"


def advice(result: RunResult[Verdict]) -> list[str]:
    """Return advice where the misfit stays unexplained."""
    out = [*_worst_sensors(result), *_best_places(result)]
    bound = [u.words for u in result.uncertain if u.at_bound]
    if bound:
        out.append(
            f"These uncertain parameters end at their bounds: {', '.join(bound)}. Their nominal values or "
            "standard "
            "deviations may be wrong."
        )
    if result.study.kinds is not None or result.study.exclude:
        out.append("The study excludes some kinds of candidates; let the program try all of them.")
    else:
        out += [text[0].upper() + text[1:] + "." for text in unstated_text(result.study.model)]
    return [
        *out,
        "Check geometry, sections, supports and joints of the model against the structure: candidates change "
        "stiffness, mass and damping where the model has something, not dimensions.",
        "Sensors on both sides of joints and near supports, and a second excitation in another direction, "
        "distinguish more candidates.",
        "Measure at two force levels: a difference shows that the structure is not linear, which no "
        "candidate can explain.",
    ]


def unstated_text(model: Model) -> list[str]:
    """Return a sentence for each environment that a model does not state: what that means for its kinds."""
    return [
        f'environment "{name}" is not stated in [candidates]; '
        + (f"prior odds × {UNSTATED[name]:g}" if UNSTATED[name] else "not proposed")
        + f": {', '.join(kinds)}"
        for name, kinds in unstated(model).items()
    ]


def _worst_sensors(result: RunResult[Verdict]) -> list[str]:
    where = result.localisation
    if where is None:
        return []
    known = [
        (db, name) for db, name in zip(where.by_sensor_db, where.sensors, strict=True) if math.isfinite(db)
    ]
    worst = ", ".join(f"{name} ({db:.1f} dB)" for db, name in sorted(known, reverse=True)[:3])
    return [
        f"Look at the sensors that fit worst: {worst}. Check their place, direction, cable and calibration."
    ]


def _best_places(result: RunResult[Verdict]) -> list[str]:
    where = result.localisation
    if where is None or not where.says_where:
        return []
    shares = [
        *((s, f"member {m}") for m, s in where.members.items()),
        *((s, place(p)) for p, s in where.places),
    ]
    best = [f"{name} ({100 * s:.0f}\u00a0%)" for s, name in sorted(shares, reverse=True)[:3] if s >= 0.05]
    return [f"Shares of the misfit that a change there would explain: {', '.join(best)}."] if best else []
