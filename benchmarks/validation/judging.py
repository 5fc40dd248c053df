"""Whether a diagnosis is right: hidden effects against reported ones."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from benchmarks.validation.cases import Case, Implant
from benchmarks.validation.evidence import Stated, assess
from benchmarks.validation.frames import Draft
from benchmarks.validation.hidden import KINDS
from benchmarks.validation.hiding import Place
from fem import Effect, Model
from fem.effects.places import PARALLEL, frame_of
from updating import EFFECT, FAULT, NOTHING, Diagnosis, Fault, Finding, ModeDiagnosis, propose
from updating.correlation import log_ratio, rms_db
from updating.diagnosis.evidence import Searched

FLOOR = 1.3
"""An effect has explained the data if the error that is left is within this factor of the floor."""

OUTCOMES = ("right", "beside", "part", "twin", "wrong", "unexplained", "not noticed", "fault", "failed")
"""`judge` explains them; a case has failed that ended in an error."""

Record = dict[str, Any]


def same_place(effect: Effect, model: Model, place: Place) -> bool:
    """Whether an effect sits where something was hidden: joint, support, direction, member or point."""
    for want, one, several in ((place.joint, "joint", "joints"), (place.support, "support", "supports")):
        if want is not None:
            have = getattr(effect, several, None) or (getattr(effect, one, None),)
            if tuple(have) != (want,):
                return False
    if place.direction is not None and not _acts_along(effect, model, place.direction):
        return False
    turned = getattr(effect, "member", None), getattr(effect, "direction", None)
    if place.turns and turned not in place.turns:
        return False
    pair = (getattr(effect, "first", None), getattr(effect, "second", None))
    if place.pair and set(pair) != set(place.pair):
        return False
    if place.of_member:
        ends = getattr(effect, "ends", ())
        if {m for m, _ in ends} | {getattr(effect, "member", place.member)} != {place.member}:
            return False
    if place.xyz is not None:
        marks = effect.locations(model)
        return bool(len(marks) and (np.linalg.norm(marks - place.xyz, axis=1) <= place.tolerance).any())
    if place.member is not None:
        have = getattr(effect, "members", None) or (getattr(effect, "member", None),)
        return tuple(have) == (place.member,)
    return True


def _acts_along(effect: Effect, model: Model, direction: str) -> bool:
    """Whether an effect acts in a direction x … rz; also one that names no direction does."""
    along, member = getattr(effect, "direction", None), getattr(effect, "member", None)
    if not isinstance(along, str):
        return True
    if member is None or along not in "xyz":
        return along.lstrip("+-") == direction
    axes = frame_of(model).rotations(model.mesh, model.mesh.members[member][:1])[0]  # across the member
    return direction in "xyz" and bool(abs(axes["xyz".index(along), "xyz".index(direction)]) >= PARALLEL)


def _matches(effect: Effect | None, model: Model, implant: Implant) -> bool:
    right = KINDS[implant.hidden.kind].found_as
    return effect is not None and effect.kind in right and same_place(effect, model, implant.hidden.place)


def stated(model: Model, implants: Sequence[Implant]) -> tuple[Stated, ...]:
    """Return hidden effects in the terms of the library; faults are none."""
    return tuple(_stated(model, i) for i in implants if not KINDS[i.hidden.kind].fault)


def _stated(model: Model, implant: Implant) -> Stated:
    place, values = implant.hidden.place, implant.hidden.values(implant.amplitude)
    return Stated(
        KINDS[implant.hidden.kind].found_as,
        lambda effect: same_place(effect, model, place),
        lambda effect: values,
    )


def are_hidden(model: Model, implants: Sequence[Implant], effects: Sequence[Effect]) -> bool:
    """Whether some effects are those that are hidden, each once and no others."""
    hidden = [i for i in implants if not KINDS[i.hidden.kind].fault]
    if len(hidden) != len(effects) or not effects:
        return len(hidden) == len(effects)
    hit = np.array([[_matches(e, model, i) for i in hidden] for e in effects])
    return bool(hit[linear_sum_assignment(~hit)].all())


def judge_evidence(case: Case, diagnosis: Diagnosis, searched: Searched, record: Record) -> Record:
    """Return the record of a search's posterior, beside that of its diagnosis."""
    right = record["outcome"] == "right" or (case.set, record["outcome"]) == ("withheld", "twin")
    faults_right = record["outcome"] in ("right", "beside") if case.set == "faults" else not diagnosis.faults
    return evidence_of(case.model, case.implants, searched, diagnosis, right, faults_right)


