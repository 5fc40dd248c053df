"""What a test could see and name, in words and numbers."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.report import words
from dovetail.report.table import Column, Table, columns_of
from dovetail.result import uncertain_words
from dovetail.units.outcome import failed
from fem.model import Effect, ParameterRef
from updating.correlation import DB_PER_NEPER
from updating.diagnosis.findings import EffectParameter
from updating.measurement.measurement import Sensor
from updating.plan.check import FailedTrial, Trial
from updating.plan.choose import N_LINES, ChosenChannels
from updating.plan.perturbed import Separation
from updating.plan.plan import Outlook, Plan, share
from updating.plan.visibility import size_of


@dataclass(frozen=True, slots=True)
class KindRow:
    """What a test shows of effects of one kind.

    Attributes
    ----------
    kind : str
    quantity : str
        The size is that of this; empty where the size says it.
    relevant : str
        The relevant size, in words.
    n : int
        Effects: places, directions and positions along members.
    seen, located, named : float
        Shares of them of which the test shows a relevant size [-].
    first_seen : str
        The size at which the first of them is seen; empty where that is not plausible.
    smallest, largest : str
        Sizes at which the first and the last of them is named; empty where that is not plausible.
    blind : int
        Places at which none of a plausible size is.
    """

    kind: str
    quantity: str
    relevant: str
    n: int
    seen: float
    located: float
    named: float
    first_seen: str
    smallest: str
    largest: str
    blind: int


def size_text(effect: Effect) -> str:
    """Return the size of an effect in words of the field, or its first parameter with its name."""
    return " ".join(filter(None, _size(effect)))


def _size(effect: Effect) -> tuple[str, str]:
    """Return the name of an effect's first parameter and its value; words of the field have no name."""
    p = effect.parameters()[0]
    if p.in_words is not None:
        return "", p.in_words(p.value)
    shown = words.as_stiffness(EffectParameter(p.name, float(p.value), p.unit, np.nan))
    return shown.name.replace("_", " "), words.with_unit(shown.value, shown.unit)


def kind_rows(plan: Plan, what: str = "named") -> list[KindRow]:
    """Return a row for each kind of effect with a relevant size, with the sizes that are ``what``."""
    out = []
    for (name, some), first, of in zip(
        plan.kinds.items(), plan.sizes_of("seen"), plan.sizes_of(what), strict=True
    ):
        ends = (first["least"], of["least"], of["most"])
        seen, smallest, largest = ("" if effect is None else _size(effect)[1] for effect in ends)
        seen_share, located, named = (share(some, each) for each in SHARES)
        by_size = sorted((o.relevant for o in some), key=size_of)
        relevant = " … ".join(dict.fromkeys(_size(effect)[1] for effect in (by_size[0], by_size[-1])))
        quantity = _size(by_size[0])[0]
        shares, sizes = (seen_share, located, named), (seen, smallest, largest, of["blind"])
        out.append(KindRow(name, quantity, relevant, len(some), *shares, *sizes))
    return out


def table_of_excluded(plan: Plan) -> Table:
    """Return for each kind from what size an effect would have been seen, and where it would not."""
    rows = kind_rows(plan, "seen")
    best, worst = (
        [f"{r.quantity} {size}".strip() if size else "–" for r, size in zip(rows, sizes, strict=True)]
        for sizes in ([r.smallest for r in rows], [r.largest for r in rows])
    )
    return Table.of(
        "excluded",
        Column("effect", [r.kind for r in rows]),
        Column("seen from, at the best place", best),
        Column("at the worst", worst),
        Column("blind places", [f"{r.blind} of {r.n}" if r.blind else "none" for r in rows]),
    )


def tables_of_excluded(plan: Plan) -> list[tuple[str, Table]]:
    """Return what data exclude, and what hides smaller effects where anything does, with their headings."""
    hidden = _table_of_hidden(plan)
    return [(EXCLUDED, table_of_excluded(plan)), *([] if hidden is None else [(HIDDEN, hidden)])]


def _table_of_hidden(plan: Plan) -> Table | None:
    """Return for each kind which uncertain parameters hide it most; None if none do."""
    by_kind = {name: by for name, some in plan.kinds.items() if (by := plan.hidden(some))}
    if not by_kind:
        return None
    known = [[size_text(e) for _, e in by[-1:] if e is not None] for by in by_kind.values()]
    return Table.of(
        "hidden",
        Column("effect", list(by_kind)),
        Column("hidden most by", [_uncertain(plan, [ref for ref, _ in by]) for by in by_kind.values()]),
        Column("seen from, if these were known", [size or "–" for size in map("".join, known)]),
    )


