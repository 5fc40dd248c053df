"""Signs of a test's forces and responses: the fewest reversed channels that explain the phases.

The sign of an FRF is the product s_i t_j of the signs of its response and its force. To reverse all forces
and all responses does not change the data. So a reversed force, and all of its responses reversed in its
place, have the same likelihood: the prior odds against a fault of each channel decide.

Between resonances, phases agree with the model's or are opposite. In n independent parts of the band the
share p agrees, and m = 2 p - 1 is the mean cosine of the phase difference. The log odds of the stated sign
against the opposite one are those of n Bernoulli trials, n m ln((1 + m) / (1 - m)). All FRFs of a channel
share the errors of the model, so the odds of a channel's sign are those of its mean cosine.

Where a force and a response share a place and an axis, no model is needed: the structure takes power from the
force (:mod:`updating.quality.phase`), and the sense of the residues stands for m.
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np

from fem.analysis.frf import FRF
from fem.array_types import Bools, Floats
from updating.inference.belief import TWIN_NATS
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.measurement.measurement import Measurement
from updating.quality.corrections import Fault, log_odds_against
from updating.quality.phase import driven_points, phase_evidence

WORDS = {"sensor": "response", "excitation": "force"}
"""Channels as sentences call them."""

LARGEST_COSINE = 0.95
"""Mean cosines count as no more than this: no model has the right phase in more of the band [-]."""


_SAME_PLACE = 1e-6
"""Distance of a force from a sensor at its place, relative to the mesh's size."""


@dataclass(frozen=True, slots=True)
class Reversal:
    """The reversed channels of a test as faults, and a sentence on each."""

    faults: tuple[Fault, ...] = ()
    words: tuple[str, ...] = ()


def reversed_channels(
    problem: FitProblem,
    result: FitResult,
    without: Collection[str] = (),
    without_forces: Collection[str] = (),
) -> Reversal:
    """Return the channels whose signs are most probably opposite to the stated ones; none without phases.

    Parameters
    ----------
    problem : FitProblem
    result : FitResult
        The model that measured phases are compared with.
    without, without_forces : collection of str
        Names of responses and of forces that tell nothing.
    """
    m = problem.data.measurement
    if not problem.data.phase:
        return Reversal()
    cosine = np.cos(problem.log_ratio(result).imag)
    cosine[:, [s.name in without for s in m.sensors]] = np.nan
    cosine[:, :, [e.name in without_forces for e in m.excitations]] = np.nan
    tolerance = _SAME_PLACE * problem.reduced.model.mesh.size
    return reversal(m, problem.measured, cosine, problem.n_modes, tolerance)


def reversal(
    measurement: Measurement, measured: FRF, cosine: Floats, n_modes: float, tolerance: float
) -> Reversal:
    """Return the reversed channels by the cosines of phase differences to a model.

    Parameters
    ----------
    measurement : Measurement
        Where channels are.
    measured : FRF
        Its FRFs, corrected for faults that are known.
    cosine : ndarray (n_freq, n_out, n_in)
        Of the difference of measured and computed phase; NaN where nothing counts.
    n_modes : float
        In the band.
    tolerance : float
        Largest distance of a response from a force at its place [m].
    """
    seen = np.isfinite(cosine)
    n = np.maximum(seen.sum(axis=0), 1)
    total = np.where(seen, cosine, 0.0).sum(axis=0)
    # Independent parts of a band that has fewer modes [-]
    parts = max(3, n_modes)
    driven = dict(_driven(measurement, measured, tolerance))
    power = np.zeros(n.shape)
    for at, sense in driven.items():
        power[at] = log_odds(sense, parts)
    sides = (("sensor", measurement.sensors), ("excitation", measurement.excitations))
    prices = log_odds_against(len(measurement.sensors)), log_odds_against(len(measurement.excitations))
    signs = likeliest_signs(total / n, np.asarray(seen.any(axis=0)), power, parts, prices)
    instead = _instead(measurement, signs, prices, bool(driven))
    faults, words = [], []
    for axis, ((of, channels), sign) in enumerate(zip(sides, signs, strict=True)):
        partners = signs[1 - axis]
        opposite = np.moveaxis(cosine, 1 + axis, 1) * partners < 0  # NaN is not
        for k in np.flatnonzero(sign < 0).tolist():
            name = channels[k].name
            faults.append(Fault(f"{of}_sign", name, -1.0, 0.0, other=instead))
            share = opposite[:, k].sum() / max(seen.take(k, 1 + axis).sum(), 1)
            text = (
                f"{WORDS[of]} '{name}' looks reversed: its phase is opposite to the model's at "
                f"{100 * share:.0f} % of its lines"
            )
            given = [at for at, sense in driven.items() if at[axis] == k and sense < 0]
            if given:
                there = sides[1 - axis][1][given[0][1 - axis]].name
                text += f", and the structure gives power to the force where '{name}' and '{there}' are"
            text += "; check the sign of its direction"
            words.append(f"{text} (or of {instead} instead: the data are the same)" if instead else text)
    return Reversal(tuple(faults), tuple(words))