def evidence_of(
    model: Model,
    implants: Sequence[Implant],
    searched: Searched,
    diagnosis: Diagnosis | ModeDiagnosis,
    right: bool,
    faults_right: bool = True,
) -> Record:
    """Return the record of a search's posterior."""
    ways = [stated(model, implants)]
    return assess(searched, diagnosis, right, faults_right, ways, lambda e: are_hidden(model, implants, e))


def judge(case: Case, diagnosis: Diagnosis) -> Record:
    """Return everything about a case that a table or a reader needs, as plain values.

    ``outcome`` is one of

    - right: all that was hidden is found, and nothing else; nothing missing, where nothing was hidden;
      unexplained, where the true kind was withheld
    - beside: all that was hidden is found, and something else
    - part: one of two effects is found, and nothing else
    - twin: another effect came first, with the right one among its twins; for a withheld kind,
      another effect that explains the data down to ``FLOOR`` times the floor
    - wrong: an effect that was not hidden (a false alarm where nothing was)
    - unexplained, not noticed, fault: the verdict instead

    ``nearest`` is the most probable candidate beside what was found, with how much less probable that is
    than the answer [nats].
    """
    model = diagnosis.model
    proposed = {e.name: e for e in propose(case.model, test=case.measurement)}

    def effect_of(ranked: Any) -> Effect | None:
        effect = proposed.get(ranked.name)
        if effect is None:
            return None
        return effect.with_values(**{p.name: p.value for p in ranked.parameters})

    def hits(finding: Finding) -> list[Implant]:
        return [i for i in case.implants if _matches(finding.effect, model, i)]

    hit = [hits(f) for f in diagnosis.findings]
    found = [i for i in case.implants if any(i in h for h in hit)]
    false = [f for f, h in zip(diagnosis.findings, hit, strict=True) if not h]
    twins = [effect_of(t) for f in diagnosis.findings[:1] for t in f.twins]
    twin = any(_matches(e, model, i) for e in twins for i in case.implants)
    floor = _floor(case, diagnosis)
    after = float([s.fit_db for s in diagnosis.steps][-1])
    if case.set == "faults":
        outcome = _fault_outcome(case, diagnosis)
    else:
        outcome = _outcome(case, diagnosis, found, bool(false), twin, after <= FLOOR * floor)
    return {
        **heading((case.set, case.index), case.draft, case.implants, diagnosis),
        "modes": case.draft.n_modes,
        "lines": len(case.draft.frequency),
        "drives": len(case.draft.drives),
        "elements": case.model.mesh.n_lines,
        "noise": case.noise,
        "found": [_finding(f) for f in diagnosis.findings],
        "faults": [{"kind": f.kind, "sensor": f.sensor, "value": f.value} for f in diagnosis.faults],
        "candidates": len(diagnosis.rounds[0]) if diagnosis.rounds else 0,
        "nearest": _nearest(diagnosis),
        "outcome": outcome,
        "errors": [
            e
            for f, i in _paired(case, diagnosis.findings, hit)
            for e in parameter_errors(case, i, f.parameters)
        ],
        "db": {
            "nominal": diagnosis.steps[0].fit_db,
            "fitted": diagnosis.steps[1].fit_db if len(diagnosis.steps) > 1 else after,
            "after": after,
            "held_out": [s.held_out_db for s in diagnosis.steps][-1],
            "floor": floor,
            "discretisation": diagnosis.discretisation_db,
            "basis": diagnosis.basis_db,
        },
    }


def _nearest(d: Diagnosis) -> Record | None:
    if d.searched is None or len(d.rounds) <= len(d.findings):
        return None
    best = d.rounds[-1][0]
    return {"kind": best.kind, "where": best.where, "behind": d.searched.best.score - best.score}


def _outcome(
    case: Case, d: Diagnosis, found: Sequence[Implant], false: bool, twin: bool, explained: bool
) -> str:
    if not case.implants:
        if d.findings or d.faults:
            return "wrong"
        return "right" if d.verdict == NOTHING else "unexplained"
    if d.verdict == EFFECT:
        if case.set == "withheld":
            return "twin" if explained else "wrong"
        if len(found) == len(case.implants):
            return "beside" if false or d.faults else "right"
        if found and not false:
            return "part"
        return "twin" if twin else "wrong"
    if d.verdict == FAULT:
        return "fault"
    if d.verdict == NOTHING:
        return "not noticed"
    return "right" if case.set == "withheld" else "unexplained"


