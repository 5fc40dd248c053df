"""Which poles are modes: fit them, reject those that are none, and search the residual for more."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from fem.array_types import Floats, Ints
from updating.correlation import mac
from updating.correlation.complexity import (
    mean_phase_deviation,
    modal_phase_collinearity,
    real_shapes,
)
from updating.modal.modal_fit import ModalFit, ModalFitData
from updating.modal.peaks import Candidate
from updating.modal.poles import (
    MATHEMATICAL_DAMPING,
    Track,
    channel_sizes,
    fit_orders,
    track_poles,
)
from updating.modal.refinement import fit_modes, local_gain, scatter_near

LARGEST_DEVIATION = 0.15
"""A mode's frequency and decay must be known within this part of its half-power half-width [-]."""

SIGNIFICANCE = 8.0
"""A mode must lower the weighted sum of squares by its number of parameters n and this times √(2n), which is
the standard deviation of the gain of n parameters by fitting noise [-]."""

TWIN_MAC, TWIN_DISTANCE = 0.9, 1.0
"""Of two modes with a higher MAC of shapes and of participations, |λ₁ - λ₂| being less than this times the
sum of their |Re λ|, one is dropped."""

ROUNDING = 1e-10
"""Noise is taken for at least this part of the root mean square of an output [-]."""

_FEW_STEPS, _MANY_STEPS = 8, 60
"""Steps of a fit while there may be poles that are no modes, which converge slowly or not at all, and of the
last."""


_PARTS, _PART, _PART_ORDER = 8, 128, 24
"""The residual of a fit is searched in this many parts of the band, of so many lines at least, up to this
order."""


@dataclass(frozen=True, slots=True)
class ModeStart:
    """Initial values of a pole, and the number of orders in which it was found."""

    pole: complex
    participation: tuple[complex, ...]
    n_orders: int
    tracked: complex
    """The pole before any fit: the same when it is tried again [rad/s]."""


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """Data to fit, and limits that a mode must keep."""

    data: ModalFitData
    estimate_noise: bool
    least_mpc: float
    largest_mpd: float
    turned: bool = False
    """Whether responses and forces have changed places."""


@dataclass(frozen=True, slots=True, eq=False)
class SelectionState:
    """Modes found so far, their fit, and the data with the weights of that fit."""

    data: ModalFitData
    starts: tuple[ModeStart, ...]
    fit: ModalFit | None
    rejected: tuple[tuple[ModeStart, str], ...]
    steps: tuple[str, ...]

    @property
    def fitted(self) -> ModalFit:
        """The last fit."""
        assert self.fit is not None
        return self.fit


def starts_of(tracks: Sequence[Track], data: ModalFitData) -> tuple[ModeStart, ...]:
    """Return initial poles, without the decay that a window added."""
    poles = (complex(min(t.pole.real + data.added_decay, 0.01 * t.pole.real), t.pole.imag) for t in tracks)
    return tuple(
        ModeStart(pole, tuple(t.participation.tolist()), len(t.members), pole)
        for pole, t in zip(poles, tracks, strict=True)
    )


def search_modes(task: Task, tracks: Sequence[Track], orders: Ints) -> tuple[SelectionState, int]:
    """Find modes among the tracks, then among these and the poles of the residual.

    Returns also the number of poles of the residual of the first fit.
    """
    first = starts_of(tracks, task.data)
    found = _settle(task, SelectionState(task.data, first, None, (), ()))
    of_residual = _overlooked(found, orders)
    # Rejected poles and those of the residual are tried again at most this often
    for _ in range(3):
        more = _worth_trying(found, (*first, *of_residual))
        if not more:
            break
        wider = _settle(task, replace(found, starts=found.starts + more))
        if len(wider.starts) <= len(found.starts):
            found = replace(found, rejected=wider.rejected, steps=wider.steps)
            break
        found = wider
    return found, len(of_residual)


