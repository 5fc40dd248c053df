"""Modes from measured FRFs, without a choice by hand.

    FRF ─ identify_modes → IdentifiedModes: modes with uncertainty, complex shapes, synthesised FRFs, what was
                           tried and why it was taken or left

`docs/modal-identification.md` gives the criteria.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import median_filter

from fem.analysis.frf import FRF, FRFKind
from fem.analysis.modes import Modes
from fem.model import Damping
from updating.correlation import mac
from updating.correlation.complexity import (
    mean_phase,
    mean_phase_deviation,
    modal_complexity_factor,
    modal_phase_collinearity,
    real_shapes,
)
from updating.measurement.frf_estimation import EstimatedFRF
from updating.modal.modal_fit import ModalFit, ModalFitData
from updating.modal.peaks import Candidate, UnexplainedPeak, peak_words, unexplained_peaks
from updating.modal.poles import (
    LEAST_ORDERS,
    MATHEMATICAL_DAMPING,
    IdentificationError,
    Stabilisation,
    Track,
    channel_sizes,
    fit_orders,
    track_poles,
)
from updating.modal.refinement import fit_modes, scatter_near, synthesise

LARGEST_DEVIATION = 0.15
"""A mode's frequency and decay must be known within this part of its half-power half-width [-]."""

LEAST_MPC, LARGEST_MPD = 0.3, 45.0
"""Shapes are no less collinear [-], and no farther from real ones [degrees], unless the caller says so."""

SIGNIFICANCE = 8.0
"""A mode must lower the weighted sum of squares by its number of parameters n and this times √(2n), which is
the standard deviation of what n parameters gain by fitting noise [-]."""

TWIN_MAC, TWIN_DISTANCE = 0.9, 1.0
"""Of two modes with a higher MAC of shapes and of participations, |λ₁ - λ₂| being less than this times the
sum of their |Re λ|, one is dropped."""

ROUNDING = 1e-10
"""Noise is taken for at least this part of the root mean square of an output [-]."""

_FEW_STEPS, _MANY_STEPS = 8, 60
"""Steps of a fit while there may be poles that are no modes, which converge slowly or not at all, and of the
last."""

_MISSED = 3.0
"""Standard deviations that the fit exceeds by this factor, root mean square, are not the data's own [-]."""

