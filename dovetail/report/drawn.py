"""Common content of pictures and interactive figures: places, models, bands, and names of candidates."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dovetail.report import words
from dovetail.result import RunResult, bands_of_lines
from fem.analysis.frf import FRF
from updating.correlation import DB_PER_NEPER
from updating.diagnosis.diagnosis import Diagnosis
from updating.diagnosis.findings import Ranked
from updating.diagnosis.localisation import Localisation
from viz.interactive.solids import MarkedPlace

WITH_EFFECT, WITH_EFFECTS = "with the effect", "with the effects"
"""Names of the curves of the last step."""

STAIRCASE = (
    "Root mean square error of the FRF amplitudes after each step, on fitted and on held-out lines. The "
    "noise floor is that of measurement noise and mesh error."
)

FRF_ERROR = (
    "Relative error of all FRFs together over frequency; 0 dB is an error as large as the response itself."
)

_NAMES = re.compile(r" \([^()]* … [^()]*\)")


@dataclass(frozen=True, slots=True, eq=False)
class Models:
    """FRFs of the steps that are compared with the measurement.

    Attributes
    ----------
    frfs : mapping of str to FRF
        By label, in their order.
    steps : tuple of int
        The diagnosis' step of each.
    deviations : mapping of str to ndarray
        Standard deviation of ln|H| of the last one, where it is known [-].
    """

    frfs: Mapping[str, FRF]
    steps: tuple[int, ...]
    deviations: Mapping[str, NDArray[np.float64]]


def staircase_alt(d: Diagnosis) -> str:
    """Return the staircase in words."""
    steps = "; ".join(f"{s.label} {s.fit_db:.2f} dB" for s in d.steps)
    return f"Error after each step: {steps}; noise floor {d.noise_floor_db:.2f} dB."


def error_steps(d: Diagnosis) -> list[tuple[str, float, float | None]]:
    """Return label and errors of each step, on the lines of the fit and on those held out [dB]."""
    held_out = (s.held_out_db if np.isfinite(s.held_out_db) else None for s in d.steps)
    return [(words.step_label(s.label), s.fit_db, h) for s, h in zip(d.steps, held_out, strict=True)]


def compared_models(result: RunResult) -> Models:
    """Return the FRFs of the nominal model, of the fitted one, and of that with the found effects."""
    d = result.diagnosis
    last = len(d.steps) - 1
    steps = (0, 1, last) if last > 1 else tuple(range(last + 1))
    names = {0: "nominal", 1: "fitted"} if d.baseline is None else {0: "calibrated", 1: "damping fitted"}
    what = WITH_EFFECTS if len(d.findings) > 1 else WITH_EFFECT
    labels = [names.get(k, what) for k in steps]
    spread = d.deviation(last)
    return Models(
        {label: d.frf(k) for label, k in zip(labels, steps, strict=True)},
        steps,
        {} if spread is None else {labels[-1]: spread},
    )


def noise_of(d: Diagnosis) -> NDArray[np.float64]:
    """Return the standard deviation of the measured FRFs by noise, (n_freq, n_out, n_in)."""
    return np.abs(d.measured.H) * np.broadcast_to(d.problem.data.noise, d.measured.H.shape)


def smoothing(frf: FRF) -> int:
    """Return the number of lines over which errors of FRFs are smoothed."""
    return max(1, frf.n_freq // 150)


def rivals(result: RunResult) -> dict[int, Ranked]:
    """Return the candidate that comes nearest to each finding, by the finding's number."""
    d = result.diagnosis
    out = {}
    for k, finding in enumerate(d.findings):
        against = finding.rival or next(iter(finding.alternatives), None)
        if against is not None and finding.decisive and k < len(d.rounds):
            out[k] = against
    return out


def fits_of(result: RunResult, k: int, rival: Ranked) -> dict[str, FRF]:
    """Return the FRFs with a finding and with its rival, each fitted, by label.

    They are those that the errors of :attr:`Finding.decisive` are of. An effect to which others were added
    has the name of its step: the curve of the last step has all of them.
    """
    d = result.diagnosis
    ranked, name = d.rounds[k], d.findings[k].effect.name
    best = next((r for r in ranked if r.name == name), ranked[0])
    step = next((s for s in d.steps if s.result is best.result), d.steps[-1])
    with_it = WITH_EFFECT if step is d.steps[-1] else words.step_label(step.label)
    return {with_it: d.problem.frf(best.result), words.ranked_label(rival): d.problem.frf(rival.result)}


def held_out_bands(result: RunResult) -> list[tuple[float, float]]:
    """Return the bands of lines that no fit has seen [Hz]."""
    data = result.diagnosis.problem.data
    return list(bands_of_lines(data.frequency, data.held_out))


def marked_places(result: RunResult) -> list[MarkedPlace]:
    """Return the places of findings, of departures of the form and of faults, one for each point."""
    d, m = result.diagnosis, result.diagnosis.problem.data.measurement
    out: dict[tuple[float, ...], list[tuple[str, str, str]]] = {}
    for finding in d.findings:
        effect = finding.effect
        for xyz in effect.locations(result.study.model)[:6]:
            label = effect.kind.replace("_", " ")
            out.setdefault(tuple(np.round(xyz, 9)), []).append((effect.where, label, "finding"))
    for differs in d.departures:
        for xyz in differs.effect.locations(result.study.model)[:1]:
            form = (differs.where, words.departure_label(differs), "finding")
            out.setdefault(tuple(np.round(xyz, 9)), []).append(form)
    for fault in d.every_fault:
        group = m.sensors if fault.kind.startswith("sensor") else m.excitations
        sensor = next(s for s in group if s.name == fault.sensor)
        word = f"gain {fault.value:.2f}" if fault.kind.endswith("gain") else words.FAULT_NAMES[fault.kind]
        label = f"{fault.sensor}: {word}"
        out.setdefault(tuple(np.round(sensor.point, 9)), []).append((fault.sensor, label, "fault"))
    return [
        MarkedPlace(np.array(xyz), here[0][0], " and ".join(dict.fromkeys(t[1] for t in here)), here[0][2])
        for xyz, here in out.items()
    ]


