"""Modes from measured FRFs, without a choice by hand.

    FRF ─ identify_modes → IdentifiedModes: modes with uncertainty, complex shapes, synthesised FRFs, the
                           modes tried, and why each was taken or left

`docs/modal-identification.md` gives the criteria.
"""

import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from fem.analysis.frf import FRF, FRFKind
from fem.analysis.modes import Modes
from fem.array_types import Complexes, Floats, Ints
from fem.linalg.solvers import one_thread
from updating.correlation.complexity import (
    LARGEST_MPD,
    LEAST_MPC,
    mean_phase,
    mean_phase_deviation,
    modal_complexity_factor,
    modal_phase_collinearity,
    real_shapes,
)
from updating.measurement.frf_estimation import EstimatedFRF
from updating.modal.identified_modes import IdentifiedModes
from updating.modal.modal_fit import ModalFit, ModalFitData, ModalScatter
from updating.modal.peaks import peak_words, unexplained_peaks
from updating.modal.poles import (
    LEAST_ORDERS,
    IdentificationError,
    Stabilisation,
    channel_sizes,
    fit_orders,
    track_poles,
)
from updating.modal.refinement import scatter_near, synthesise
from updating.modal.selection import SelectionState, Task, candidates, search_modes, unreported


@one_thread()
def identify_modes(
    frf: FRF | EstimatedFRF | ArrayLike,
    H: ArrayLike | None = None,
    *,
    kind: FRFKind | str = FRFKind.ACCELERANCE,
    band: tuple[float, float] | None = None,
    highest_order: int | None = None,
    std: ArrayLike | None = None,
    driving: Sequence[tuple[str | int, str | int]] | None = None,
    lower: bool = True,
    upper: bool = True,
    added_decay: float | None = None,
    least_mpc: float = LEAST_MPC,
    largest_mpd: float = LARGEST_MPD,
) -> IdentifiedModes:
    """Identify natural frequencies, damping ratios and shapes from FRFs.

    Poles of polyreference least-squares models of all orders (:func:`updating.modal.poles.fit_orders`) that
    persist over orders are candidates. A fit of greatest likelihood (:mod:`updating.modal.refinement`)
    refines them, with residuals of the modes outside the band. Those that are uncertain, insignificant, not
    collinear or a second copy are left out, and the rest is fitted again; then the residual of the fit is
    searched in the same way for more. Nothing is random: the same data give the same result.

    The standard deviations are those of the fit, for the noise given or estimated from its residual, and
    are raised where the misfit near a mode is larger or correlated from line to line.

    Parameters
    ----------
    frf : FRF, EstimatedFRF or array_like (n_freq,)
        FRFs, or frequencies of ``H`` [Hz]; the lines may be unevenly spaced. Those of :func:`estimate_frf`
        bring their standard deviations and the decay that a window added.
    H : array_like (n_freq, n_out, n_in), (n_freq, n_out) or (n_freq,), optional
        FRFs, if ``frf`` has the frequencies; the shorter forms have one force, or one response to it.
    kind : FRFKind or str
        Of ``H``.
    band : (float, float), optional
        Lowest and highest frequency to use [Hz].
    highest_order : int, optional
        Of the denominator's matrix polynomial, which has as many poles as that times the inputs;
        150 over the number of inputs, but 30 to 100, unless given.
    std : array_like, optional
        Standard deviation of the real and of the imaginary part of the FRFs, of the shape of ``H`` or one
        that broadcasts to it [unit of the FRF]. The fit uses the product of a number for each output and one
        for each line and input that comes nearest to it. Unless given, it is estimated from the residual of
        the fit; also where this residual exceeds three times the given value (``choices`` says so).
    driving : sequence of (output, input), optional
        Labels of responses at the place and in the direction of a force, or their numbers, from 0; equal
        labels, but for the sign, unless given.
    lower, upper : bool
        Whether modes below and above the band are allowed for.
    added_decay : float, optional
        Addition of an exponential window to the decay of all modes, which is taken off exactly [1/s]; that of
        an ``EstimatedFRF``, or none, unless given. ``synthesised`` keeps it, as the data do.
    least_mpc : float
        Smallest modal phase collinearity of a mode [-]; 0 for structures with complex modes.
    largest_mpd : float
        Largest mean phase deviation of a mode [degrees]; 90 for structures with complex modes.

    Returns
    -------
    IdentifiedModes

    Raises
    ------
    IdentificationError
        For too few lines, responses that are zero, a driving point or standard deviations that do not fit.
    fem.analysis.frf.FRFError
        For arrays that are not FRFs.

    Warns
    -----
    UserWarning
        If there is no driving point, one seems to have the wrong sign, or a peak has no mode.
    """
    if isinstance(frf, EstimatedFRF):
        added_decay = frf.added_decay if added_decay is None else added_decay
        known = std is None and np.isfinite(frf.std).all() and (frf.std > 0).all()
        std = frf.std if known else std
        frf = frf.frf
    if isinstance(frf, FRF) and H is not None:
        msg = "H is given in addition to an FRF; give the FRF alone, or frequencies and H"
        raise IdentificationError(msg)
    if isinstance(frf, FRF):
        full = frf
        if frf.strain and frf.kind != FRFKind.RECEPTANCE:  # residues of strains are those of receptances
            if std is not None:
                sigma = _standard_deviation(std, frf)
                std = np.abs(_receptances(replace(frf, H=sigma.astype(complex))).H)
            full = _receptances(frf)
    elif H is None:
        msg = "frequencies are given without FRFs; identify_modes takes an FRF, or frequencies and H"
        raise IdentificationError(msg)
    else:
        full = FRF.from_arrays(frf, H, kind)
        if std is not None and np.ndim(H) < 3 and np.shape(std) == np.shape(H):
            std = np.reshape(std, full.H.shape)
    lines = _lines(full, band)
    data = full.select(lines=lines)
    points = _driving_points(data, driving)
    sigma = None if std is None else _standard_deviation(std, full)[lines]
    # with more forces than responses there are fewer unknowns the other way round: residues are ψ Lᵀ
    turned = data.H.shape[2] > data.H.shape[1]
    if turned:
        data = _turned(data)
        sigma = None if sigma is None else sigma.transpose(0, 2, 1)
    orders = _orders(data, highest_order)
    fitted = _fit_data(data, sigma)
    fitted = replace(fitted, lower=lower, upper=upper, added_decay=_decay(added_decay or 0.0))
    task = Task(fitted, std is None, least_mpc, largest_mpd, turned)

    level, _ = channel_sizes(data.H)
    line_weight = np.exp(-np.log(fitted.spread).mean(axis=1))
    stabilisation = fit_orders(data, orders, level, line_weight)
    tracks = track_poles(stabilisation)
    found, n_more = search_modes(task, tracks, orders)
    noise = "estimated from the residual of the fit" if std is None else "as given"
    missed = float(np.sqrt((np.abs(found.fitted.misfit) ** 2).mean() / 2))
    # Standard deviations that the fit exceeds by this factor, root mean square, are not the data's own [-]
    if std is not None and missed > 3.0:
        noise = (
            f"estimated from the residual of the fit, which is {missed:.2g} times the given standard "
            "deviations: they do not cover errors that repeat in every average, such as leakage"
        )
        found, n_more = search_modes(replace(task, estimate_noise=True), tracks, orders)

    choices = (
        f"{data.n_freq} of {full.n_freq} lines, {data.frequency[0]:g} to {data.frequency[-1]:g} Hz",
        f"model orders {orders[0]} to {orders[-1]}: {len(tracks)} poles persist over at least "
        f"{LEAST_ORDERS} orders; the residual of the first fit has {n_more} more",
        *found.steps,
        f"noise: {noise}",
    )
    done = _result(task, found, points, stabilisation, choices)
    if isinstance(frf, FRF) and frf.strain:
        done = _of_kind(done, frf)
    for text in peak_words(done.unexplained):
        warnings.warn(text, stacklevel=2)
    return done