_PARTS, _PART, _PART_ORDER = 8, 128, 24
"""What a fit leaves is searched in this many parts of the band, of so many lines at least, up to this
order."""

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, eq=False)
class IdentifiedModes:
    """Modes identified from FRFs.

    Attributes
    ----------
    modes : Modes
        Natural frequencies |λ|/2π, damping ratios, real shapes at the outputs, whose labels are the rows'
        [1/√kg if ``scaled``, else with a largest entry of 1].
    poles : ndarray of complex (n_modes,)
        λ [rad/s].
    participation : ndarray of complex (n_modes, n_in)
        With ``complex_shapes`` φ, the residue of a receptance being φ_o participation_i.
    complex_shapes : ndarray of complex (n_out, n_modes)
        Of the scale of ``modes.shapes``.
    frequency_std, zeta_std : ndarray (n_modes,)
        Standard deviations [Hz, -].
    shape_std : ndarray (n_out, n_modes)
        Standard deviations of ``modes.shapes`` [as they].
    covariance : ndarray (2 n_modes, 2 n_modes)
        Of (frequency, ratio), mode by mode.
    mpc, mpd, mcf : ndarray (n_modes,)
        Modal phase collinearity [-], mean phase deviation [degrees], modal complexity factor [-].
    scaled : bool
        Whether the shapes have a modal mass of 1.
    driving : tuple of (str, str)
        Outputs and inputs at the same place and direction, from which the scale is.
    lower, upper : ndarray (n_out, n_in)
        Residuals: the receptance gains -lower/ω² + upper [1/kg, m/N].
    synthesised : FRF
        Of these modes and the residuals, on the lines and of the kind of the data.
    error : ndarray (n_out, n_in)
        Root of Σ |H_synthesised - H|² / Σ |H|² over the lines [-].
    noise : ndarray (n_freq, n_out, n_in)
        Standard deviation of the real and of the imaginary parts that the fit assumed [unit of the FRF].
    stabilisation : Stabilisation
        Poles of all orders.
    candidates : tuple of Candidate
        All that were tried, by frequency.
    choices : tuple of str
        What was chosen on the way, in order.
    unexplained : tuple of UnexplainedPeak
        Peaks of the data that the modes do not explain, the highest first, with the reason.
    """

    modes: Modes
    poles: Complexes
    participation: Complexes
    complex_shapes: Complexes
    frequency_std: Floats
    zeta_std: Floats
    shape_std: Floats
    covariance: Floats
    mpc: Floats
    mpd: Floats
    mcf: Floats
    scaled: bool
    driving: tuple[tuple[str, str], ...]
    lower: Floats
    upper: Floats
    synthesised: FRF
    error: Floats
    noise: Floats
    stabilisation: Stabilisation
    candidates: tuple[Candidate, ...]
    choices: tuple[str, ...]
    unexplained: tuple[UnexplainedPeak, ...] = ()

    @property
    def residues(self) -> Complexes:
        """Residues of the receptances at the poles, shape (n_modes, n_out, n_in) [m/(N s)]."""
        return self.complex_shapes.T[:, :, None] * self.participation[:, None, :]

    def relative_std(self, least_shape: float = 0.01) -> tuple[Floats, Floats]:
        """Return standard deviations as an updating takes them, (n_modes,) each [-].

        Those of frequencies, relative, and the root mean square of those of a shape's entries over that of
        the entries.

        Parameters
        ----------
        least_shape : float
            Of the latter: places and directions of sensors are not known better [-].
        """
        shapes = np.abs(self.modes.shapes)
        size = np.sqrt((shapes**2).mean(axis=0))
        noise = np.sqrt((self.shape_std**2).mean(axis=0)) / np.where(size > 0, size, 1.0)
        return self.frequency_std / self.modes.frequency, np.maximum(noise, least_shape)

    def damping(self) -> Damping:
        """Return the damping ratios as those of a model, over frequency."""
        zeta = self.modes.zeta
        if zeta is None or not zeta.size:
            msg = "there is no mode to take a damping ratio from"
            raise IdentificationError(msg)
        return Damping.modal(zeta, self.modes.frequency)

    def table(self) -> str:
        """Return the modes as lines of text, then peaks that they do not explain."""
        zeta = np.zeros(0) if self.modes.zeta is None else self.modes.zeta
        lines = ["mode  frequency [Hz]        damping ratio [%]     MPC    MPD [deg]"]
        for k, f in enumerate(self.modes.frequency):
            lines.append(
                f"{k + 1:4d}  {f:9.3f} ± {self.frequency_std[k]:<8.2g}  {100 * zeta[k]:8.4f} ± "
                f"{100 * self.zeta_std[k]:<8.2g}  {self.mpc[k]:.4f}  {self.mpd[k]:6.2f}"
            )
        return "\n".join([*lines, *peak_words(self.unexplained)])


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
    collinear or a second copy are left out, and the rest is fitted again; then what the fit leaves is
    searched in the same way for more. Nothing is random: the same data give the same result.

    The standard deviations are those of the fit, for the noise given or estimated from what it leaves, and
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
        for each line and input that comes nearest to it. Estimated from what the fit leaves, unless given,
        and where the fit misses the data by more than three times what is given (``choices`` says so).
    driving : sequence of (output, input), optional
        Labels of responses at the place and in the direction of a force, or their numbers, from 0; equal
        labels, but for the sign, unless given.
    lower, upper : bool
        Whether modes below and above the band are allowed for.
    added_decay : float, optional
        What an exponential window added to the decay of all modes, which is taken off exactly [1/s]; that of
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
        msg = "H is given beside an FRF; give the FRF alone, or frequencies and H"
        raise IdentificationError(msg)
    if isinstance(frf, FRF):
        whole = frf
    elif H is None:
        msg = "frequencies are given without FRFs; identify_modes takes an FRF, or frequencies and H"
        raise IdentificationError(msg)
    else:
        whole = FRF.from_arrays(frf, H, kind)
        if std is not None and np.ndim(H) < 3 and np.shape(std) == np.shape(H):
            std = np.reshape(std, whole.H.shape)
    lines = _lines(whole, band)
    data = whole.select(lines=lines)
    points = _driving_points(data, driving)
    sigma = None if std is None else _standard_deviation(std, whole)[lines]
    # with more forces than responses there are fewer unknowns the other way round: residues are ψ Lᵀ
    turned = data.H.shape[2] > data.H.shape[1]
    if turned:
        data = _turned(data)
        sigma = None if sigma is None else sigma.transpose(0, 2, 1)
    orders = _orders(data, highest_order)
    fitted = _fit_data(data, sigma)
    fitted = replace(fitted, lower=lower, upper=upper, added_decay=_decay(added_decay or 0.0))
    task = _Task(fitted, std is None, least_mpc, largest_mpd, turned)

    level, _ = channel_sizes(data.H)
    line_weight = np.exp(-np.log(fitted.spread).mean(axis=1))
    stabilisation = fit_orders(data, orders, level, line_weight)
    tracks = track_poles(stabilisation)
    found, n_more = _search(task, tracks, orders)
    noise = "estimated from the residual of the fit" if std is None else "as given"
    missed = float(np.sqrt((np.abs(found.fitted.misfit) ** 2).mean() / 2))
    if std is not None and missed > _MISSED:
        noise = (
            f"estimated from the residual of the fit, which is {missed:.2g} times the given standard "
            "deviations: they do not cover errors that repeat in every average, such as leakage"
        )
        found, n_more = _search(replace(task, estimate_noise=True), tracks, orders)

    choices = (
        f"{data.n_freq} of {whole.n_freq} lines, {data.frequency[0]:g} to {data.frequency[-1]:g} Hz",
        f"model orders {orders[0]} to {orders[-1]}: {len(tracks)} poles persist over at least "
        f"{LEAST_ORDERS} orders; the residual of the first fit has {n_more} more",
        *found.steps,
        f"noise: {noise}",
    )
    done = _result(task, found, points, stabilisation, choices)
    for text in peak_words(done.unexplained):
        warnings.warn(text, stacklevel=2)
    return done