def _uncertain(plan: Plan, refs: Sequence[ParameterRef]) -> str:
    """Return uncertain parameters in words, those of one part of the form together."""
    out: dict[str, list[str]] = {}
    for name, parameter in refs:
        effect = plan.visibility.problem.reduced.model.effect(name)
        unit = next(p.unit for p in effect.parameters() if p.name == parameter)
        form = words.place(effect.where) if effect.is_form else ""
        text = uncertain_words(f"{name}.{parameter}", unit, form).removeprefix(f"{form}: ")
        out.setdefault(form, []).append(text)
    return "; ".join(f"{form}: {', '.join(some)}" if form else ", ".join(some) for form, some in out.items())


PERCENT = "{:.0f} %".format
MOST_TWINS, MOST_BLIND = 4, 2
"""Largest numbers of indistinguishable pairs, and of blind places of a kind, that are printed."""
SHARES = ("seen", "located", "named")
EXCLUDED = (
    "A linear estimate: with a probability of 90 %, these data would have shown effects of these sizes."
)

HIDDEN = "Smaller ones are hidden by what is uncertain. If this were known exactly, more would be seen:"


def title(plan: Plan) -> str:
    """Return what the map is of."""
    m, data = plan.measurement, plan.visibility.problem.data
    assert m is not None
    f = data.frequency
    error = plan.visibility.discrepancy
    text = (
        "with the residuals of the measured FRFs"
        if error is None
        else f"noise {data.noise_db:.2g} dB, and {error * DB_PER_NEPER:.2g} dB of error of a right model"
    )
    return f"{len(m.sensors)} sensors, {len(m.excitations)} excitations, {f[0]:.4g} to {f[-1]:.4g} Hz; {text}"


def table_of_kinds(rows: Sequence[KindRow]) -> Table:
    """Return for each kind of effect which shares a test shows, and from what size."""
    to = [r.largest or (f"not at {r.blind}" if r.smallest else "") for r in rows]
    return Table.of(
        "kinds of effects",
        Column("kind", [r.kind for r in rows]),
        Column("relevant size", [f"{r.quantity} {r.relevant}".strip() for r in rows]),
        Column("n", [r.n for r in rows]),
        *(Column(what, [getattr(r, what) for r in rows], "%", PERCENT, 100, head=what) for what in SHARES),
        Column("seen from", [r.first_seen or "none" for r in rows]),
        Column("named from", [r.smallest or "none" for r in rows]),
        Column("to", to),
    )


def headline(plan: Plan) -> str:
    """Return the shares of relevant effects that are seen, located and named."""
    seen, located, named = (100 * plan.coverage(what) for what in SHARES)
    return (
        f"Of {len(plan.relevant)} effects of a relevant size {seen:.0f} % are seen, {located:.0f} % located "
        f"and {named:.0f} % named."
    )


def missing_first(plan: Plan, study: Path) -> list[str]:
    """Return the advice to find what is missing first, where the model does not explain measured data."""
    if plan.is_explained:
        return []
    problem = plan.visibility.problem
    problem = problem.responses.at_first_level(problem)
    left, data = problem.assessed(plan.visibility.base).fit_db, problem.data
    return [
        f"The fitted model leaves {left:.3g} dB of the measured FRFs, "
        f"noise {data.noise_db:.2g} dB: something is missing, and hides what the test could show otherwise.",
        f"Find it first: dovetail run {study} --out DIR, then dovetail plan DIR/found.toml. For the test "
        f"alone: dovetail plan {study} --noise 1%",
        "",
    ]


def averages_line(before: Plan, after: Plan, now: int, more: int) -> str:
    """Return what more averages would show, of plans with the noise before and after them."""
    if after.coverage() <= before.coverage() and after.coverage("seen") <= before.coverage("seen"):
        return f"{more} averages more than {now} would show no more: the model's error limits this test."
    seen, _, named = (100 * after.coverage(what) for what in SHARES)
    return f"{more} averages more than {now}: {seen:.0f} % would be seen and {named:.0f} % named."


def averages_dict(plan: Plan, now: int, more: int) -> dict[str, Any]:
    """Return the same for JSON."""
    return {"now": now, "more": more, "coverage": {what: plan.coverage(what) for what in SHARES}}


