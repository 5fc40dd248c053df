"""What a test could see and name, in words and numbers."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from dovetail.report import words
from fem.model import Effect
from updating.correlation import DB_PER_NEPER
from updating.diagnosis.evidence.screening import distance
from updating.diagnosis.findings import EffectParameter
from updating.plan.plan import Outlook, Plan, share


@dataclass(frozen=True, slots=True)
class KindRow:
    """What a test shows of effects of one kind.

    Attributes
    ----------
    kind : str
    relevant : str
        The relevant size, in words.
    n : int
        Effects: places, directions and positions along members.
    seen, located, named : float
        Shares of them of which the test shows a relevant size [-].
    smallest, largest : str
        Sizes at which the first and the last of them is named; empty where none is.
    """

    kind: str
    relevant: str
    n: int
    seen: float
    located: float
    named: float
    smallest: str
    largest: str


def size_text(effect: Effect) -> str:
    """Return the size of an effect as its trade says it, or else its first parameter."""
    if said := effect.size_in_words():
        return said
    p = effect.parameters()[0]
    shown = words.as_stiffness(EffectParameter(p.name, float(p.value), p.unit, np.nan))
    return f"{shown.name.replace('_', ' ')} {words.with_unit(shown.value, shown.unit)}"


def kind_rows(plan: Plan) -> list[KindRow]:
    """Return a row for each kind of effect with a relevant size."""
    out = []
    for (kind, unit), some in plan.kinds.items():
        named = sorted((o.visible.named for o in some if o.visible.named is not None), key=_size)
        about = ", rotation" if kind.endswith(("stiffness", "flexibility")) and "rad" in unit else ""
        out.append(
            KindRow(
                kind.replace("_", " ") + about, _range(sorted((o.relevant for o in some), key=_size)),
                len(some), *(share(some, what) for what in ("seen", "located", "named")),
                size_text(named[0]) if named else "",
                size_text(named[-1]) if len(named) == len(some) else "",
            )
        )  # fmt: skip
    return out


def _size(effect: Effect) -> float:
    """Return how far an effect is from none, on the scale of its parameter; flexibility for stiffness."""
    p = effect.parameters()[0]
    return abs(distance(p, float(p.value)))


def _range(effects: list[Effect]) -> str:
    first, last = size_text(effects[0]), size_text(effects[-1])
    return first if first == last else f"{first} … {last.partition(' ')[2]}"


def title(plan: Plan) -> str:
    """Return what the map is of."""
    m, data = plan.measurement, plan.visibility.problem.data
    f = data.frequency
    left = plan.visibility.left * DB_PER_NEPER
    said = (
        "beside what the fit leaves of the measured FRFs"
        if plan.is_measured
        else f"noise {data.noise_db:.2g} dB, of a right model {left:.2g} dB more are expected to be left"
    )
    return f"{len(m.sensors)} sensors, {len(m.excitations)} excitations, {f[0]:.4g} to {f[-1]:.4g} Hz; {said}"


def twin_text(outlook: Outlook, rival: Effect) -> str:
    """Return a relevant effect and what the test cannot tell it from."""
    one, other = (words.effect_label(e.kind, e.where) for e in (outlook.relevant, rival))
    return f"{one}, {size_text(outlook.relevant)} = {other} (alike to {outlook.visible.alike:.3f})"


def blind_lines(plan: Plan) -> list[str]:
    """Return where relevant effects are not seen, by kind."""
    out = []
    for (kind, _), every in plan.kinds.items():
        there: dict[str, list[bool]] = {}
        for o in every:
            place = words.place(o.relevant.where.partition(" at ")[0])
            there.setdefault(place, []).append(o.seen)
        places = [
            place + (f" ({seen.count(False)} of {len(seen)} positions)" if len(seen) > 1 else "")
            for place, seen in there.items()
            if not all(seen)
        ]
        if places:
            out.append(f"{kind.replace('_', ' ')}: {'; '.join(places)}")
    return out


def plan_dict(plan: Plan) -> dict[str, Any]:
    """Return a plan for JSON."""

    def sized(e: Effect | None) -> dict[str, Any] | None:
        if e is None:
            return None
        return {p.name: {"value": float(p.value), "unit": p.unit} for p in e.parameters()}

    return {
        "measured": plan.is_measured,
        "noise_db": plan.visibility.problem.data.noise_db,
        "left_db": plan.visibility.left * DB_PER_NEPER,
        "relevant_sizes": {k: getattr(plan.sizes, k) for k in ("connections", "members", "cracks", "masses")},
        "coverage": {what: plan.coverage(what) for what in ("seen", "located", "named")},
        "kinds": [{name: getattr(row, name) for name in KindRow.__slots__} for row in kind_rows(plan)],
        "effects": [
            {
                "kind": x.effect.kind, "where": x.effect.where, "seen": sized(x.seen),
                "located": sized(x.located), "named": sized(x.named),
                "rival": {"kind": x.rival.kind, "where": x.rival.where},
                "alike": x.alike,
            }
            for x in plan.visibility.effects
        ],
    }  # fmt: skip