def candidates(task: Task, found: SelectionState) -> tuple[Candidate, ...]:
    """Return all poles that were tried, each once, with the reason against it beside the modes found."""
    last = {start.tracked: (start, reason) for start, reason in found.rejected}
    fates = list(zip(found.starts, unreported(task, found.fitted), strict=True))
    modes = [start.pole for start, reason in fates if not reason]
    for start, _ in fates:
        last.pop(start.tracked, None)
    fates += [(start, _reason_beside(found, modes, start, reason)) for start, reason in last.values()]
    return tuple(
        Candidate(abs(s.pole) / (2 * np.pi), -s.pole.real / abs(s.pole), s.n_orders, not reason, reason)
        for s, reason in sorted(fates, key=lambda fate: abs(fate[0].pole))
    )


def _reason_beside(found: SelectionState, modes: Sequence[complex], start: ModeStart, reason: str) -> str:
    """Return why a rejected pole is no mode beside the modes found: its last fit may have had others."""
    if impossible := _impossible(found.data, start.pole):
        return impossible
    gain = local_gain(found.data, found.fitted, start.pole, np.array(start.participation))
    if gain < (needed := _needed(found.fitted)):
        return _insignificant(gain, needed)
    near = min(modes, key=lambda mode: _overlap(start.pole, mode), default=0j)
    if near and _overlap(start.pole, near) < TWIN_DISTANCE:
        return f"its half-power width overlaps that of the mode at {near.imag / (2 * np.pi):.4g} Hz"
    return reason


def _impossible(data: ModalFitData, pole: complex) -> str:
    """Return why a pole is no mode whatever the data, or an empty string."""
    low, high = data.frf.frequency[[0, -1]]
    if not low <= pole.imag / (2 * np.pi) <= high:
        return "outside the band"
    overdamped = -pole.real / abs(pole) > MATHEMATICAL_DAMPING
    return f"damping ratio above {MATHEMATICAL_DAMPING:g}" if overdamped else ""


def _needed(fit: ModalFit) -> float:
    """Return by how much a mode must lower the weighted sum of squares."""
    n = fit.n_parameters
    return n + SIGNIFICANCE * float(np.sqrt(2 * n))


def _insignificant(gain: float, needed: float) -> str:
    return f"insignificant: it lowers the weighted sum of squares by {gain:.3g}, below {needed:.3g}"


def _worth_trying(found: SelectionState, starts: Sequence[ModeStart]) -> tuple[ModeStart, ...]:
    """Return poles that lower the misfit of the present modes near them as much as a mode must.

    The shapes alone are free; lines within a few half-widths count, and each place is tried once. Shapes may
    tell a pole from a mode that it overlaps; one FRF does not.
    """
    data, fit = found.data, found.fitted
    needed = _needed(fit)
    gains = [local_gain(data, fit, start.pole, np.array(start.participation)) for start in starts]
    taken = [start.pole for start in found.starts] if fit.misfit[0].size == 1 else []
    out: list[ModeStart] = []
    for k in np.argsort(-np.array(gains), kind="stable"):
        start = starts[k]
        if gains[k] < needed:
            break
        if not any(_overlap(start.pole, other) < TWIN_DISTANCE for other in taken):
            out.append(start)
            taken.append(start.pole)
    return tuple(out)