def twin_lines(plan: Plan) -> list[str]:
    """Return pairs of which a test sees one, of a relevant size, but does not tell it from the other."""
    twins = plan.twins
    more = [f"and {len(twins) - MOST_TWINS} more"] * (len(twins) > MOST_TWINS)
    return [twin_text(*pair) for pair in twins[:MOST_TWINS]] + more


def twin_text(outlook: Outlook, rival: Effect) -> str:
    """Return a relevant effect and what the test cannot tell it from."""
    one, other = (words.effect_label(e.kind, e.where) for e in (outlook.relevant, rival))
    return f"{one}, {size_text(outlook.relevant)} = {other} (similar to {outlook.visible.alike:.3f})"


def blind_lines(plan: Plan) -> list[str]:
    """Return where relevant effects are not seen: the kinds seen nowhere, and the first places of others."""
    out, nowhere = [], []
    for kind, every in plan.kinds.items():
        there: dict[str, list[bool]] = {}
        for o in every:
            site = o.relevant.where
            place = words.place(site.thing if site.at else site)
            there.setdefault(place, []).append(o.seen)
        places = [
            place + (f" ({seen.count(False)} of {len(seen)} positions)" if len(seen) > 1 else "")
            for place, seen in there.items()
            if not all(seen)
        ]
        more = [f"and {len(places) - MOST_BLIND} more of {len(there)}"] * (len(places) > MOST_BLIND)
        if not any(o.seen for o in every):
            nowhere.append(kind)
        elif places:
            out.append(f"{kind}: {'; '.join([*places[:MOST_BLIND], *more])}")
    return [f"nowhere: {'; '.join(nowhere)}"] * bool(nowhere) + out


def plan_dict(plan: Plan) -> dict[str, Any]:
    """Return a plan for JSON."""
    relevant = {(o.relevant.name, o.visible.position): o for o in plan.relevant}

    def sized(e: Effect | None) -> dict[str, Any] | None:
        if e is None:
            return None
        return {p.name: {"value": float(p.value), "unit": p.unit} for p in e.parameters()}

    return {
        "measured": plan.is_measured,
        "explained": plan.is_explained,
        "noise_db": plan.visibility.problem.data.noise_db,
        "left_db": None if plan.is_measured else plan.visibility.discrepancy * DB_PER_NEPER,
        "relevant_sizes": {k: getattr(plan.sizes, k) for k in ("connections", "members", "cracks", "masses")},
        "coverage": {what: plan.coverage(what) for what in SHARES},
        "kinds": [{name: getattr(row, name) for name in KindRow.__slots__} for row in kind_rows(plan)],
        "effects": [
            {
                "kind": x.effect.kind,
                "where": x.effect.where,
                "relevant": sized(o.relevant if o else None),
                "shown": o.shown if o else None,
                "seen": sized(x.seen),
                "located": sized(x.located),
                "named": sized(x.named),
                "rival": {"kind": x.rival.kind, "where": x.rival.where},
                "alike": x.alike,
            }
            for x in plan.visibility.effects
            for o in [relevant.get((x.effect.name, x.position))]
        ],
    }


def chosen_lines(chosen: ChosenChannels) -> list[str]:
    """Return the chosen sensors and forces as tables of a study file, and the share by their number."""
    out = [f"# {'added sensors' if chosen.kept else 'chosen sensors and forces'}, for the study file"]
    for table, some in (
        ("sensors", chosen.sensors),
        ("excitations", () if chosen.kept else chosen.excitations),
    ):
        for s in some:
            at, along = (", ".join(f"{x:.6g}" for x in each) for each in (s.point, s.direction))
            out += [f"[[{table}]]", f'name = "{s.name}"', f"point = [{at}]", f"direction = [{along}]"]
    shares = ", ".join(f"{k}: {100 * share:.0f} %" for k, share in enumerate(chosen.curve, 1))
    before = f"{100 * chosen.without:.0f} % without; " if chosen.kept else ""
    return [
        *out,
        "",
        f"named by the first sensors as they were added: {before}{shares}",
        f"These shares are estimates from {N_LINES} lines, to choose by; the map of the test follows.",
        "",
    ]


