"""FRFs from time data: averages over blocks, coherence and standard deviations.

forces, responses ─ estimate_frf → EstimatedFRF
a record with several hits ─ split_hits → blocks;  blocks of each place ─ estimate_roving → EstimatedFRF
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from fem.analysis.frf import FRF, FRFKind
from fem.array_types import Complexes, Floats, Ints
from fem.summary import fields_summary

ESTIMATORS = ("H1", "H2", "Hv")
"""Estimators of ``estimate_frf``."""

WINDOWS = ("hann", "rectangular", "flattop", "exponential")
"""Windows of the blocks; the exponential one is for free decays after a hit."""

DOUBLE_HIT = 0.1
"""A force that rises again to this part of its peak, after it fell below half of that, is a second hit
[-]."""


class EstimationError(ValueError):
    """Time data from which FRFs cannot be estimated; the message gives the found and allowed values."""


@dataclass(frozen=True, slots=True, eq=False)
class EstimatedFRF:
    """FRFs, with their quality from the averages.

    Attributes
    ----------
    frf : FRF
        All lines but 0 Hz, up to half the sample rate or within the band.
    coherence : ndarray (n_freq, n_out, n_in)
        Ordinary coherence of each response with each force [-].
    multiple_coherence : ndarray (n_freq, n_out)
        Part of a response's power that all forces together explain [-]. Of a roving hammer, whose forces act
        one at a time, the least of the ordinary ones.
    std : ndarray (n_freq, n_out, n_in)
        Standard deviation of the real and of the imaginary part [unit of the FRF]; NaN if it cannot be known
        from so few averages.
    n_averages : ndarray of int (n_in,)
        Blocks that were used for each force.
    effective_averages : ndarray (n_in,)
        Independent blocks that are worth as much: overlapping blocks share samples [-].
    added_decay : float
        Increase by an exponential window of the decay -Re λ of all poles [1/s];
        ``identify_modes(…, added_decay=…)`` takes it off again.
    messages : tuple of str
        Omissions, with the reason.
    """

    frf: FRF
    coherence: Floats
    multiple_coherence: Floats
    std: Floats
    n_averages: Ints
    effective_averages: Floats
    added_decay: float = 0.0
    messages: tuple[str, ...] = ()

    __repr__ = fields_summary


def estimate_frf(
    force: ArrayLike,
    response: ArrayLike,
    sample_rate: float,
    *,
    block: int | None = None,
    overlap: float = 0.5,
    window: str = "hann",
    end_value: float = 0.01,
    force_length: float | None = None,
    estimator: str = "H1",
    noise_ratio: float | None = None,
    kind: FRFKind | str = FRFKind.ACCELERANCE,
    outputs: Sequence[str] | None = None,
    inputs: Sequence[str] | None = None,
    band: tuple[float, float] | None = None,
    full_scale: float | None = None,
    hits: bool | None = None,
) -> EstimatedFRF:
    """Estimate FRFs from forces and responses over time.

    With averages G_xx of x xᴴ, G_yx of y xᴴ and G_yy of y yᴴ over blocks, x being forces and y responses,

    - H1 = G_yx G_xx⁻¹ is right with noise in the responses; noise in one force divides it by
      1 + S_noise/S_force;
    - H2 = G_yy G_xy⁻¹ is right with noise in the forces; noise in one response multiplies it by
      1 + S_noise/S_response;
    - Hv has the least sum of squares of noise in forces and one response, from the eigenvector of the lowest
      eigenvalue of their spectral matrix (total least squares; Rocklin, Crowley and Vold, IMAC III, 1985).
      Forces and responses are first divided by the root of their power at each line, so that with one force
      |Hv|² = |H1 H2|; or by the noise of each, if ``noise_ratio`` is given, which makes it right.

    The standard deviation is √((1 - γ²)/(2 n γ²)) |H| with the coherence γ² and n independent blocks (Bendat
    and Piersol, *Random Data*, 4th ed., ch. 9), for several forces √((1 - γ²_multiple) G_yy (G_xx⁻¹)_jj /
    2n). Blocks that overlap count by Welch's rule (*IEEE Trans. Audio* 15, 1967, 70). It is that of noise in
    the responses and of H1; errors that repeat (leakage, calibration) are not in it.

    Parameters
    ----------
    force, response : array_like (n_samples,), (n_samples, n_channels) or (n_blocks, n_samples, n_channels)
        Time data; the last form has blocks that are cut already, such as hits of a hammer.
    sample_rate : float
        [Hz].
    block : int, optional
        Samples of a block; an eighth of the record unless given.
    overlap : float
        Part of a block that the next one shares, 0 to below 1 [-].
    window : str
        ``"hann"``, ``"rectangular"``, ``"flattop"`` or ``"exponential"``. The last is for blocks that begin
        with a hit; force and response are multiplied by it alike, so that poles move by ``added_decay``
        exactly.
    end_value : float
        Of the exponential window at the end of the block [-].
    force_length : float, optional
        Forces are set to zero this long after they first exceed a twentieth of their peak [s].
    estimator : str
        ``"H1"``, ``"H2"`` or ``"Hv"``.
    noise_ratio : float, optional
        Standard deviation of the noise in the responses over that in the forces, for ``"Hv"``
        [unit of response over N].
    kind : FRFKind or str
        Quantity of the responses.
    outputs, inputs : sequence of str, optional
        Labels of the channels.
    band : (float, float), optional
        Lines to keep [Hz].
    full_scale : float, optional
        Samples of this size are overloads. Unless given, several equal samples in a row at the largest value
        are. Overloads lead to a warning, and with blocks that are cut already to leaving such a block out.
    hits : bool, optional
        Whether blocks that are cut already begin with a hit, so that those with a double hit are left out;
        with the exponential window unless given.

    Raises
    ------
    EstimationError
        For data that do not fit one another, missing samples, forces without power at a line, too few blocks.

    Warns
    -----
    UserWarning
        For overloads and double hits.
    """
    _check_choice("estimator", estimator, ESTIMATORS)
    _check_choice("window", window, WINDOWS)
    x, y = _blocks("force", force), _blocks("response", response)
    if x.shape[:2] != y.shape[:2]:
        msg = f"forces are {x.shape[:2]} (blocks, samples) and responses {y.shape[:2]}; they must be the same"
        raise EstimationError(msg)
    if not (np.isfinite(sample_rate) and sample_rate > 0):
        msg = f"the sample rate is {sample_rate}; a positive number is needed [Hz]"
        raise EstimationError(msg)
    cut = x.shape[0] > 1 or np.ndim(force) == 3
    messages: tuple[str, ...] = ()
    if cut:
        good, messages = _good_hits(x, y, full_scale, window == "exponential" if hits is None else hits)
        x, y = x[good], y[good]
        step, n = x.shape[1], x.shape[1]
    else:
        overloads = _overloads(x[0], y[0], full_scale)
        messages = (f"overload in {', '.join(overloads)}",) if overloads else ()
        n = x.shape[1] // 8 if block is None else int(block)
        if not 0 <= overlap < 1 or not 8 <= n <= x.shape[1]:
            msg = (
                f"blocks of {n} samples that share {overlap:g} of them are asked for; the record has "
                f"{x.shape[1]}, 8 are needed, and the overlap lies from 0 to below 1"
            )
            raise EstimationError(msg)
        step = max(1, round(n * (1 - overlap)))
        first = np.arange(0, x.shape[1] - n + 1, step)
        x, y = (np.stack([z[0, k : k + n] for k in first]) for z in (x, y))
    for message in messages:
        warnings.warn(message, stacklevel=2)
    if force_length is not None:
        x = _force_window(x, force_length * sample_rate)
    decay = -np.log(end_value) * sample_rate / n if window == "exponential" else 0.0
    shape = _window(window, n, decay / sample_rate)
    X, Y = (np.fft.rfft(z * shape[:, None], axis=1)[:, 1:].transpose(1, 2, 0) for z in (x, y))
    frequency: Floats = np.asarray(np.fft.rfftfreq(n, 1 / sample_rate)[1:], dtype=float)
    if band is not None:
        keep = (frequency >= band[0]) & (frequency <= band[1])
        if not keep.any():
            msg = (
                f"no line lies in the band {band[0]:g} to {band[1]:g} Hz; lines are {frequency[0]:g} Hz apart"
            )
            raise EstimationError(msg)
        frequency, X, Y = frequency[keep], X[keep], Y[keep]
    effective = _effective(shape, len(x), step)
    H, ordinary, multiple, std = _estimate(X, Y, frequency, effective, estimator, noise_ratio)
    frf = FRF.from_arrays(frequency, H, kind, outputs, inputs)
    n_in = x.shape[2]
    return EstimatedFRF(
        frf,
        ordinary,
        multiple,
        std,
        np.full(n_in, len(x)),
        np.full(n_in, effective),
        float(decay),
        messages,
    )


def estimate_roving(
    hits: Mapping[str, tuple[ArrayLike, ArrayLike]],
    sample_rate: float,
    *,
    outputs: Sequence[str],
    window: str = "exponential",
    end_value: float = 0.01,
    force_length: float | None = None,
    estimator: str = "H1",
    kind: FRFKind | str = FRFKind.ACCELERANCE,
    band: tuple[float, float] | None = None,
    full_scale: float | None = None,
) -> EstimatedFRF:
    """Estimate FRFs of a roving hammer with fixed sensors.

    Parameters
    ----------
    hits : mapping of str to (force, response)
        By the label of the place: forces (n_hits, n_samples) and responses (n_hits, n_samples) or
        (n_hits, n_samples, n_out), each hit near the beginning of its block. Numbers of hits may differ.
    sample_rate : float
        [Hz].
    outputs : sequence of str
        Labels of the sensors.
    window, end_value, force_length, estimator, kind, band, full_scale
        As for :func:`estimate_frf`.

    Returns
    -------
    EstimatedFRF
        With a column for each place, in the order given.

    Raises
    ------
    EstimationError
        As :func:`estimate_frf`, naming the place; or if blocks differ in length between places.
    """
    if not hits:
        msg = "there is no place of a hit"
        raise EstimationError(msg)
    parts: list[EstimatedFRF] = []
    for place, (force, response) in hits.items():
        f, y = np.array(force, dtype=float, ndmin=2), np.array(response, dtype=float, ndmin=2)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)
                part = estimate_frf(
                    f[:, :, None],
                    y if y.ndim == 3 else y[:, :, None],
                    sample_rate,
                    window=window,
                    end_value=end_value,
                    force_length=force_length,
                    estimator=estimator,
                    kind=kind,
                    outputs=outputs,
                    inputs=[place],
                    band=band,
                    full_scale=full_scale,
                )
        except ValueError as reason:
            msg = f"place '{place}': {reason}"
            raise EstimationError(msg) from reason
        part = replace(part, messages=tuple(f"place '{place}': {message}" for message in part.messages))
        for message in part.messages:
            warnings.warn(message, stacklevel=2)
        if parts and not np.array_equal(part.frf.frequency, parts[0].frf.frequency):
            msg = (
                f"place '{place}' has {f.shape[1]} samples a hit, the first place another number; "
                "lines would differ"
            )
            raise EstimationError(msg)
        parts.append(part)
    first = parts[0]
    H = np.concatenate([p.frf.H for p in parts], axis=2)
    coherence = np.concatenate([p.coherence for p in parts], axis=2)
    std = np.concatenate([p.std for p in parts], axis=2)
    return EstimatedFRF(
        FRF.from_arrays(first.frf.frequency, H, kind, outputs, tuple(hits)),
        coherence,
        coherence.min(axis=2),
        std,
        np.concatenate([p.n_averages for p in parts]),
        np.concatenate([p.effective_averages for p in parts]),
        first.added_decay,
        tuple(message for p in parts for message in p.messages),
    )


def split_hits(
    force: ArrayLike,
    response: ArrayLike,
    sample_rate: float,
    length: float,
    *,
    threshold: float = 0.2,
    before: float = 0.005,
) -> tuple[Floats, Floats]:
    """Cut a record with several hits into blocks that begin shortly before each of them.

    Parameters
    ----------
    force : array_like (n_samples,)
        [N].
    response : array_like (n_samples,) or (n_samples, n_out)
    sample_rate : float
        [Hz].
    length : float
        Of a block [s].
    threshold : float
        Part of the largest force at which a hit begins [-].
    before : float
        Time that is kept before that [s].

    Returns
    -------
    force : ndarray (n_hits, n_samples_of_a_block, 1)
    response : ndarray (n_hits, n_samples_of_a_block, n_out)

    Raises
    ------
    EstimationError
        If there is no hit with a whole block after it.
    """
    x, y = _blocks("force", force)[0], _blocks("response", response)[0]
    if x.shape[1] != 1 or len(x) != len(y):
        msg = (
            f"the force has shape {x.shape}, the responses {y.shape}; one force of as many samples is needed"
        )
        raise EstimationError(msg)
    n, lead = round(length * sample_rate), round(before * sample_rate)
    above = np.flatnonzero(np.abs(x[:, 0]) >= threshold * np.abs(x[:, 0]).max())
    starts: list[int] = []
    for k in above:
        if not starts or k >= starts[-1] + n:
            starts.append(max(int(k) - lead, 0))
    starts = [k for k in starts if k + n <= len(x)]
    if not starts or np.abs(x).max() == 0:
        msg = f"no hit has {n} samples after it; the record has {len(x)}"
        raise EstimationError(msg)
    return np.stack([x[k : k + n] for k in starts]), np.stack([y[k : k + n] for k in starts])


# Data -------------------------------------------------------------------------------------------------------


def level_at_end(blocks: ArrayLike) -> Floats:
    """Return the level of responses at the end of blocks over their peaks, the most of all, (n_out,) [-].

    It is the amplitude of a sine with the mean square of the last twentieth. A response that has not died
    away leaks into its FRF.

    Parameters
    ----------
    blocks : array_like (n_blocks, n_samples, n_out)
        As of :func:`split_hits`.
    """
    x = np.asarray(blocks, dtype=float)
    peak = np.abs(x).max(axis=1)
    last = np.sqrt(2 * (x[:, -max(1, x.shape[1] // 20) :] ** 2).mean(axis=1))
    return np.divide(last, peak, out=np.zeros(peak.shape), where=peak > 0).max(axis=0)


def _check_choice(word: str, value: str, allowed: tuple[str, ...]) -> None:
    if value not in allowed:
        msg = f"the {word} is '{value}'; allowed are {', '.join(allowed)}"
        raise EstimationError(msg)


def _blocks(word: str, data: ArrayLike) -> Floats:
    """Return time data as (n_blocks, n_samples, n_channels)."""
    x = np.array(data, dtype=float)
    x = x[None, :, None] if x.ndim == 1 else x[None] if x.ndim == 2 else x
    if x.ndim != 3 or not x.size:
        msg = (
            f"the {word} has shape {np.shape(data)}; (n_samples,), (n_samples, n_channels) or blocks "
            "of these are expected"
        )
        raise EstimationError(msg)
    if x.shape[1] < x.shape[2]:
        msg = f"the {word} has {x.shape[1]} samples of {x.shape[2]} channels; samples come before channels"
        raise EstimationError(msg)
    bad = np.argwhere(~np.isfinite(x))
    if bad.size:
        b, k, c = (int(v) for v in bad[0])
        msg = (
            f"{len(bad)} sample(s) of the {word} are missing or not finite, the first in block {b + 1}, "
            f"sample {k}, channel {c + 1}; samples must follow evenly, without gaps"
        )
        raise EstimationError(msg)
    return x


def _good_hits(x: Floats, y: Floats, full_scale: float | None, hits: bool) -> tuple[Ints, tuple[str, ...]]:
    """Return the blocks to use, and the defects of the others."""
    good, messages = [], []
    for k in range(len(x)):
        wrong = [f"overload in {channel}" for channel in _overloads(x[k], y[k], full_scale)]
        if hits and any(_hit_twice(x[k, :, j]) for j in range(x.shape[2])):
            wrong.append("double hit")
        if wrong:
            messages.append(f"hit {k + 1} is left out: {', '.join(wrong)}")
        else:
            good.append(k)
    if not good:
        msg = f"no block is left: {'; '.join(messages)}"
        raise EstimationError(msg)
    return np.array(good), tuple(messages)


def _overloads(x: Floats, y: Floats, full_scale: float | None) -> list[str]:
    out = []
    for word, z in (("force", x), ("response", y)):
        for c in range(z.shape[1]):
            size = np.abs(z[:, c])
            if full_scale is None:
                top = (size == size.max()) & (size > 0)
                edges = np.flatnonzero(np.diff(np.concatenate([[False], top, [False]])))
                # Number of equal samples in a row, at a channel's largest value, that mean an overload
                over = bool((np.diff(edges)[::2] >= 4).any())
            else:
                over = bool((size >= 0.999 * full_scale).any())
            if over:
                out.append(f"{word} {c + 1}")
    return out


def _hit_twice(force: Floats) -> bool:
    """Return whether a force rises to a part of its peak, falls to half of that part, and rises again."""
    size = np.abs(force)
    high, low = size >= DOUBLE_HIT * size.max(), size < DOUBLE_HIT * size.max() / 2
    armed, pulses = True, 0
    for up, down in zip(high.tolist(), low.tolist(), strict=True):
        if up and armed:
            pulses, armed = pulses + 1, False
        elif down:
            armed = True
    return pulses > 1 and size.max() > 0


def _force_window(x: Floats, samples: float) -> Floats:
    """Return forces cut after a number of samples, with a cosine over the last fifth of these."""
    start = np.argmax(np.abs(x) >= 0.05 * np.abs(x).max(axis=1, keepdims=True), axis=1)[:, None, :]
    place = (np.arange(x.shape[1])[None, :, None] - start) / samples
    return x * np.where(place <= 0.8, 1.0, 0.5 + 0.5 * np.cos(np.pi * np.clip((place - 0.8) / 0.2, 0, 1)))


def _window(window: str, n: int, decay: float) -> Floats:
    if window == "exponential":
        return np.exp(-decay * np.arange(n))
    from scipy.signal import get_window  # a second to import, and few need it

    name = {"hann": "hann", "rectangular": "boxcar", "flattop": "flattop"}[window]
    return np.asarray(get_window(name, n), dtype=float)


def _effective(window: Floats, n_blocks: int, step: int) -> float:
    """Return n / (1 + 2 Σ_j (1 - j/n) ρ_j), ρ_j = [Σ w(t) w(t + j·step) / Σ w²]²."""
    total = 1.0
    for j in range(1, min(n_blocks, -(-window.size // step))):
        share = (window[: -j * step] @ window[j * step :]) / (window @ window)
        total += 2 * (1 - j / n_blocks) * float(share) ** 2
    return n_blocks / total


# Estimates --------------------------------------------------------------------------------------------------


def _estimate(
    X: Complexes, Y: Complexes, frequency: Floats, n: float, estimator: str, ratio: float | None
) -> tuple[Complexes, Floats, Floats, Floats]:
    """Return H, ordinary and multiple coherence, and standard deviations from the spectra of blocks."""
    n_in, n_out, n_blocks = X.shape[1], Y.shape[1], X.shape[2]
    if n_blocks < n_in:
        msg = f"{n_blocks} block(s) for {n_in} forces; at least as many blocks as forces are needed"
        raise EstimationError(msg)
    if estimator == "H2" and n_in > 1 and n_out != n_in:
        msg = f"H2 needs one force or as many responses as forces; found {n_in} forces and {n_out} responses"
        raise EstimationError(msg)
    Xh, Yh = X.conj().transpose(0, 2, 1), Y.conj().transpose(0, 2, 1)
    Gxx, Gyx, Gyy = X @ Xh / n_blocks, Y @ Xh / n_blocks, (np.abs(Y) ** 2).mean(axis=2)
    power = np.einsum("kii->ki", Gxx).real
    weak = power <= 1e-24 * power.max(axis=0)
    # equal forces at a line cannot be distinguished
    size = np.sqrt(np.maximum(power, 1e-300))
    value = np.linalg.eigvalsh(Gxx / (size[:, :, None] * size[:, None, :]))[:, 0]
    dead = np.flatnonzero(weak.any(axis=1) | (value < 1e-10))
    if dead.size:
        why = "no force acts" if weak[dead[0]].any() else "the forces are proportional to one another"
        msg = (
            f"{why} at {dead.size} of {frequency.size} lines, the first at {frequency[dead[0]]:g} Hz; leave "
            "them out with band=(…), or excite them"
        )
        raise EstimationError(msg)
    inverse = np.linalg.inv(Gxx)
    H1 = Gyx @ inverse
    explained = np.einsum("koi,koi->ko", H1, Gyx.conj()).real
    multiple = np.clip(np.divide(explained, Gyy, out=np.zeros(Gyy.shape), where=Gyy > 0), 0.0, 1.0)
    both = Gyy[:, :, None] * power[:, None, :]
    ordinary = np.divide(np.abs(Gyx) ** 2, both, out=np.zeros(both.shape), where=both > 0)
    if n_blocks > n_in:
        noise = np.maximum(1 - multiple, 0) * Gyy
        diagonal = np.einsum("kii->ki", inverse).real
        std = np.sqrt(noise[:, :, None] * diagonal[:, None, :] / (2 * n))
    else:
        std = np.full(H1.shape, np.nan)
    if estimator == "H2":
        H = (
            Gyy[:, :, None] / Gyx.conj()
            if n_in == 1
            else (Y @ Yh / n_blocks) @ np.linalg.inv(X @ Yh / n_blocks)
        )
    elif estimator == "Hv":
        H = _total_least_squares(Gxx, Gyx, Gyy, ratio)
    else:
        H = H1
    return np.asarray(H, dtype=complex), np.clip(ordinary, 0.0, 1.0), multiple, std


def _total_least_squares(Gxx: Complexes, Gyx: Complexes, Gyy: Floats, ratio: float | None) -> Complexes:
    """Return H from u with [xᴴ yᴴ] u of least power: y = -(u_x/u_y)ᴴ x, response by response."""
    n_freq, n_out, n_in = Gyx.shape
    G = np.empty((n_freq, n_out, n_in + 1, n_in + 1), dtype=complex)
    G[:, :, :n_in, :n_in] = Gxx[:, None]
    G[:, :, n_in, :n_in], G[:, :, :n_in, n_in] = Gyx, Gyx.conj()
    G[:, :, n_in, n_in] = Gyy
    size = np.sqrt(np.maximum(np.einsum("koii->koi", G).real, 1e-300))
    if ratio is not None:
        size = np.ones_like(size)
        size[:, :, n_in] = ratio
    _, vectors = np.linalg.eigh(G / (size[:, :, :, None] * size[:, :, None, :]))
    u = vectors[:, :, :, 0] / size
    return -(u[:, :, :n_in] / u[:, :, n_in:]).conj()
