"""Common content of pictures and interactive figures: places, models, bands, and names of candidates."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dovetail.report import words
from dovetail.result import FrfResult, RunResult, bands_of_lines, by_frfs
from fem.analysis.frf import FRF
from fem.model import Model
from fem.summary import counted
from updating.correlation import DB_PER_NEPER
from updating.diagnosis.findings import Ranked
from updating.diagnosis.localisation import Localisation
from updating.diagnosis.verdict import Verdict
from updating.measurement.measurement import Sensor
from viz.chart import Chart
from viz.curves import error_curves, frf_errors
from viz.interactive.solids import MarkedPlace

WITH_EFFECT, WITH_EFFECTS = "with the effect", "with the effects"
"""Names of the curves of the last step."""

LEAST_SHARE = 0.005
"""Shares of the misfit that are shown: those that do not round to 0 % [-]."""

FRF_ERROR = (
    "Relative error of all FRFs together over frequency; 0 dB is an error as large as the response itself."
)


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


def compared_models(result: FrfResult) -> Models:
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


def frf_error(result: FrfResult) -> Chart:
    """Return the figure of the error of all FRFs together over frequency."""
    d = result.diagnosis
    noise = np.abs(d.measured.H) * np.broadcast_to(d.problem.data.noise, d.measured.H.shape)
    smooth = max(1, d.measured.n_freq // 150)
    errors, floor = frf_errors(d.measured, compared_models(result).frfs, floor=noise, smooth=smooth)
    return error_curves(d.measured.frequency, errors, floor=floor, held_out=held_out_bands(result))


def rivals(result: FrfResult) -> dict[int, Ranked]:
    """Return the candidate that comes nearest to each finding, by the finding's number."""
    d = result.diagnosis
    out = {}
    for k, finding in enumerate(d.findings):
        against = finding.rival or next(iter(finding.alternatives), None)
        if against is not None and finding.decisive and k < len(d.rounds):
            out[k] = against
    return out


def fits_of(result: FrfResult, k: int, rival: Ranked) -> dict[str, FRF]:
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


def held_out_bands(result: FrfResult) -> list[tuple[float, float]]:
    """Return the bands of lines that no fit has seen [Hz]."""
    data = result.diagnosis.problem.data
    return list(bands_of_lines(data.frequency, data.held_out))


def test_of(result: RunResult[Verdict]) -> tuple[Sequence[Sensor], Sequence[Sensor]]:
    """Return the sensors and the forces of a test."""
    d = result.diagnosis
    if by_frfs(d):
        return d.problem.data.measurement.sensors, d.problem.data.measurement.excitations
    return (result.study.modes.sensors if result.study.modes else ()), ()


def test_in_words(result: RunResult[Verdict]) -> str:
    """Return how many sensors and forces a test has."""
    sensors, forces = test_of(result)
    many = [counted(len(some), what) for some, what in ((sensors, "sensor"), (forces, "excitation")) if some]
    return f" with {' and '.join(many)}" if many else ""


def marked_places(result: RunResult[Verdict]) -> list[MarkedPlace]:
    """Return the places of findings, departures of the form, faults and other explanations, one a point."""
    d, model = result.diagnosis, result.study.model
    out: dict[tuple[float, ...], list[tuple[str, str, str]]] = {}

    def mark(points: Iterable[NDArray[np.float64]], where: str, label: str, role: str) -> None:
        for xyz in points:
            here = out.setdefault(tuple(np.round(xyz, 9)), [])
            if not here or role != "candidate" or here[0][2] == role:
                here.append((where, label, role))

    images = [e for x in d.images for e in x.effects]
    for effect in (*d.found, *images):
        kind = "or " * (effect in images) + effect.kind.replace("_", " ")
        label = f"{kind}\n{words.place(effect.where.thing)}"
        mark(effect.locations(model)[:6], effect.where, label, "finding")
    for differs in d.departures:
        label = words.departure_label(differs)
        mark(differs.effect.locations(model)[:1], differs.where, label, "finding")
    for fault in d.every_fault:
        group = test_of(result)[0 if fault.kind.startswith("sensor") else 1]
        sensor = next(s for s in group if s.name == fault.sensor)
        word = f"gain {fault.value:.2f}" if fault.kind.endswith("gain") else words.FAULT_NAMES[fault.kind]
        mark([sensor.point], fault.sensor, f"{fault.sensor}: {word}", "fault")
    for effect in (e for x in d.credible for e in x.effects):
        mark(effect.locations(model)[:6], effect.where, effect.kind.replace("_", " "), "candidate")
    return [
        MarkedPlace(np.array(xyz), here[0][0], " and ".join(dict.fromkeys(t[1] for t in here)), here[0][2])
        for xyz, here in out.items()
    ]