def _instead(
    measurement: Measurement, signs: tuple[Floats, Floats], prices: tuple[float, float], driven: bool
) -> str:
    """Return the channels that explain the same data if they are reversed instead; empty where none may be.

    All responses, or all forces, reversed are one mistake where the model alone tells the sign. By power they
    are as many as there are channels.
    """
    odds = sum(price * sign.sum() for price, sign in zip(prices, signs, strict=True))
    others = [
        [c.name for c, sign in zip(channels, side, strict=True) if sign > 0]
        for channels, side in zip((measurement.sensors, measurement.excitations), signs, strict=True)
    ]
    if all(others) or (driven and odds > TWIN_NATS):
        return ""
    names, word = (others[0], "responses") if others[0] else (others[1], "forces")
    return names[0] if len(names) == 1 else f"all {len(names)} {word}"


def log_odds(cosine: Floats | float, parts: float) -> Floats:
    """Return the log odds of the stated against the opposite sign by mean cosines [nats]."""
    m = np.clip(cosine, -LARGEST_COSINE, LARGEST_COSINE)
    return parts * m * 2 * np.arctanh(np.abs(m))


def likeliest_signs(
    cosine: Floats, seen: Bools, power: Floats, parts: float, prices: tuple[float, float]
) -> tuple[Floats, Floats]:
    """Return the most probable signs of responses (n_out,) and forces (n_in,), 1 or -1.

    The sum of ½ s_i t_j e_ij, less the price of each reversed channel, is maximised over one side after the
    other, from several signs of the forces; e are the log odds of each FRF. A channel whose mean cosine does
    not pay its price keeps its sign.

    Parameters
    ----------
    cosine : ndarray (n_out, n_in)
        Mean cosine of phase differences to the model.
    seen : ndarray of bool (n_out, n_in)
        FRFs that count.
    power : ndarray (n_out, n_in)
        Log odds of the sign by power, 0 for FRFs that are not of a driven point [nats].
    parts : float
        Independent parts of the band.
    prices : (float, float)
        Log odds against a reversed response, and against a reversed force [nats].
    """
    m = np.where(seen, cosine, 0.0)
    e = log_odds(m, parts) + power
    price_s, price_t = np.full(len(m), prices[0]), np.full(m.shape[1], prices[1])
    while True:
        s, t = max(
            (_alternately(e, t, price_s, price_t) for t in _starts(e)),
            key=lambda st: _score(e, *st, price_s, price_t),
        )
        kept = True
        for sign, price, axis in ((s, price_s, 1), (t, price_t, 0)):
            other = s[:, None] * t * seen
            mean = (other * m).sum(axis) / np.maximum(seen.sum(axis), 1)
            gain = log_odds(mean, parts) + (other * power).sum(axis)
            weak = (sign < 0) & (gain < price)
            price[weak] = np.inf
            kept &= not weak.any()
        if kept:
            return s, t


def _driven(
    measurement: Measurement, measured: FRF, tolerance: float
) -> Iterator[tuple[tuple[int, int], float]]:
    """Yield row and column of each driven point whose phases are right, and its sense, 1 as it should be."""
    for i, j, sign in driven_points(measurement, tolerance):
        e = phase_evidence(measured.select([measured.outputs[i]], [measured.inputs[j]]))
        if e.axis[0, 0] > 0:
            yield (i, j), sign * float(e.sense[0, 0].real)


def _starts(e: Floats) -> Iterator[Floats]:
    one = np.ones(e.shape[1])
    yield one
    yield -one
    for j in range(len(one)):
        yield np.where(np.arange(len(one)) == j, -1.0, 1.0)
    direction = np.linalg.svd(e, full_matrices=False)[2][0]
    for t in (direction, -direction):
        yield np.where(t < 0, -1.0, 1.0)


def _alternately(e: Floats, t: Floats, price_s: Floats, price_t: Floats) -> tuple[Floats, Floats]:
    s = np.ones(len(e))
    # Rounds of alternate maximisation over the signs of responses and of forces
    for _ in range(50):
        s = np.where(-(e @ t) > price_s, -1.0, 1.0)
        new = np.where(-(s @ e) > price_t, -1.0, 1.0)
        if (new == t).all():
            break
        t = new
    return s, t


def _score(e: Floats, s: Floats, t: Floats, price_s: Floats, price_t: Floats) -> float:
    return float(0.5 * s @ e @ t - price_s[s < 0].sum() - price_t[t < 0].sum())