def _lines(frf: FRF, band: tuple[float, float] | None) -> Ints:
    """Return the lines to use; 0 Hz holds nothing of a mode that other lines do not."""
    low, high = band if band is not None else (0.0, np.inf)
    lines = np.flatnonzero((frf.frequency > 0) & (frf.frequency >= low) & (frf.frequency <= high))
    if lines.size < 20:
        msg = (
            f"{lines.size} line(s) lie in the band {low:g} to {high:g} Hz; at least 20 are needed. The data "
            f"have {frf.n_freq} lines from {frf.frequency[0]:g} to {frf.frequency[-1]:g} Hz: widen the band"
        )
        raise IdentificationError(msg)
    size = np.abs(frf.H[lines]).max(axis=0)
    for axis, names, word in ((1, frf.outputs, "response"), (0, frf.inputs, "force")):
        dead = np.flatnonzero(size.max(axis=axis) == 0)
        if dead.size:
            msg = f"all FRFs of {word} '{names[dead[0]]}' are zero in the band; leave this {word} out"
            raise IdentificationError(msg)
    return lines


def _orders(data: FRF, highest: int | None) -> Ints:
    n_in = data.H.shape[2]
    # a model of this order has (order + 1)(n_in + 1) coefficients for each row, two numbers a line and input
    most = 2 * n_in * data.n_freq // (3 * (n_in + 1)) - 1
    if highest is None:
        highest = min(int(np.clip(round(150 / n_in), 30, 100)), most)
    if not 6 <= highest <= most:
        msg = (
            f"the highest order is {highest}; for {data.n_freq} lines and {n_in} force(s) 6 to {most} "
            "are allowed"
        )
        raise IdentificationError(msg)
    return np.arange(max(2, highest // 8), highest + 1)


def _standard_deviation(std: ArrayLike, frf: FRF) -> Floats:
    try:
        sigma = np.broadcast_to(np.asarray(std, dtype=float), frf.H.shape)
    except ValueError:
        msg = (
            f"std has the shape {np.shape(std)}; that of H, {frf.H.shape}, or one that broadcasts to it "
            "is expected"
        )
        raise IdentificationError(msg) from None
    bad = ~(np.isfinite(sigma) & (sigma > 0))
    if bad.any():
        k, i, j = (int(v) for v in np.argwhere(bad)[0])
        msg = (
            f"std is {sigma[k, i, j]:g} at {frf.frequency[k]:g} Hz, response '{frf.outputs[i]}', force "
            f"'{frf.inputs[j]}'; standard deviations must be positive"
        )
        raise IdentificationError(msg)
    return sigma


def _fit_data(data: FRF, sigma: Floats | None) -> ModalFitData:
    if sigma is None:
        of_output, of_input = channel_sizes(data.H)
        return ModalFitData(data, of_output, np.tile(of_input, (data.n_freq, 1)))
    log = np.log(sigma)
    of_output = log.mean(axis=(0, 2))
    return ModalFitData(data, np.exp(of_output), np.exp((log - of_output[:, None]).mean(axis=1)))


def _decay(added: float) -> float:
    if not (np.isfinite(added) and added >= 0):
        msg = f"added_decay is {added}; it is 0 without an exponential window and positive with one [1/s]"
        raise IdentificationError(msg)
    return float(added)


def _driving_points(
    data: FRF, driving: Sequence[tuple[str | int, str | int]] | None
) -> tuple[tuple[int, int, int], ...]:
    """Return (output, input, sign) of driving points."""
    if driving is None:
        pairs = [
            (i, j, 1 if a == b else -1)
            for j, b in enumerate(data.inputs)
            for i, a in enumerate(data.outputs)
            if a == b or (a[:-1] == b[:-1] and {a[-1:], b[-1:]} == {"+", "-"})
        ]
        if not pairs and data.base == data.inputs:
            warnings.warn(
                "modes identified from motions of the base have no modal masses: each shape has a largest "
                "entry of 1",
                stacklevel=3,
            )
        elif not pairs:
            warnings.warn(
                "there is no driving point: no response has the label of a force. Modal masses are unknown, "
                "and each shape has a largest entry of 1. Measure a response at a force, or name one that "
                "was: driving=[(response, force), …]",
                stacklevel=3,
            )
        return tuple(pairs)
    out = []
    for pair in driving:
        if isinstance(pair, str) or len(pair) != 2:
            msg = f"a driving point is {pair!r}; a pair (response, force) is needed"
            raise IdentificationError(msg)
        at = []
        for word, name, names in (("response", pair[0], data.outputs), ("force", pair[1], data.inputs)):
            if name in names:
                at.append(names.index(str(name)))
            elif not isinstance(name, str) and name in range(len(names)):
                at.append(int(name))
            else:
                msg = (
                    f"the driving point names the {word} {name!r}; the data have {', '.join(names)}, or by "
                    f"number 0 to {len(names) - 1}"
                )
                raise IdentificationError(msg)
        out.append((at[0], at[1], 1))
    return tuple(out)


def _receptances(frf: FRF) -> FRF:
    """Return FRFs as receptances, without a line at 0 Hz."""
    return frf.select(lines=frf.frequency > 0).as_kind(FRFKind.RECEPTANCE)


def _of_kind(found: IdentifiedModes, frf: FRF) -> IdentifiedModes:
    """Return modes whose synthesised FRFs and noise are of the kind of given FRFs, but for strains."""
    noise, strain = replace(found.synthesised, H=found.noise.astype(complex), strain=frf.strain), frf.strain
    synthesised = replace(found.synthesised, strain=strain).as_kind(frf.kind)
    return replace(found, synthesised=synthesised, noise=np.abs(noise.as_kind(frf.kind).H))


def _turned(frf: FRF) -> FRF:
    """Return FRFs with responses and forces in each other's place."""
    return FRF.from_arrays(frf.frequency, frf.H.transpose(0, 2, 1), frf.kind, frf.inputs, frf.outputs)


def _result(
    task: Task,
    found: SelectionState,
    points: tuple[tuple[int, int, int], ...],
    stabilisation: Stabilisation,
    choices: tuple[str, ...],
) -> IdentifiedModes:
    fit, data, turned = found.fitted, found.data.frf, task.turned
    size = np.abs(fit.poles)
    complex_ = np.array([bool(reason) for reason in unreported(task, fit)], dtype=bool)
    rising = np.argsort(size, kind="stable")
    rising = rising[~complex_[rising]]
    poles, psi, L = fit.poles[rising], fit.shapes[:, rising], fit.participation[rising]
    size, decay = size[rising], -poles.real
    if turned:
        psi, L, data = L.T, psi.T, _turned(data)
    phi, gamma = scaled(poles, psi, L, points)
    frequency, zeta = size / (2 * np.pi), decay / size
    # d|λ| = (decay² du + Im λ · decay dv)/|λ|, dζ = decay du/|λ| - decay d|λ|/|λ|²
    J = np.zeros((2 * poles.size, 2 * poles.size))
    for k in range(poles.size):
        grow = decay[k] * np.array([decay[k], poles[k].imag]) / size[k]
        J[2 * k, 2 * k : 2 * k + 2] = grow / (2 * np.pi)
        J[2 * k + 1, 2 * k : 2 * k + 2] = np.array([decay[k] / size[k], 0]) - decay[k] * grow / size[k] ** 2
    index = np.column_stack([2 * rising, 2 * rising + 1]).ravel()
    noise = np.repeat(scatter_near(fit, found.data)[rising], 2)
    covariance = J @ (fit.covariance[np.ix_(index, index)] * np.outer(noise, noise)) @ J.T
    deviation = np.sqrt(covariance.diagonal()).reshape(-1, 2)
    tried = candidates(task, found)
    sigma = found.data.scale[:, None] * found.data.spread[:, None, :]
    H, lower, upper = fit.H - synthesise(found.data, fit, complex_), fit.lower, fit.upper
    if turned:
        sigma, H, lower, upper = sigma.transpose(0, 2, 1), H.transpose(0, 2, 1), lower.T, upper.T
    power = (np.abs(data.H) ** 2).sum(axis=0)
    error = np.sqrt(
        np.divide((np.abs(H - data.H) ** 2).sum(axis=0), power, out=np.zeros(power.shape), where=power > 0)
    )
    entries, across = shape_deviation(fit, rising, points, turned)
    return IdentifiedModes(
        Modes(frequency, real_shapes(phi), zeta, data.outputs),
        poles,
        gamma,
        phi,
        deviation[:, 0],
        deviation[:, 1],
        entries * noise[::2],
        across * noise[::2],
        covariance,
        modal_phase_collinearity(phi),
        mean_phase_deviation(phi),
        modal_complexity_factor(phi),
        bool(points),
        tuple((data.outputs[i], data.inputs[j]) for i, j, _ in points),
        lower,
        upper,
        replace(data, H=H, accuracy=None),
        error,
        sigma,
        stabilisation,
        tried,
        choices,
        unexplained_peaks(data.frequency, data.H, H, sigma, tried, stabilisation),
    )


# Shapes scaled to a modal mass of 1 at driving points, and their standard deviations ------------------------


def scaled(
    poles: Complexes, psi: Complexes, L: Complexes, points: tuple[tuple[int, int, int], ...]
) -> tuple[Complexes, Complexes]:
    """Return shapes and participations of the same residues, scaled to a modal mass of 1.

    A mode of mass 1 has residues φ_o φ_i / (2i Im λ): of the scale s with φ = sψ, s² ψ_d = 2i Im λ L_d at
    driving points d, in least squares.
    """
    if not points:
        s = (
            1 / psi[np.argmax(np.abs(psi), axis=0), np.arange(psi.shape[1])]
            if psi.size
            else np.ones(psi.shape[1])
        )
        return psi * s, L / s[:, None]
    s = _scale_of(poles, psi, L, points)
    phi = psi * s
    turned = np.abs(np.cos(mean_phase(phi)))
    if psi.size and (np.median(turned) < np.sqrt(0.5)):
        warnings.warn(
            "the residues of the driving points have the wrong sign in most modes. Check whether response "
            "and force point in opposite directions; if they do, the sizes of the shapes are right",
            stacklevel=4,
        )
    return phi, L / s[:, None]


def _scale_of(
    poles: Complexes, psi: Complexes, L: Complexes, points: tuple[tuple[int, int, int], ...]
) -> Complexes:
    """Return s with s² ψ_d = 2i Im λ L_d at driving points d, in least squares."""
    out, inn, sign = (np.array(p) for p in zip(*points, strict=True))
    here, there = psi[out].T, L[:, inn] * sign
    power = np.maximum((np.abs(here) ** 2).sum(axis=1), 1e-300)
    return np.sqrt(2j * poles.imag * (here.conj() * there).sum(axis=1) / power)


def shape_deviation(
    fit: ModalFit, order: Ints, points: tuple[tuple[int, int, int], ...], turned: bool
) -> tuple[Floats, Floats]:
    """Return standard deviations of the real, scaled shapes, the modes in an order.

    Linearised: differences of the scaled shape by each unknown of the mode, scale and mean phase included.

    Returns
    -------
    entries : ndarray (n_out, n_modes)
    across : ndarray (n_modes,)
        Root mean square of the deviations across the shape over that of its entries, which stays at any
        scale [-].
    """
    n_psi, scatter = len(fit.shapes), fit.scatter
    n_out = fit.participation.shape[1] if turned else n_psi
    out, relative = np.zeros((n_out, order.size)), np.zeros(order.size)
    for column, r in enumerate(order.tolist()):
        entries = np.flatnonzero(scatter.rows == r)
        n_other = 2 + 2 * entries.size
        m = n_other + 2 * n_psi
        size = float(np.abs(fit.shapes[:, r]).max()) or 1.0
        step = np.full(m, 1e-6)
        step[n_other:] *= size
        poles = np.full(m + 1, fit.poles[r])
        psi, L = (np.tile(x, (m + 1, 1)).astype(complex) for x in (fit.shapes[:, r], fit.participation[r]))
        decay = -fit.poles[r].real
        poles[1] = -decay * np.exp(step[0]) + 1j * fit.poles[r].imag
        poles[2] += 1j * decay * step[1]
        for k, i in enumerate(entries):
            for part, unit in enumerate((1.0, 1j)):
                row = 3 + 2 * k + part
                L[row, scatter.cols[i]] += unit * step[row - 1]
        rows = np.arange(n_psi)
        psi[n_other + 1 + 2 * rows, rows] += step[n_other]
        psi[n_other + 2 + 2 * rows, rows] += 1j * step[n_other]
        if turned:
            psi, L = L, psi
        largest = np.argmax(np.abs(psi[0]))
        s = _scale_of(poles, psi.T, L, points) if points else 1 / psi[:, largest]
        real = real_shapes(psi.T * s)
        real = real * np.sign((real * real[:, :1]).sum(axis=0))  # the sign of a shape is arbitrary
        J = (real[:, 1:] - real[:, :1]) / step
        among = np.concatenate([[2 * r, 2 * r + 1], *((a, a + 1) for a in 2 * len(fit.poles) + 2 * entries)])
        phi = real[:, 0]
        power = max(float(phi @ phi), 1e-300)
        across = J - np.outer(phi, phi @ J) / power
        variance, rest = (
            _variance(part, n_other, among.astype(np.int64), scatter, r) for part in (J, across)
        )
        out[:, column], relative[column] = np.sqrt(variance), np.sqrt(rest.sum() / power)
    return out, relative


def _variance(J: Floats, n_other: int, among: Ints, scatter: ModalScatter, r: int) -> Floats:
    """Return the variances (n,) of quantities with derivatives J (n, m) by the unknowns of a mode."""
    by_shape = J[:, n_other:].reshape(len(J), -1, 2)
    F = np.einsum("pob,obi->pi", by_shape, scatter.slope[r])
    F[:, among] += J[:, :n_other]
    conditional = np.einsum("pob,obc,poc->p", by_shape, scatter.conditional[r], by_shape, optimize=True)
    return conditional + np.einsum("pi,ij,pj->p", F, scatter.covariance, F, optimize=True)
