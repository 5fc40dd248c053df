"""Whether measured FRFs have the time convention and the phase that their kind says, judged without a model.

Three properties of a passive structure are asked of each FRF, with e^{+iωt}:

- Its impulse response is zero before the impulse. With e^{-iωt} the FRF is conjugated, and the response runs
  backwards: its energy lies at negative times.
- The motion at a resonance is in quadrature with the force (receptance, accelerance) or in phase with it
  (mobility), and between resonances the other way round. A factor i, or another kind, exchanges the two.
- Where a force and a sensor have one place and direction, the structure takes power from the force: at a
  resonance Im receptance < 0, Re mobility > 0, Im accelerance > 0.

The impulse response of a band is the inverse transform of the FRF under a Hann window. Only times beyond the
window's own width count. Terms that are smooth over frequency (antiresonances, residual terms, delays far
shorter than the window) have decayed there; resonances still ring.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.analysis.frf import FRF
from fem.array_types import Bools, Complexes, Floats, Ints
from updating.measurement.measurement import Measurement, at_one_place

ANTICAUSAL_DEVIATIONS = 5.0
"""Logarithm of that ratio over its deviation in noise, beyond which the direction of time is certain [-]."""
QUADRATURE = 0.5
"""Mean cosine of twice the phase's angle beyond which a quarter turn is called certain: half of 1, the value
without damping [-]."""

LEAST_LINES = 32
_WINDOW_WIDTH = 4
"""Times below so many steps 1/bandwidth belong to the window: its main lobe ends at 2, the first side lobe
(-31 dB) at 3."""
LEAST_RINGING = 5e-3
"""Share of the energy beyond the window's times below which nothing rings: a polynomial of the fourth degree
over the band leaves up to 2.6e-3 [-]."""
_MOST_POINTS = 1 << 16


@dataclass(frozen=True, slots=True, eq=False)
class PhaseEvidence:
    """Deviations of each FRF from causality and from the right phase.

    Arrays have the shape (n_out, n_in), with NaN where nothing can be told.

    Attributes
    ----------
    outputs, inputs : tuple of str
    log_ratio : ndarray
        ln of the energy at positive over that at negative times: negative for e^{-iωt} [-].
    deviations : ndarray
        ``log_ratio`` in its standard deviations for noise.
    ringing : ndarray
        Mean cosine of twice the angle between the residues of the resonances and the axis that the kind says,
        weighted by their energy: 1 as it should be, -1 for a quarter turn [-].
    lines : ndarray
        The same of all lines against the axis off resonance, each line alike [-].
    sense : ndarray of complex
        Direction of the residues, weighted by energy, relative to that of a driven point: 1 there, 1 or -1
        elsewhere, ±i after a quarter turn [-].
    """

    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    log_ratio: Floats
    deviations: Floats
    ringing: Floats
    lines: Floats
    sense: Complexes

    @property
    def direction(self) -> Floats:
        """1 where an FRF is certainly causal, -1 where it surely runs backwards, 0 where nobody knows."""
        # Energy of one direction of time over that of the other beyond which the direction is certain [-]
        known = (np.abs(self.deviations) > ANTICAUSAL_DEVIATIONS) & (np.abs(self.log_ratio) > np.log(2.0))
        return np.where(known, np.sign(self.log_ratio), 0.0)

    @property
    def axis(self) -> Floats:
        """1 where the phase certainly fits the kind, -1 where a quarter turn off, 0 where nobody knows."""
        both = np.stack([self.ringing, self.lines])
        right, turned = (both > QUADRATURE).all(axis=0), (both < -QUADRATURE).all(axis=0)
        return np.where(turned, -1.0, np.where(right, 1.0, 0.0)) * (self.direction != 0)


@dataclass(frozen=True, slots=True)
class Misphased:
    """FRFs that share a fault of convention.

    Attributes
    ----------
    fault : str
        ``"conjugate"`` or ``"quarter turn"``.
    of : str
        ``"all"``, ``"sensor"``, ``"excitation"``, or ``"FRF"`` where neither explains it.
    names : tuple of str
        Sensors, excitations, or ``output/input``; empty for all.
    size : float
        For ``"conjugate"`` the median ratio of the energy at negative times to that at positive times, for
        ``"quarter turn"`` the median of the cosines, worst of both [-].
    turn : int
        Of a quarter turn: 1 for a factor i, -1 for -i, as driven points say; 0 where there is none.
    """

    fault: str
    of: str
    names: tuple[str, ...]
    size: float
    turn: int = 0


def phase_evidence(frf: FRF) -> PhaseEvidence:
    """Return how far each FRF is causal and in phase with its kind.

    Parameters
    ----------
    frf : FRF
        Lines need not be even; uneven ones are interpolated at their median distance.
    """
    shape = frf.H.shape[1:]
    log_ratio, deviations, ringing, lines = (np.full(shape, np.nan) for _ in range(4))
    sense = np.full(shape, complex("nan"))
    keep = frf.frequency > 0
    frequency = frf.frequency[keep]
    expected = np.where(frf.is_strain, 1.0, 1j**frf.kind.derivatives)
    if frequency.size >= LEAST_LINES:
        for j in range(shape[1]):  # one force at a time bounds the memory
            log_ratio[:, j], deviations[:, j], ringing[:, j], lines[:, j], sense[:, j] = _evidence(
                frequency, frf.H[keep, :, j], expected
            )
    return PhaseEvidence(frf.outputs, frf.inputs, log_ratio, deviations, ringing, lines, sense)


def _evidence(frequency: Floats, H: Complexes, expected: Complexes) -> tuple[NDArray[Any], ...]:
    """Return the five arrays of :class:`PhaseEvidence` for the responses to one force, (n_out,) each.

    ``expected`` (n_out,) is the phase of a response to a slow force.
    """
    size = np.abs(H)
    unit = H / (np.where(size > 0, size, 1.0) * expected)
    lines = (unit.real**2 - unit.imag**2).mean(axis=0)
    H = _even(frequency, _levelled(frequency, H))
    n = len(H)
    window = np.hanning(n + 2)[1:-1]
    h = np.fft.ifft(H * window[:, None], axis=0)
    after, before = h[_WINDOW_WIDTH : n // 2], h[: n - n // 2 : -1][_WINDOW_WIDTH - 1 :]
    # Noise of a few high lines beats between them and may favour either direction.
    (late, n_late), (early, n_early), (_, n_high) = _energy(after), _energy(before), _energy(H)
    rings = late + early > LEAST_RINGING * (np.abs(h) ** 2).sum(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        log_ratio = np.where(rings, np.log(late) - np.log(early), np.nan)
        deviations = log_ratio / np.sqrt(1 / n_late + 1 / n_early + 1 / n_high)
    backwards = log_ratio < 0
    # The conjugate of an FRF has the impulse response of the conjugate, run backwards.
    ringing = np.where(backwards, before.conj(), after)
    noise = np.sqrt(np.where(backwards, late, early))
    quality, sense = _residues(ringing, noise, n, -1j * expected)
    return log_ratio, deviations, quality, lines, sense


def _levelled(frequency: Floats, H: Complexes) -> Complexes:
    """Return FRFs times the power of frequency that spreads the energy of each over the most lines.

    A smooth positive factor moves neither times nor phases; without it the first resonance of a receptance
    hides all others.
    """
    trials = np.stack([H * ((frequency / frequency[-1]) ** p)[:, None] for p in (-2, -1, 0, 1, 2)])
    energy = np.abs(trials) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        spread = np.nan_to_num(energy.sum(axis=1) ** 2 / (energy**2).sum(axis=1))
    return np.take_along_axis(trials, spread.argmax(axis=0)[None, None], axis=0)[0]


def _even(frequency: Floats, H: Complexes) -> Complexes:
    """Return FRFs at even lines.

    Linear interpolation weighs times by an even function: it favours neither direction.
    """
    step = np.diff(frequency)
    typical = float(np.median(step))
    if np.abs(step - typical).max() < 1e-2 * typical:
        return H
    span = float(frequency[-1] - frequency[0])
    n = int(np.clip(round(span / typical) + 1, LEAST_LINES, _MOST_POINTS))
    grid = np.linspace(frequency[0], frequency[-1], n)
    columns = [np.interp(grid, frequency, c.real) + 1j * np.interp(grid, frequency, c.imag) for c in H.T]
    return np.stack(columns, axis=1)


def _energy(h: Complexes) -> tuple[Floats, Floats]:
    """Return the energy of each column, and how many samples carry it."""
    e = np.abs(h) ** 2
    total, square = e.sum(axis=0), (e**2).sum(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return total, np.where(square > 0, total**2 / square, np.nan)


def _residues(ringing: Complexes, noise: Floats, n: int, expected: Complexes) -> tuple[Floats, Complexes]:
    """Return the mean cosine of twice the residues' angle from the expected one, and their mean direction.

    A resonance that begins to ring at the gate has its peak in the transform of later times, with the phase
    of its residue; the residual terms of other resonances are smooth, and the gate has removed them.
    """
    columns = ringing.shape[1]
    quality, sense = np.full(columns, np.nan), np.full(columns, complex("nan"))
    for k in range(columns):
        gated = np.zeros(2 * n, dtype=complex)
        gated[_WINDOW_WIDTH : _WINDOW_WIDTH + len(ringing)] = ringing[:, k]
        g = np.fft.fft(gated) / expected[k]
        size = np.abs(g)
        peak = np.flatnonzero((size[1:-1] >= size[:-2]) & (size[1:-1] > size[2:])) + 1
        # Peaks of the ringing below so many times the level at negative times are noise
        peak = peak[size[peak] > 5.0 * noise[k]]
        peak = np.array(_apart(size, peak), dtype=int)
        if peak.size:
            energy = float((size[peak] ** 2).sum())
            quality[k] = float((g[peak] ** 2).real.sum()) / energy
            sense[k] = complex((g[peak] * size[peak]).sum()) / energy
    return quality, sense


def _apart(size: Floats, peaks: Ints) -> list[int]:
    """Return the highest peaks with a valley of half their height between them: noise makes lesser ones."""
    out: list[int] = []
    for p in peaks[np.argsort(-size[peaks])]:
        if all(size[min(p, q) : max(p, q)].min() < 0.5 * size[p] for q in out):
            out.append(int(p))
        if len(out) == 10:
            break
    return out


def driven_points(measurement: Measurement, tolerance: float) -> list[tuple[int, int, float]]:
    """Return row, column and sign of each FRF whose force and sensor have one place and one axis.

    Parameters
    ----------
    measurement : Measurement
    tolerance : float
        Largest distance [m].
    """
    return [
        (i, j, sign)
        for j, e in enumerate(measurement.excitations)
        for i, s in enumerate(measurement.sensors)
        if (sign := at_one_place(s, e, tolerance))
    ]


def misphased(evidence: PhaseEvidence, driven: Sequence[tuple[int, int, float]] = ()) -> list[Misphased]:
    """Return which FRFs are certainly of another convention: all, those of sensors or forces, or some."""
    ratio = np.exp(-evidence.log_ratio)
    cosine = np.fmax(evidence.ringing, evidence.lines)
    out = []
    for fault, state, size in (
        ("conjugate", evidence.direction, ratio),
        ("quarter turn", evidence.axis, cosine),
    ):
        for of, names, where in _explained(state, evidence):
            found = Misphased(fault, of, names, float(np.median(size[where])))
            if fault == "quarter turn":
                signs = [np.sign((s * evidence.sense[i, j]).imag) for i, j, s in driven if where[i, j]]
                found = replace(found, turn=int(np.sign(sum(signs))))
            out.append(found)
    return out


def _explained(state: Floats, evidence: PhaseEvidence) -> list[tuple[str, tuple[str, ...], Bools]]:
    """Return groups that contain the FRFs of state -1 and none of state 1: name, members, which."""
    bad, good = state < 0, state > 0
    if not bad.any():
        return []
    if not good.any():
        return [("all", (), bad)]
    for of, names, axis in (("sensor", evidence.outputs, 1), ("excitation", evidence.inputs, 0)):
        bad_members = [k for k in range(len(names)) if bad.take(k, axis=1 - axis).any()]
        if not any(good.take(k, axis=1 - axis).any() for k in bad_members):
            return [(of, tuple(names[k] for k in bad_members), bad)]
    names = tuple(f"{evidence.outputs[i]}/{evidence.inputs[j]}" for i, j in np.argwhere(bad))
    return [("FRF", names, bad)]