def _fault_outcome(case: Case, d: Diagnosis) -> str:
    (implant,) = case.implants
    sensors = implant.hidden.place.sensors
    right = KINDS[implant.hidden.kind].found_as
    named = [f for f in d.faults if any(s in _names(f) for s in sensors)]
    others = [f for f in d.faults if f not in named]
    covered = {s for f in named if f.kind in right for s in _names(f)}
    if set(sensors) <= covered:
        return "beside" if d.findings or others else "right"
    if named and not others and not d.findings:
        return "twin"  # the right sensor, another fault
    if d.findings or d.faults:
        return "wrong"
    return "not noticed" if d.verdict == NOTHING else "unexplained"


def _names(fault: Fault) -> set[str]:
    return {fault.sensor, getattr(fault, "other", "")}


def _floor(case: Case, d: Diagnosis) -> float:
    """Return the amplitude's error that noise and mesh leave to a right model [dB]."""
    mask = d.problem.data.mask
    frf = case.measurement.frf
    noise = log_ratio(frf.H, case.exact)
    if mask.shape == noise.shape:
        noise = np.where(mask, noise, complex("nan"))
    return float(np.hypot(rms_db(noise), d.discretisation_db))


def _paired(
    case: Case, findings: Sequence[Finding], hit: Sequence[Sequence[Implant]]
) -> list[tuple[Finding, Implant]]:
    """Return each finding with the implant that it is compared with, so that all errors together are least.

    A finding may name two implants of one kind, where they are near each other.
    """
    cost = np.full((len(findings), len(case.implants)), np.inf)
    for k, (f, matched) in enumerate(zip(findings, hit, strict=True)):
        for n, i in enumerate(case.implants):
            if i in matched:
                cost[k, n] = sum(e["error"] for e in parameter_errors(case, i, f.parameters))
    large = 1.0 + 2 * cost[np.isfinite(cost)].sum()
    pairs = linear_sum_assignment(np.where(np.isfinite(cost), cost, large))
    return [(findings[k], case.implants[n]) for k, n in zip(*pairs, strict=True) if np.isfinite(cost[k, n])]


def parameter_errors(case: Case, implant: Implant, parameters: Sequence[Any]) -> list[Record]:
    """Compare the parameters of a found effect with the truth, where both have one of the same name.

    The error is relative; that of a position is in parts of the member's length.
    """
    truth = implant.hidden.values(implant.amplitude)
    out = []
    for p in parameters:
        if p.name not in truth:
            continue
        scale = abs(truth[p.name])
        if p.name == "position" and implant.hidden.place.member is not None:
            scale = case.draft.frame.members[implant.hidden.place.member].length
        difference = float(p.value - truth[p.name])
        out.append(
            {
                "kind": implant.hidden.kind,
                "parameter": p.name,
                "truth": truth[p.name],
                "value": float(p.value),
                "std": float(p.std),
                "error": abs(difference) / scale,
                "covered": bool(abs(difference) <= 1.96 * p.std),
            }
        )
    return out


def heading(
    task: tuple[str, int], draft: Draft, implants: Sequence[Implant], diagnosis: Diagnosis | ModeDiagnosis
) -> Record:
    """Return what the records of FRFs and of modes have in common."""
    hidden = [
        {
            "kind": i.hidden.kind,
            "where": i.hidden.place.words,
            "amplitude": i.amplitude,
            "visible_db": None if np.isnan(i.visible_db) else i.visible_db,
            "values": i.hidden.values(i.amplitude),
        }
        for i in implants
    ]
    return {
        "case": f"{task[0]}:{task[1]}",
        "set": task[0],
        "index": task[1],
        "family": draft.family,
        "sensors": len(draft.sensors),
        "hidden": hidden,
        "verdict": diagnosis.verdict,
        "reason": diagnosis.reason,
        "seconds": diagnosis.seconds,
    }


def _finding(f: Finding) -> Record:
    return {
        "kind": f.effect.kind,
        "where": f.effect.where,
        "parameters": [{"name": p.name, "value": float(p.value), "std": float(p.std)} for p in f.parameters],
        "twins": [f"{t.kind} at {t.where}" for t in f.twins],
    }
