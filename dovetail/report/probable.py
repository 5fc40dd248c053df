"""How probable the effects found are, alone and as parts of larger answers: one way to say it for all."""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace

from dovetail.report.words import FAULT_NAMES, as_stiffness, effect_label
from fem.model import Effect, covers
from fem.summary import percent
from updating.diagnosis.evidence.diagnosis import AS_READ, UNKNOWN
from updating.diagnosis.verdict import UNEXPLAINED, UNFINISHED, Explanation, Posterior, Verdict
from updating.inference.belief import RARE, TWIN_NATS


def included(posterior: Posterior, names: Collection[str]) -> float:
    """Return the probability of all hypotheses that have one of these effects, with or without others [-]."""
    return float(sum(p for known, p in posterior if set(names) & set(known)))


def exactly(posterior: Posterior, names: Collection[str]) -> float | None:
    """Return the probability of these effects and no other, at all positions; None if it is unknown [-]."""
    each = [float(p) for known, p in posterior if set(known) == set(names)]
    return sum(each) if each else None


def without(posterior: Posterior, names: Collection[str]) -> tuple[Collection[str], float] | None:
    """Return the most probable hypothesis without any of these effects, if a twin may be as improbable."""
    others = [(known, p) for known, p in posterior if not set(names) & set(known)]
    least = math.exp(-TWIN_NATS) * max((p for _, p in posterior), default=0.0)
    best = max(others, key=lambda other: other[1], default=((), 0.0))
    return best if best[1] > least else None


def probability_text(d: Verdict) -> str:
    """Return how probable the verdict is: that all effects found are missing, alone or with others.

    Empty where the search gives no probabilities, or was ended before it could.
    """
    exact = None if d.verdict == UNFINISHED else exactly(d.posterior, [e.name for e in d.found])
    if exact is None:
        return ""
    if d.verdict == UNEXPLAINED:
        outside = percent(included(d.posterior, [UNKNOWN]))
        return f"Probability of a cause that the library does not have: {outside}"
    if not d.found:
        return f"Probability among all hypotheses: {percent(exact)}"
    answers = [d.found, *(x.effects for x in d.images)]
    every = sum(float(p) for known, p in d.posterior if any(_has_all(d, known, a) for a in answers))
    which = "this effect" if len(d.found) == 1 else "these effects"
    which += " or of a mirror image" * bool(d.images)
    return f"Probability of {which}, alone or with others: {percent(every)}"


def _has_all(d: Verdict, known: Collection[str], effects: Iterable[Effect]) -> bool:
    """Whether a hypothesis has all of these effects, or what does the same and more."""
    return all(set(with_extensions(e, d.candidates)) & set(known) for e in effects)


def probability_details(d: Verdict) -> str:
    """Return further probabilities: of exactly this answer, of its parts, and of a more probable one."""
    if not probability_text(d) or d.verdict == UNEXPLAINED:
        return ""
    parts: list[str] = []
    exact = exactly(d.posterior, [e.name for e in d.found]) or 0.0
    if len(d.found) > 1:
        shares = ((e, included(d.posterior, with_extensions(e, d.candidates))) for e in d.found)
        each = [f"{effect_label(e.kind, e.where)} {percent(p)}" for e, p in shares]
        parts.append(f"alone or with others: {', '.join(each)}")
    if d.found:
        this = "this effect alone" if len(d.found) == 1 else "exactly these effects"
        parts.append(f"{this}: {percent(exact)}")
        here = next(p for known, p in d.posterior if set(known) == {e.name for e in d.found})
        parts += [f"{this}, at this position: {percent(here)}"] if here < exact else []
    parts += [besides] if (besides := _besides_text(d)) else []
    text = "; ".join(parts)
    return ". ".join(filter(None, (text[:1].upper() + text[1:], vague_text(d))))


def _besides_text(d: Verdict) -> str:
    """Return which hypothesis is more probable than the one that is reported, and whether by much."""
    found, (names, p) = {e.name for e in d.found}, d.posterior[0]
    if found == set(names):
        return ""
    if found and found < set(names):
        other = f"with {label_of(d, [n for n in names if n not in found])} in addition"
    else:
        other = f"{label_of(d, names)}, and nothing else"
    text = f"{other}: {percent(p)}"
    close = p < math.exp(TWIN_NATS) * (exactly(d.posterior, found) or 0.0)
    return f"{text}, too close to decide, so the simpler answer is reported" if close else text


