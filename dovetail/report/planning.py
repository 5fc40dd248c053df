"""What a test could see and name, in words and numbers."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from dovetail.report import words
from fem.model import Effect
from updating.correlation import DB_PER_NEPER
from updating.diagnosis.findings import EffectParameter
from updating.plan.plan import Outlook, Plan, share, size_of


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
        Sizes at which the first and the last of them is named; empty where that is not plausible.
    blind : int
        Places at which none of a plausible size is.
    """

    kind: str
    relevant: str
    n: int
    seen: float
    located: float
    named: float
    smallest: str
    largest: str
    blind: int


def size_text(effect: Effect) -> str:
    """Return the size of an effect as its trade says it, or else its first parameter."""
    if said := effect.size_in_words():
        return said
    p = effect.parameters()[0]
    shown = words.as_stiffness(EffectParameter(p.name, float(p.value), p.unit, np.nan))
    return f"{shown.name.replace('_', ' ')} {words.with_unit(shown.value, shown.unit)}"


def kind_rows(plan: Plan, what: str = "named") -> list[KindRow]:
    """Return a row for each kind of effect with a relevant size, with the sizes that are ``what``."""
    out = []
    for some, of in zip(plan.kinds.values(), plan.sizes_of(what), strict=True):
        kind, unit = of["kind"], of["unit"]
        about = ", rotation" if kind.endswith(("stiffness", "flexibility")) and "rad" in unit else ""
        least, most = ("" if of[key] is None else size_text(of[key]) for key in ("least", "most"))
        out.append(
            KindRow(
                kind.replace("_", " ") + about, _range(sorted((o.relevant for o in some), key=size_of)),
                len(some), *(share(some, each) for each in ("seen", "located", "named")), least, most,
                of["blind"],
            )
        )  # fmt: skip
    return out


def excluded_rows(plan: Plan) -> list[tuple[str, str, str, str]]:
    """Return for each kind at what size an effect would have been seen: at best, at worst, and where never."""
    return [
        (r.kind, r.smallest or "–", r.largest or "–", f"{r.blind} of {r.n}" if r.blind else "nowhere")
        for r in kind_rows(plan, "seen")
    ]


EXCLUDED = (
    "Nothing missing means: nothing of at least these sizes, which these data would have shown with 90 %, "
    "whatever the uncertain parameters and the form are within their tolerances."
)
EXCLUDED_HEAD = ("effect", "seen from, at the best place", "at the worst", "never seen at")


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