def failing_places(where: Localisation) -> list[tuple[MarkedPlace, float]]:
    """Return joints and supports with their shares of the misfit, the largest at each point."""
    out: dict[tuple[float, ...], tuple[MarkedPlace, float]] = {}
    for name, share in where.places:
        for xyz in where.points[name]:
            out.setdefault(tuple(np.round(xyz, 9)), (MarkedPlace(xyz, name, words.place(name)), share))
    return list(out.values())


def misfit_steps(result: RunResult) -> list[tuple[str, int, str]]:
    """Return name, step and description of the states whose misfit is shown."""
    steps = result.diagnosis.steps
    out = [("fitted", min(1, len(steps) - 1), "once the uncertain parameters are fitted")]
    if len(steps) > 2:
        out.append(("final", len(steps) - 1, "with the found effects"))
    return out


def misfit_limit(result: RunResult) -> float:
    """Return one end of the colours for all misfit pictures, so that they can be compared [dB]."""
    return float(max(np.nanmax(result.comparisons[k].by_band()) for _, k, _ in misfit_steps(result)))


def error_bands(result: RunResult) -> list[tuple[float, float]]:
    """Return the bands of the error maps, on integer hertz where these are fine enough [Hz]."""
    c = result.comparisons[0]
    edges = np.round(c.bands) if c.bands[-1] - c.bands[0] > 20 * len(c.bands) else c.bands
    return [(float(a), float(b)) for a, b in pairwise(edges)]


def candidate_labels(ranked: Sequence[Ranked]) -> list[str]:
    """Return candidates in words, each of them once."""
    seen: dict[str, int] = {}
    out = []
    for r in ranked:
        label = _NAMES.sub("", words.ranked_label(r))
        seen[label] = seen.get(label, 0) + 1
        out.append(label if seen[label] == 1 else f"{label} ({seen[label]})")
    return out


def ranking_bars(result: RunResult, k: int) -> tuple[list[str], list[float], float, list[int], int | None]:
    """Return a round's labels, residual levels and the level before [dB], twins, and the one accepted."""
    d = result.diagnosis
    ranked, found = d.rounds[k], d.findings[k] if k < len(d.findings) else None
    names = [r.name for r in ranked]
    others = {t.name for t in found.twins} if found else set()
    twins = [n for n, name in enumerate(names) if name in others]
    accepted = names.index(found.effect.name) if found and found.effect.name in names else None
    before = d.steps[min(k + 1, len(d.steps) - 1)].level * DB_PER_NEPER
    return candidate_labels(ranked), [r.level * DB_PER_NEPER for r in ranked], before, twins, accepted


def ranking_caption(result: RunResult, k: int) -> str:
    """Return the caption of a round's candidates."""
    labels, *_, accepted = ranking_bars(result, k)
    outcome = "none of them" if accepted is None else labels[accepted]
    return (
        f"Round {k + 1} of the search: residual level after fitting each candidate together with the "
        f"uncertain parameters; {outcome} is accepted. They are ranked by their evidence, which also "
        "counts the parameters of a law."
    )


def pair_errors(result: RunResult, step: int) -> NDArray[np.float64]:
    """Return the error of each FRF after a step, (n_out, n_in), NaN where nothing is compared [dB]."""
    square = result.comparisons[step].log_ratio.real ** 2
    known = np.isfinite(square)
    total, count = np.where(known, square, 0.0).sum(axis=0), known.sum(axis=0)
    mean = np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)
    return np.sqrt(mean) * DB_PER_NEPER


def telling_pairs(result: RunResult, n: int = 6) -> list[tuple[str, str, str]]:
    """Return FRFs worth a look and why: most gained, drive points, largest final error."""
    n_steps = len(result.comparisons)
    last = result.comparisons[n_steps - 1]
    before, after = (pair_errors(result, k) for k in (1 if n_steps > 2 else 0, n_steps - 1))
    pairs = [
        (o, i) for o in range(len(last.outputs)) for i in range(len(last.inputs)) if np.isfinite(after[o, i])
    ]
    gained = sorted(pairs, key=lambda p: after[p] - before[p])
    by_input = {p[1]: p for p in reversed(gained)}
    drive = [p for p in pairs if last.outputs[p[0]] == last.inputs[p[1]]]
    worst = sorted(pairs, key=lambda p: -after[p])
    chosen: dict[tuple[int, int], str] = {}
    for which, why in (
        ([*sorted(by_input.values(), key=gained.index), *gained][: n - 3], "most gained"),
        (drive[:2], "drive point"),
        (worst[:1], "largest final error"),
        (gained, ""),
    ):
        for p in which:
            if len(chosen) < n and p not in chosen:
                chosen[p] = f"{why}, " if why else ""
    return [
        (last.outputs[o], last.inputs[i], f"{why}{before[o, i]:.1f} → {after[o, i]:.1f} dB")
        for (o, i), why in chosen.items()
    ]