def damping_matrix(mass: ArrayLike, shapes: ArrayLike, frequency: ArrayLike, zeta: ArrayLike) -> Floats:
    """Compute the damping matrix C = M Φ diag(2ζω) Φᵀ M that gives modes their damping ratios.

    Then φᵀCφ = 2ζω and the modes stay uncoupled; modes that are not among Φ get none (Caughey and O'Kelly,
    *J. Appl. Mech.* 32, 1965, 583; Wilson and Penzien, *Earthquake Eng. Struct. Dyn.* 1, 1972, 5).

    Parameters
    ----------
    mass : array_like or sparse (n_dof, n_dof)
        M [kg, kg m²].
    shapes : array_like (n_dof, n_modes)
        Real mode shapes; they are scaled to φᵀMφ = 1.
    frequency, zeta : array_like (n_modes,)
        Natural frequencies [Hz] and damping ratios [-], identified or computed.

    Returns
    -------
    ndarray (n_dof, n_dof)
        [N s/m, N m s].

    Raises
    ------
    IdentificationError
        If the shapes do not fit the mass matrix, or the frequencies and ratios the shapes.
    """
    phi = np.array(shapes, dtype=float, ndmin=2)
    f, ratio = (np.array(x, dtype=float, ndmin=1) for x in (frequency, zeta))
    M = mass if hasattr(mass, "tocsr") else np.array(mass, dtype=float, ndmin=2)
    if np.shape(M) != (len(phi), len(phi)):
        msg = f"the shapes have {len(phi)} rows and the mass matrix the shape {np.shape(M)}; they must fit"
        raise IdentificationError(msg)
    if f.shape != (phi.shape[1],) or ratio.shape != f.shape:
        msg = f"{phi.shape[1]} shapes need as many frequencies and ratios; found {f.size} and {ratio.size}"
        raise IdentificationError(msg)
    if (
        not (np.isfinite(f) & (f >= 0) & np.isfinite(ratio) & (ratio >= 0)).all()
        or not np.isfinite(phi).all()
    ):
        msg = "shapes, frequencies and ratios must be finite numbers, the latter two not negative"
        raise IdentificationError(msg)
    momentum = M @ phi
    modal_mass = np.einsum("ij,ij->j", phi, momentum)
    if (modal_mass <= 0).any():
        k = int(np.argmin(modal_mass))
        msg = f"shape {k + 1} has the modal mass {modal_mass[k]:.3g}; it must be positive"
        raise IdentificationError(msg)
    return (momentum * (4 * np.pi * ratio * f / modal_mass)) @ momentum.T


# What is given ----------------------------------------------------------------------------------------------