def failing_members(where: Localisation) -> dict[str, float]:
    """Return members with their shares of the misfit [%]."""
    return {member: 100 * share for member, share in where.members.items()}


def failing_places(where: Localisation) -> list[tuple[MarkedPlace, float]]:
    """Return joints and supports with their shares of the misfit [%], the largest at each point.

    Without those whose share is less than any that is listed.
    """
    out: dict[tuple[float, ...], tuple[MarkedPlace, float]] = {}
    for name, share in where.places:
        if share < LEAST_SHARE:
            continue
        for xyz in where.points[name]:
            out.setdefault(tuple(np.round(xyz, 9)), (MarkedPlace(xyz, name, words.place(name)), 100 * share))
    return list(out.values())


def draw_misfit(
    model: Model,
    sensors: Sequence[Sensor],
    db: NDArray[np.float64],
    path: str | Path,
    where: Localisation | None = None,
    *,
    members: bool = True,
    most: float | None = None,
) -> Path:
    """Draw sensors by their errors (n,) from 0 to ``most`` [dB], and places by their shares, if known."""
    from viz.render import render_misfit

    known = np.isfinite(db)
    seen = [s for s, has in zip(sensors, known, strict=True) if has]
    places = failing_places(where) if where is not None else ()
    return render_misfit(
        model,
        [s.point for s in seen],
        [s.direction for s in seen],
        db[known],
        [s.name for s in seen],
        path,
        members=failing_members(where) if where is not None and members else None,
        joints=[(place.point, share) for place, share in places],
        label="error [dB]",
        members_label="share of the misfit [%]",
        limits=(0.0, float(np.nanmax(db)) if most is None else most),
    )


def misfit_steps(result: FrfResult) -> list[tuple[str, int, str]]:
    """Return name, step and description of the states whose misfit is shown."""
    steps = result.diagnosis.steps
    out = [("fitted", min(1, len(steps) - 1), "once the uncertain parameters are fitted")]
    if len(steps) > 2:
        out.append(("final", len(steps) - 1, "with the found effects"))
    return out


def misfit_limit(result: FrfResult) -> float:
    """Return one end of the colours for all misfit pictures, so that they can be compared [dB]."""
    return float(max(np.nanmax(result.comparisons[k].by_band()) for _, k, _ in misfit_steps(result)))


def error_bands(result: FrfResult) -> list[tuple[float, float]]:
    """Return the bands of the error maps, on integer hertz where these are fine enough [Hz]."""
    c = result.comparisons[0]
    edges = np.round(c.bands) if c.bands[-1] - c.bands[0] > 20 * len(c.bands) else c.bands
    return [(float(a), float(b)) for a, b in pairwise(edges)]


def pair_errors(result: FrfResult, step: int) -> NDArray[np.float64]:
    """Return the error of each FRF after a step, (n_out, n_in), NaN where nothing is compared [dB]."""
    square = result.comparisons[step].log_ratio.real ** 2
    known = np.isfinite(square)
    total, count = np.where(known, square, 0.0).sum(axis=0), known.sum(axis=0)
    mean = np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)
    return np.sqrt(mean) * DB_PER_NEPER


def telling_pairs(result: FrfResult, n: int = 6) -> list[tuple[str, str, str]]:
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