def reported(d: Verdict) -> int:
    """Return the number of the hypothesis that is reported, in the order of their probabilities."""
    found = {e.name for e in d.found}
    return next((k for k, (names, _) in enumerate(_merged(d)) if set(names) == found), 0)


def _merged(d: Verdict) -> list[tuple[tuple[str, ...], float]]:
    """Return the hypotheses with their probabilities, those of the same effects at all positions as one."""
    out: dict[tuple[str, ...], float] = {}
    for names, p in d.posterior:
        out[tuple(names)] = out.get(tuple(names), 0.0) + float(p)
    return list(out.items())


def vague_text(d: Verdict) -> str:
    """Return which values found are smaller than their standard deviations; empty if none is."""
    vague = [
        f"{effect_label(f.effect.kind, f.effect.where)} is not known in size: the standard deviation of its "
        f"{as_stiffness(p).name.replace('_', ' ')} exceeds the value"
        for f in d.findings
        for p, nominal in zip(f.parameters, f.effect.parameters(), strict=True)
        if not nominal.position and p.std > abs(p.value)
    ]
    return "; ".join(text[0].upper() + text[1:] for text in vague)


def with_extensions(effect: Effect, candidates: Iterable[Effect]) -> list[str]:
    """Return the names of an effect and of all candidates that do the same and more."""
    return [effect.name, *(e.name for e in candidates if covers(e, effect))]


def replaced_text(d: Verdict, subject: str, effect: Effect) -> str:
    """Return which answer could replace an effect that has no twin alone, or that none could."""
    other = without(d.posterior, with_extensions(effect, d.candidates))
    if other is None:
        return f"{subject} has no twin: no answer without it is nearly as probable."
    label, p = label_of(d, other[0]), percent(other[1])
    return f"{subject} may be replaced by another answer: {label}, and nothing else ({p})."


def hypotheses(d: Verdict) -> list[tuple[str, float]]:
    """Return the hypotheses in words with their probabilities; none where the search gives none."""
    known = _labels(d)
    return without_rare([(_labelled(known, names), p) for names, p in _merged(d)], reported(d))


def most_probable(d: Verdict, number: int) -> tuple[list[Explanation], list[Explanation]]:
    """Return the most probable explanations, one for an effect at all its positions, and the others."""
    first: dict[tuple[str, ...], Explanation] = {}
    for e in d.explanations:  # the most probable position comes first
        names = tuple(sorted(x.name for x in e.effects)) if e.known else (UNKNOWN,)
        known = first.get(names)
        first[names] = e if known is None else replace(known, probability=known.probability + e.probability)
    every = sorted(first.values(), key=lambda e: -e.probability)
    return every[:number], every[number:]


def without_rare(known: Sequence[tuple[str, float]], kept: int = 0) -> list[tuple[str, float]]:
    """Return hypotheses, those that have less than 1 % each and follow the others as one.

    Parameters
    ----------
    known : sequence of (label, probability)
    kept : int
        One that stays alone, with all before it.
    """
    last = max([kept, *(k for k, (_, p) in enumerate(known) if p >= RARE)])
    rare = known[last + 1 :]
    if len(rare) < 2:
        return list(known)
    return [*known[: last + 1], (f"{len(rare)} others, together", sum(p for _, p in rare))]


def label_of(d: Verdict, names: Iterable[str]) -> str:
    """Return a hypothesis in words."""
    return _labelled(_labels(d), names)


def _labelled(known: Mapping[str, str], names: Iterable[str]) -> str:
    return " and ".join(known.get(n, n) for n in names) or "nothing missing"


def _labels(d: Verdict) -> dict[str, str]:
    """Return the words of each part of a hypothesis by its name."""
    fitted = [e for x in reversed(d.explanations) for e in x.effects]  # the most probable position counts
    effects = [*d.candidates, *fitted, *d.found]
    known = {e.name: effect_label(e.kind, e.where) for e in effects}
    known[UNKNOWN] = "something that the library does not have"
    if d.searched is not None:
        faults = {f.name: f"{f.sensor}: {FAULT_NAMES[f.kind]}" for f in d.searched.proposed_faults}
        known |= faults | {f"{AS_READ}{name}": f"not {text}" for name, text in faults.items()}
    return known