def _lines(frf: FRF, band: tuple[float, float] | None) -> NDArray[np.int64]:
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


def _orders(data: FRF, highest: int | None) -> NDArray[np.int64]:
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
        if not pairs:
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


def _turned(frf: FRF) -> FRF:
    """Return FRFs with responses and forces in each other's place."""
    return FRF.from_arrays(frf.frequency, frf.H.transpose(0, 2, 1), frf.kind, frf.inputs, frf.outputs)


# Which poles are modes --------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Start:
    """A pole to begin with, and in how many orders it was found."""

    pole: complex
    participation: tuple[complex, ...]
    n_orders: int


@dataclass(frozen=True, slots=True, eq=False)
class _Task:
    data: ModalFitData
    estimate_noise: bool
    least_mpc: float
    largest_mpd: float
    turned: bool = False
    """Whether responses and forces have changed places."""


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    """Modes so far, their fit and the weights it used."""

    data: ModalFitData
    starts: tuple[_Start, ...]
    fit: ModalFit | None
    rejected: tuple[Candidate, ...]
    steps: tuple[str, ...]

    @property
    def fitted(self) -> ModalFit:
        assert self.fit is not None
        return self.fit


def _starts(tracks: Sequence[Track], data: ModalFitData) -> tuple[_Start, ...]:
    """Return poles to begin with, without the decay that a window added."""
    return tuple(
        _Start(
            complex(min(t.pole.real + data.added_decay, 0.01 * t.pole.real), t.pole.imag),
            tuple(t.participation.tolist()),
            len(t.members),
        )
        for t in tracks
    )


def _search(task: _Task, tracks: Sequence[Track], orders: NDArray[np.int64]) -> tuple[_State, int]:
    """Settle on the modes among the tracks and what they leave; return how many were tried of the latter."""
    found = _settle(task, _State(task.data, _starts(tracks, task.data), None, (), ()))
    more = _overlooked(found, orders)
    if more:
        wider = _settle(task, replace(found, starts=found.starts + more))
        found = wider if len(wider.starts) > len(found.starts) else replace(found, rejected=wider.rejected)
    return found, len(more)


