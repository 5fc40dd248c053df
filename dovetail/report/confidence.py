"""How sure a verdict is, in sentences."""

import math
from collections.abc import Sequence

from dovetail.mode_result import ModeRunResult, mode_steps
from dovetail.report.probable import replaced_text
from dovetail.report.words import (
    digits_apart,
    effect_label,
    equal_fit_text,
    extension_text,
    ranked_label,
)
from dovetail.result import RunResult
from updating.diagnosis.diagnosis import Diagnosis
from updating.diagnosis.findings import Finding, Ranked, Step


def mode_confidence(result: ModeRunResult) -> list[str]:
    """Return how sure the verdict of a run on modes is, in a few sentences."""
    d = result.diagnosis
    m, (first, last) = d.modes, (list(mode_steps(d).values())[k] for k in (0, -1))
    before, after = (100 * m.errors(f, False) for f in (first, last))
    start = "calibrated" if d.baseline is not None else "nominal"
    out = [
        f"The {start} model's natural frequencies are {before:.2g} % off, those of the model reported "
        f"{after:.2g} %. Noise and mesh account for {100 * d.noise_limit:.2g} %."
    ]
    if m.held_out.any():
        first_error, last_error = (100 * m.errors(f, True) for f in (first, last))
        out.append(
            f"Modes that were not fitted are {first_error:.2g} % off before, {last_error:.2g} % with the "
            "reported model. "
            "A correct prediction is stronger evidence than a fit."
        )
    out += [f"{b.text[0].upper()}{b.text[1:]}. It counts in no error." for b in d.bad_readings]
    if len(d.credible) > 1:
        out.append(f"{len(d.credible)} explanations share a probability of 90 %: read them as a set.")
    return out


def ratio(before: float, after: float) -> float:
    """Return the factor by which an error fell; NaN where it is unknown."""
    return before / after if after > 0 and math.isfinite(before) else math.nan


def confidence(result: RunResult) -> list[str]:
    """Return how sure the verdict is, in a few sentences."""
    d = result.diagnosis
    steps: Sequence[Step] = d.steps
    base, last = steps[min(1, len(steps) - 1)], steps[-1]
    start = "calibrated" if d.baseline is not None else "nominal"
    if d.findings:
        out = [
            f"With {'them' if len(d.findings) > 1 else 'it'} the error falls from {base.fit_db:.2f} to "
            f"{last.fit_db:.2f} dB on the fitted lines (factor "
            f"{ratio(base.fit_db, last.fit_db):.1f}), and from "
            f"{base.held_out_db:.2f} to {last.held_out_db:.2f} dB on held-out lines (factor "
            f"{ratio(base.held_out_db, last.held_out_db):.1f})."
        ]
    else:
        out = [
            f"With the uncertain parameters fitted the error is {last.fit_db:.2f} dB on the lines of the "
            "fit and "
            f"{last.held_out_db:.2f} dB on held-out lines; the {start} model had "
            f"{steps[0].fit_db:.2f} dB and {steps[0].held_out_db:.2f} dB."
        ]
    for label, (first, *_, end) in result.held_out_channels.items():
        text = f"{first:.2f} dB {start}, {end:.2f} dB for the reported model"
        nothing = "none of them can be compared"
        out.append(f"FRFs of the {label}, which were not fitted: {text if math.isfinite(end) else nothing}.")
    out.append(
        f"The noise floor is {d.noise_floor_db:.2f} dB: {d.noise_db:.2f} dB noise of the measurement and "
        f"{d.discretisation_db:.2f} dB error of the mesh. The residual is "
        f"{ratio(last.fit_db, d.noise_floor_db):.1f} times that."
    )
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
    " The effect is nevertheless more probable, because each band has its own error level and parameters "
    "have priors."
)


def _rivals(d: Diagnosis, finding: Finding, ranked: Sequence[Ranked]) -> str:
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
        return f"{text} No other candidate was promising enough to be fitted to all lines."
    n = digits_apart(rival.fit_db, [accepted.fit_db])
    text += (
        f" The best of the other candidates, {ranked_label(rival)}, leaves {rival.fit_db:.{n}f} dB "
        f"instead of {accepted.fit_db:.{n}f} dB."
    )
    return text + (MORE_PROBABLE if rival.fit_db < accepted.fit_db and rival.score < accepted.score else "")