def chosen_dict(chosen: ChosenChannels) -> dict[str, Any]:
    """Return chosen sensors and forces for JSON."""

    def each(some: Sequence[Sensor]) -> list[dict[str, Any]]:
        return [{"name": s.name, "at_m": s.point, "direction": s.direction} for s in some]

    return {
        "sensors": each(chosen.sensors),
        "excitations": each(chosen.excitations),
        "named_by_number": chosen.curve,
        **({"named_without": chosen.without} if chosen.kept else {}),
    }


def table_of_twins(found: Sequence[Separation]) -> Table:
    """Return what tells twins apart in a second test."""
    return Table.of(
        "second tests",
        Column("effect", [words.effect_label(s.effect.kind, s.effect.where) for s in found]),
        Column("its twin", [words.effect_label(s.rival.kind, s.rival.where) for s in found]),
        *columns_of(("alike", "with a second test"), np.array([s.alike for s in found]), show=".3f"),
        Column("after this change", [s.change for s in found]),
        Column("distinguished", ["yes" if s.ratio >= 1 else "no" for s in found]),
    )


def separation_dicts(found: Sequence[Separation]) -> list[dict[str, Any]]:
    """Return the same for JSON."""
    return [
        {
            "effect": {"kind": s.effect.kind, "where": s.effect.where},
            "rival": {"kind": s.rival.kind, "where": s.rival.where},
            "change": s.change,
            "alike": s.alike,
            "told_apart": s.ratio >= 1,
        }
        for s in found
    ]


def table_of_check(checked: Sequence[Trial | FailedTrial]) -> Table:
    """Return what drawn data showed beside what the map predicts, by multiples of the size that is named.

    Sets whose diagnosis failed do not count, see :func:`failure_lines`.
    """
    diagnosed = [t for t in checked if isinstance(t, Trial)]
    multiples = sorted({t.multiple for t in diagnosed})
    groups = [[t for t in diagnosed if t.multiple == multiple] for multiple in multiples]
    chances = np.array([np.mean([t.chances for t in some], axis=0) for some in groups]).reshape(-1, 2)
    return Table.of(
        "check",
        Column("size / named", multiples, show="g"),
        Column("n", [len(some) for some in groups]),
        *(
            column
            for k, what in enumerate(("seen", "named"))
            for column in (
                Column(f"{what}: map", chances[:, k], "%", PERCENT, 100, head=f"{what}: map"),
                Column(
                    "drawn (95 %)",
                    [_with_interval(sum(getattr(t, what) for t in some), len(some)) for some in groups],
                ),
            )
        ),
    )


def failure_lines(checked: Sequence[Trial | FailedTrial]) -> list[str]:
    """Return the sets of data whose diagnosis failed, with the reasons."""
    failures = [t for t in checked if isinstance(t, FailedTrial)]
    head = f"{len(failures)} of {len(checked)} sets could not be diagnosed:"
    return [head] * bool(failures) + [
        f"  {words.effect_label(t.effect.kind, t.effect.where)}, size {t.multiple:g}: {_reason(t)}"
        for t in failures
    ]


def _reason(trial: FailedTrial) -> str:
    return failed(None, trial.error).failure


def _with_interval(count: int, n: int) -> str:
    """Return a share with Wilson's interval of 95 % (J. Am. Stat. Assoc. 22, 1927, 209)."""
    z, p = 1.96, count / n
    middle, half = (p + z**2 / (2 * n)), z * np.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    low, high = (100 * each / (1 + z**2 / n) for each in (middle - half, middle + half))
    return f"{100 * p:.0f} % ({max(low, 0):.0f}-{min(high, 100):.0f})"


def check_dicts(checked: Sequence[Trial | FailedTrial]) -> dict[str, Any]:
    """Return drawn data and their diagnoses for JSON, and the sets whose diagnosis failed."""
    return {
        "check": [
            {
                **_drawn(t),
                "predicted": {"seen": t.chances[0], "named": t.chances[1]},
                "seen": t.seen,
                "named": t.named,
                "probability_of_nothing": t.nothing,
                "probability": t.right,
                "found": t.best,
            }
            for t in checked
            if isinstance(t, Trial)
        ],
        "check_failures": [_drawn(t) | {"reason": _reason(t)} for t in checked if isinstance(t, FailedTrial)],
    }


def _drawn(trial: Trial | FailedTrial) -> dict[str, Any]:
    effect = trial.effect
    values = {p.name: float(p.value) for p in effect.parameters()}
    return {"kind": effect.kind, "where": effect.where, "values": values, "size": trial.multiple}