def _overlooked(found: _State, orders: NDArray[np.int64]) -> tuple[_Start, ...]:
    """Return poles that persist in what the fit left, by parts of the band that overlap by half.

    In a part, fewer poles describe what is left, and strong modes elsewhere do not matter.
    """
    data = found.data.frf
    left = replace(data, H=data.H - found.fitted.H)
    quiet = np.exp(-np.log(found.data.spread).mean(axis=1))
    size = max(_PART, data.n_freq // _PARTS)
    firsts = np.arange(0, max(data.n_freq - size // 2, 1), max(size // 2, 1))
    low_orders = orders[orders <= _PART_ORDER]
    out: list[_Start] = []
    for first in firsts:
        rows = np.arange(first, min(first + size, data.n_freq))
        part = fit_orders(left.select(lines=rows), low_orders, found.data.scale, quiet[rows])
        for start in _starts(track_poles(part), found.data):
            near = (abs(start.pole - other.pole) < -start.pole.real - other.pole.real for other in out)
            if not any(near):
                out.append(start)
    return tuple(out)


def _settle(task: _Task, state: _State) -> _State:
    """Fit, leave out what is not a mode, and fit again until all are."""
    data, starts, rejected, steps = state.data, state.starts, state.rejected, state.steps
    final = False
    while True:
        n_in = data.spread.shape[1]
        poles = np.array([s.pole for s in starts], dtype=complex)
        L = np.array([s.participation for s in starts], dtype=complex).reshape(-1, n_in)
        fit = fit_modes(data, poles, L, _MANY_STEPS if final else _FEW_STEPS)
        if task.estimate_noise:
            data = _reweighted(data, fit)
            fit = fit_modes(data, fit.poles, fit.participation, _MANY_STEPS if final else _FEW_STEPS)
        steps = (
            *steps,
            f"{len(starts)} poles fitted in {fit.n_steps} steps"
            + ("" if fit.converged else ", not converged yet"),
        )
        starts = tuple(
            _Start(complex(p), tuple(row.tolist()), s.n_orders)
            for p, row, s in zip(fit.poles, fit.participation, starts, strict=True)
        )
        reasons = _reasons(task, data, fit)
        if not any(reasons):
            if fit.converged or final:
                return _State(data, starts, fit, rejected, steps)
            final = True
            continue
        rejected += tuple(
            Candidate(abs(s.pole) / (2 * np.pi), -s.pole.real / abs(s.pole), s.n_orders, False, reason)
            for s, reason in zip(starts, reasons, strict=True)
            if reason
        )
        starts = tuple(s for s, reason in zip(starts, reasons, strict=True) if not reason)


def _reweighted(data: ModalFitData, fit: ModalFit) -> ModalFitData:
    """Return weights for what the fit leaves: σ² = (s_o)² (a_ki² + ε_i² h_ki²).

    a is the level of noise over the lines, a running median over a sixteenth of them, which resonances do not
    raise. h_ki² is the mean over the outputs of |H_oi|²/s_o², and ε_i what errors in proportion to the
    response (gains, places, masses of sensors, lines too far apart for a peak) leave on the twentieth of the
    lines with the largest h.
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
    return np.stack([median_filter(column, width, mode="nearest") for column in values.T], axis=1)


def _reasons(task: _Task, data: ModalFitData, fit: ModalFit) -> list[str]:
    """Return for each pole why it is not a mode, or nothing."""
    frequency = fit.poles.imag / (2 * np.pi)
    low, high = data.frf.frequency[[0, -1]]
    noise = scatter_near(fit, data)
    deviation = np.sqrt(fit.covariance.diagonal()).reshape(-1, 2).max(axis=1, initial=0.0) * noise
    width = data.added_decay - fit.poles.real  # as the data show it
    deviation *= -fit.poles.real / width
    n = fit.n_parameters
    needed = n + SIGNIFICANCE * np.sqrt(2 * n)
    zeta = -fit.poles.real / np.abs(fit.poles)
    gain = fit.energy / noise**2
    reasons = [""] * fit.poles.size
    for k in range(fit.poles.size):
        if not low <= frequency[k] <= high:
            reasons[k] = "outside the band"
        elif zeta[k] > MATHEMATICAL_DAMPING:
            reasons[k] = f"damping ratio above {MATHEMATICAL_DAMPING:g}"
        elif deviation[k] > LARGEST_DEVIATION:
            reasons[k] = (
                f"uncertain: the standard deviation of its frequency or decay is {deviation[k]:.2g} of its "
                f"half-power half-width, above {LARGEST_DEVIATION:g}"
            )
        elif gain[k] < needed:
            reasons[k] = (
                f"insignificant: it lowers the weighted sum of squares by {gain[k]:.3g}, and a mode must "
                f"do so by {needed:.3g}"
            )
    alike = np.ones((fit.poles.size, fit.poles.size), dtype=bool)
    for vectors in (fit.shapes, fit.participation.T):
        real = real_shapes(vectors)
        alike &= np.maximum(mac(vectors, vectors), mac(real, real)) > TWIN_MAC
    apart = np.abs(fit.poles[:, None] - fit.poles) / (width[:, None] + width)
    twins = np.triu(alike & (apart < TWIN_DISTANCE), 1) & (max(data.frf.H.shape[1:]) > 1)
    uncertain = deviation > LARGEST_DEVIATION
    # two copies of a mode make each other uncertain: the stronger one is tried again without the other
    sure = [k for k in range(fit.poles.size) if not reasons[k]]
    left = uncertain.copy()
    for i, j in np.argwhere(twins & uncertain & uncertain[:, None]):
        left[i if gain[i] < gain[j] else j] = False
    for k in np.flatnonzero(left & (twins | twins.T)[:, uncertain].any(axis=1)):
        if reasons[k].startswith("uncertain") and not (twins | twins.T)[k, sure].any():
            reasons[k] = ""
    for i, j in np.argwhere(twins):
        if not reasons[i] and not reasons[j]:
            weaker, other = (i, j) if gain[i] < gain[j] else (j, i)
            reasons[weaker] = f"a second copy of the mode at {frequency[other]:.4g} Hz"
    return reasons


def _complexity_reasons(task: _Task, fit: ModalFit) -> list[str]:
    """Return for each pole why its shape is too complex to be returned, or nothing.

    Such a pole stays in the fit: it describes the data, and others would bend to take its place.
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
    return out


# What is handed back ----------------------------------------------------------------------------------------


def _result(
    task: _Task,
    found: _State,
    points: tuple[tuple[int, int, int], ...],
    stabilisation: Stabilisation,
    choices: tuple[str, ...],
) -> IdentifiedModes:
    fit, data, turned = found.fitted, found.data.frf, task.turned
    size = np.abs(fit.poles)
    reasons = _complexity_reasons(task, fit)
    complex_ = np.array([bool(reason) for reason in reasons], dtype=bool)
    rising = np.argsort(size, kind="stable")
    rising = rising[~complex_[rising]]
    poles, psi, L = fit.poles[rising], fit.shapes[:, rising], fit.participation[rising]
    size, decay = size[rising], -poles.real
    if turned:
        psi, L, data = L.T, psi.T, _turned(data)
    phi, gamma = _scaled(poles, psi, L, points)
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
    tried = tuple(
        Candidate(abs(s.pole) / (2 * np.pi), -s.pole.real / abs(s.pole), s.n_orders, not reason, reason)
        for s, reason in zip(found.starts, reasons, strict=True)
    )
    sigma = found.data.scale[:, None] * found.data.spread[:, None, :]
    H, lower, upper = fit.H - synthesise(found.data, fit, complex_), fit.lower, fit.upper
    if turned:
        sigma, H, lower, upper = sigma.transpose(0, 2, 1), H.transpose(0, 2, 1), lower.T, upper.T
    candidates = tuple(sorted(tried + found.rejected, key=lambda c: c.frequency))
    power = (np.abs(data.H) ** 2).sum(axis=0)
    error = np.sqrt(
        np.divide((np.abs(H - data.H) ** 2).sum(axis=0), power, out=np.zeros(power.shape), where=power > 0)
    )
    return IdentifiedModes(
        Modes(frequency, real_shapes(phi), zeta, data.outputs),
        poles,
        gamma,
        phi,
        deviation[:, 0],
        deviation[:, 1],
        _shape_deviation(fit, rising, points, turned) * noise[::2],
        covariance,
        modal_phase_collinearity(phi),
        mean_phase_deviation(phi),
        modal_complexity_factor(phi),
        bool(points),
        tuple((data.outputs[i], data.inputs[j]) for i, j, _ in points),
        lower,
        upper,
        FRF.from_arrays(data.frequency, H, data.kind, data.outputs, data.inputs),
        error,
        sigma,
        stabilisation,
        candidates,
        choices,
        unexplained_peaks(data.frequency, data.H, H, sigma, candidates, stabilisation),
    )


def _scaled(
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


def _shape_deviation(
    fit: ModalFit, order: NDArray[np.int64], points: tuple[tuple[int, int, int], ...], turned: bool
) -> Floats:
    """Return standard deviations of the real, scaled shapes, (n_out, n_modes), the modes in an order.

    Linearised: differences of the scaled shape by each unknown of the mode, scale and mean phase included.
    """
    n_psi, scatter = len(fit.shapes), fit.scatter
    n_out = fit.participation.shape[1] if turned else n_psi
    out = np.zeros((n_out, order.size))
    for column, r in enumerate(order.tolist()):
        own = np.flatnonzero(scatter.rows == r)
        n_other = 2 + 2 * own.size
        m = n_other + 2 * n_psi
        size = float(np.abs(fit.shapes[:, r]).max()) or 1.0
        step = np.full(m, 1e-6)
        step[n_other:] *= size
        poles = np.full(m + 1, fit.poles[r])
        psi, L = (np.tile(x, (m + 1, 1)).astype(complex) for x in (fit.shapes[:, r], fit.participation[r]))
        decay = -fit.poles[r].real
        poles[1] = -decay * np.exp(step[0]) + 1j * fit.poles[r].imag
        poles[2] += 1j * decay * step[1]
        for k, i in enumerate(own):
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
        among = np.concatenate([[2 * r, 2 * r + 1], *((a, a + 1) for a in 2 * len(fit.poles) + 2 * own)])
        by_shape = J[:, n_other:].reshape(n_out, n_psi, 2)
        F = np.einsum("pob,obi->pi", by_shape, scatter.slope[r])
        F[:, among.astype(np.int64)] += J[:, :n_other]
        variance = np.einsum("pob,obc,poc->p", by_shape, scatter.own[r], by_shape, optimize=True)
        out[:, column] = np.sqrt(variance + np.einsum("pi,ij,pj->p", F, scatter.covariance, F, optimize=True))
    return out
