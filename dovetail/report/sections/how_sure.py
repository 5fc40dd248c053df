"""How sure a verdict is, in sentences."""

import math
from collections.abc import Sequence

from dovetail.report import words
from dovetail.report.blocks import Heading, Items, ReportSection, Text
from dovetail.report.probable import replaced_text
from dovetail.report.sections import staircase
from dovetail.report.shown import Shown
from dovetail.report.words import (
    digits_apart,
    effect_label,
    equal_fit_text,
    extension_text,
    no_rival_text,
    ranked_label,
)
from dovetail.result import RunResult, by_any, by_frfs
from updating.diagnosis.findings import Finding, Ranked
from updating.diagnosis.verdict import UNEXPLAINED, Verdict

applies = by_any


def ratio(before: float, after: float) -> float:
    """Return the factor by which an error fell; NaN where it is unknown."""
    return before / after if after > 0 and math.isfinite(before) else math.nan


def confidence(result: RunResult[Verdict]) -> list[str]:
    """Return how sure the verdict is, in a few sentences."""
    d = result.diagnosis
    n, unit, rows = staircase.digits(d), d.stairs.unit, d.stairs.rows
    (_, *base), (_, *first), (_, *last) = (
        next(r for r in reversed(rows) if not r[0].endswith(" added")),
        rows[0],
        rows[-1],
    )
    start = "calibrated" if d.baseline is not None else "nominal"
    parts = [
        (k, f"{unit} on the {head}") for k, head in enumerate(staircase.HEADS[unit]) if math.isfinite(last[k])
    ]
    if d.findings:
        each = (
            f"from {base[k]:.{n}f} to {last[k]:.{n}f} {on} (factor {ratio(base[k], last[k]):.1f})"
            for k, on in parts
        )
        out = [f"With {'them' if len(d.findings) > 1 else 'it'} the error falls {', and '.join(each)}."]
    else:
        now, before = (" and ".join(f"{row[k]:.{n}f} {on}" for k, on in parts) for row in (last, first))
        out = [f"With the uncertain parameters fitted the error is {now}; the {start} model had {before}."]
    for label, (before_db, *_, end) in result.held_out_channels.items():
        text = f"{before_db:.2f} dB {start}, {end:.2f} dB for the reported model"
        nothing = "none of them can be compared"
        out.append(f"FRFs of the {label}, which were not fitted: {text if math.isfinite(end) else nothing}.")
    floor = f"The noise floor is {d.stairs.floor:.{n}f} {unit}"
    if by_frfs(d):
        floor += f": {d.noise_db:.2f} dB noise of the measurement and "
        floor += f"{d.discretisation_db:.2f} dB error of the mesh"
    out.append(f"{floor}. The residual is {ratio(last[0], d.stairs.floor):.1f} times that.")
    out += [f"{b.text[0].upper()}{b.text[1:]}. It counts in no error." for b in d.bad_readings]
    if words.is_open(d):
        out.append(f"{len(d.credible)} explanations share a probability of 90 %: read them as a set.")
    for finding, ranked in zip(d.findings, d.rounds, strict=False):
        out.append(_rivals(d, finding, ranked))
    best = best_of(d.rounds)
    if best and not d.findings:
        out.append(
            f"The best of {len(d.rounds[-1])} candidates, {ranked_label(best)}, would leave "
            f"{best.fit_db:.2f} dB, on "
            f"held-out lines {best.held_out_db:.2f} dB: too little to call it an effect."
        )
    return out


def best_of(rounds: Sequence[Sequence[Ranked]]) -> Ranked | None:
    """Return the best candidate of the last round."""
    return rounds[-1][0] if rounds and rounds[-1] else None


MORE_PROBABLE = (
    " The effect is nevertheless more probable: its evidence also counts the phase and the priors, each band "
    "with its own error level."
)


def _rivals(d: Verdict, finding: Finding, ranked: Sequence[Ranked]) -> str:
    label = effect_label(finding.effect.kind, finding.effect.where)
    subject, it = (label[:1].upper() + label[1:], label) if len(d.findings) > 1 else ("It", "it")
    others = finding.alternatives
    if others:
        listed = "; ".join(map(ranked_label, others[:4])) + (" …" if len(others) > 4 else "")
        text = f"These data cannot distinguish {it} from {listed}."
    elif equal := equal_fit_text(d, finding, ranked):
        text = f"{equal[0].upper()}{equal[1:]}."
    else:
        text = replaced_text(d, subject, finding.effect)
    text += "".join(f" The data are {extension_text(finding, t)}." for t in finding.extensions)
    rival = finding.rival
    accepted = next((r for r in ranked if r.name == finding.effect.name), None)
    if accepted is None:
        return text
    if rival is None:
        return f"{text} {no_rival_text(d, finding, ranked)}"
    n = digits_apart(rival.fit_db, [accepted.fit_db])
    text += (
        f" The best of the other candidates, {ranked_label(rival)}, leaves {rival.fit_db:.{n}f} dB "
        f"instead of {accepted.fit_db:.{n}f} dB."
    )
    return text + (MORE_PROBABLE if rival.fit_db < accepted.fit_db and rival.score < accepted.score else "")


def page(result: RunResult[Verdict], shown: Shown) -> ReportSection:
    """Return how sure the verdict is, the errors of the steps, and advice."""
    d = result.diagnosis
    if not by_frfs(d):
        text = (
            "Errors are root mean squares of ln(f computed / f measured). Hypotheses are ranked by their "
            "evidence; held-out modes do not count."
        )
        return ReportSection("How sure", [Items(confidence(result)), staircase.block(d), Text(text)])
    text = "Errors are root mean squares of 20 lg |H computed / H measured|."
    if d.posterior:
        text += (
            " Hypotheses are ranked by their evidence, which "
            f"{'also counts the phase, ' if d.problem.data.phase else ''}gives outliers less weight, "
            "corrects small errors of single modes, and has a separate error level in each of up to four "
            "bands. Held-out lines do not count."
        )
    advice = [Heading("Advice"), Items(words.advice(result))] if d.verdict == UNEXPLAINED else []
    blocks = [Items(confidence(result)), staircase.block(d, result.held_out_channels), Text(text), *advice]
    return ReportSection("How sure", blocks)