def _overlooked(found: SelectionState, orders: Ints) -> tuple[ModeStart, ...]:
    """Return poles that persist in the residual of the fit, by parts of the band that overlap by half.

    In a part, fewer poles describe the residual, and strong modes elsewhere do not matter.
    """
    data = found.data.frf
    residual = replace(data, H=data.H - found.fitted.H)
    quiet = np.exp(-np.log(found.data.spread).mean(axis=1))
    size = max(_PART, data.n_freq // _PARTS)
    firsts = np.arange(0, max(data.n_freq - size // 2, 1), max(size // 2, 1))
    low_orders = orders[orders <= _PART_ORDER]
    out: list[ModeStart] = []
    for first in firsts:
        rows = np.arange(first, min(first + size, data.n_freq))
        part = fit_orders(residual.select(lines=rows), low_orders, found.data.scale, quiet[rows])
        for start in starts_of(track_poles(part), found.data):
            near = (abs(start.pole - other.pole) < -start.pole.real - other.pole.real for other in out)
            if not any(near):
                out.append(start)
    return tuple(out)


def _settle(task: Task, state: SelectionState) -> SelectionState:
    """Fit, reject the weakest of the poles that are no modes, and fit again until no pole is rejected.

    Poles share what they describe: without one of them, those that overlap it may be modes after all.
    """
    data, starts, rejected, steps = state.data, state.starts, list(state.rejected), list(state.steps)
    final = False
    while True:
        n_in = data.spread.shape[1]
        poles = np.array([s.pole for s in starts], dtype=complex)
        L = np.array([s.participation for s in starts], dtype=complex).reshape(-1, n_in)
        fit = fit_modes(data, poles, L, _MANY_STEPS if final else _FEW_STEPS)
        if task.estimate_noise:
            data = _reweighted(data, fit)
            fit = fit_modes(data, fit.poles, fit.participation, _MANY_STEPS if final else _FEW_STEPS)
        steps.append(
            f"{len(starts)} poles fitted in {fit.n_steps} steps"
            + ("" if fit.converged else ", not converged yet")
        )
        starts = tuple(
            ModeStart(complex(p), tuple(row.tolist()), s.n_orders, s.tracked)
            for p, row, s in zip(fit.poles, fit.participation, starts, strict=True)
        )
        reasons = _reasons(data, fit)
        if not any(reasons):
            if fit.converged or final:
                return SelectionState(data, starts, fit, tuple(rejected), tuple(steps))
            final = True
            continue
        weakest = _weakest(fit, reasons)
        rejected += [(s, reason) for s, reason, out in zip(starts, reasons, weakest, strict=True) if out]
        starts = tuple(s for s, out in zip(starts, weakest, strict=True) if not out)


def _weakest(fit: ModalFit, reasons: Sequence[str]) -> list[bool]:
    """Return whether a pole with a reason lowers the misfit by less than all such poles that overlap it."""
    bad = [k for k, reason in enumerate(reasons) if reason]
    return [
        bool(reason)
        and not any(
            (fit.energy[i], i) < (fit.energy[k], k) and _overlap(fit.poles[i], fit.poles[k]) < TWIN_DISTANCE
            for i in bad
        )
        for k, reason in enumerate(reasons)
    ]


def _overlap(one: complex, other: complex) -> float:
    """Return the distance of two poles over the sum of their half-power half-widths."""
    return abs(one - other) / -(one.real + other.real)


def _reweighted(data: ModalFitData, fit: ModalFit) -> ModalFitData:
    """Return data with weights from the residual of the fit: σ² = (s_o)² (a_ki² + ε_i² h_ki²).

    a is the level of noise over the lines, a running median over a sixteenth of them, which resonances do not
    raise. h_ki² is the mean over the outputs of |H_oi|²/s_o², and ε_i the part that errors in proportion to
    the response (gains, places, masses of sensors, lines too far apart for a peak) leave on the twentieth of
    the lines with the largest h.
    """
    error = np.abs(data.frf.H - fit.H) ** 2 / 2
    n_freq, _, n_in = error.shape
    level, unit = channel_sizes(data.frf.H)
    free = 1 - min(fit.poles.size / n_in + 1, 0.5 * n_freq) / n_freq
    scale = np.maximum(np.sqrt(np.median((error / unit**2).mean(axis=2), axis=0) / free), ROUNDING * level)
    over_lines = (error / scale[:, None] ** 2).mean(axis=1)
    width = max(n_freq // 16, 9) | 1
    along = np.maximum(_running_median(over_lines, width) / free, 1e-6 * unit**2)
    size = (np.abs(fit.H) ** 2 / scale[:, None] ** 2).mean(axis=1)
    top = np.argsort(-size, axis=0, kind="stable")[: max(n_freq // 20, 5)]
    size_top, along_top = (np.take_along_axis(x, top, axis=0) for x in (size.clip(min=1e-300), along))
    proportion = (np.take_along_axis(over_lines - along, top, axis=0) / size_top).mean(axis=0)
    chance = np.sqrt(((along_top / size_top) ** 2).sum(axis=0) / data.frf.H.shape[1]) / len(top)
    proportion = np.where(proportion > 3 * chance, proportion, 0.0)
    return replace(data, scale=scale, spread=np.sqrt(along + proportion * size))


def _running_median(values: Floats, width: int) -> Floats:
    """Return running medians of columns: each by itself, as SciPy is fast in one dimension alone."""
    return np.stack(
        [scipy.ndimage.median_filter(column, width, mode="nearest") for column in values.T], axis=1
    )


def _reasons(data: ModalFitData, fit: ModalFit) -> list[str]:
    """Return for each pole the reason to reject it, empty for a mode."""
    frequency = fit.poles.imag / (2 * np.pi)
    noise = scatter_near(fit, data)
    variance = fit.covariance.diagonal()  # below zero by rounding where the data say nothing of a pole
    deviation = np.sqrt(np.where(variance >= 0, variance, np.inf)).reshape(-1, 2).max(axis=1, initial=0.0)
    deviation *= noise
    width = data.added_decay - fit.poles.real  # as the data show it
    deviation *= -fit.poles.real / width
    needed = _needed(fit)
    gain = fit.energy / noise**2
    reasons = [_impossible(data, pole) for pole in fit.poles]
    for k in np.flatnonzero([not reason for reason in reasons]):
        if deviation[k] > LARGEST_DEVIATION:
            reasons[k] = (
                f"uncertain: the standard deviation of its frequency or decay is {deviation[k]:.2g} of its "
                f"half-power half-width, above {LARGEST_DEVIATION:g}"
            )
        elif gain[k] < needed:
            reasons[k] = _insignificant(gain[k], needed)
    alike = np.ones((fit.poles.size, fit.poles.size), dtype=bool)
    for vectors in (fit.shapes, fit.participation.T):
        real = real_shapes(vectors)
        alike &= np.maximum(mac(vectors, vectors), mac(real, real)) > TWIN_MAC
    apart = np.abs(fit.poles[:, None] - fit.poles) / (width[:, None] + width)
    twins = np.triu(alike & (apart < TWIN_DISTANCE), 1) & (max(data.frf.H.shape[1:]) > 1)
    for i, j in np.argwhere(twins):
        if not reasons[i] and not reasons[j]:
            weaker, other = (i, j) if gain[i] < gain[j] else (j, i)
            reasons[weaker] = f"a second copy of the mode at {frequency[other]:.4g} Hz"
    return reasons


def unreported(task: Task, fit: ModalFit) -> list[str]:
    """Return for each pole of the last fit why it is no mode, empty for modes.

    Its shape is too complex, or it overlaps a stronger pole of the only FRF. Such a pole stays in the fit: it
    describes the data, and without it other poles would be wrong.
    """
    shapes = fit.participation.T if task.turned else fit.shapes
    out = []
    for mpc, mpd in zip(modal_phase_collinearity(shapes), mean_phase_deviation(shapes), strict=True):
        words = []
        if mpc < task.least_mpc:
            words.append(f"modal phase collinearity {mpc:.2f}, below {task.least_mpc:g} (least_mpc)")
        if mpd > task.largest_mpd:
            words.append(f"mean phase deviation {mpd:.0f}°, above {task.largest_mpd:g}° (largest_mpd)")
        out.append(" and ".join(words))
    if fit.misfit[0].size == 1:  # without shapes, two overlapping modes look like a peak that is not linear
        for k in np.argsort(fit.energy, kind="stable"):
            for other in np.flatnonzero(fit.energy > fit.energy[k]):
                if not out[k] and _overlap(complex(fit.poles[k]), complex(fit.poles[other])) < TWIN_DISTANCE:
                    f = fit.poles[other].imag / (2 * np.pi)
                    out[k] = (
                        f"its half-power width overlaps that of the stronger mode at {f:.4g} Hz, and one FRF "
                        "does not tell them apart"
                    )
    return out
