"""How far a model is from measured modes and FRFs, in standard deviations, with exact derivatives.

Both kinds of data give residuals r = (computed - measured) / σ and dr/dθ, of which
`updating.inference.update` sums the squares. No model is right to the last digit of a precise measurement:
errors of its own are part of both.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment

from fem.analysis.frf import FRF, FRFKind
from fem.analysis.frf_solver import compute_frf
from fem.analysis.modes import Eigenpairs, Modes, solve_eigenpairs
from fem.analysis.selection import Selection, dof_vectors
from fem.model import Damping, Model, ModelError, ParameterRef
from fem.reduction.parametric_frf import ParametricFRF
from fem.reduction.reduced_model import reduce_model
from fem.sensitivity.modes import differentiate_modes
from fem.system import System, assemble, reassemble
from updating.correlation import log_ratio, mac
from updating.inference.fit import EXPLAINED_LEVEL, counted_values, sensor_vectors
from updating.inference.parameters import DampingCurve
from updating.inference.preparation import counted_data
from updating.measurement.measurement import Measurement, Sensor
from updating.measurement.noise import relative_noise

Places = Selection | Sequence[Sensor] | Mapping[str, tuple[int, str]]
"""Where responses are measured: DOF numbers, (point, direction) pairs, rows (n, n_dof), sensors, or (point,
direction) by label."""

LEAST_MAC = 0.5
"""Measured modes whose best partner has less have lost it [-]."""

FAR = 0.5
"""Modes farther apart than this in ln f are no partners [-]."""

COMMON = 0.5
"""Part of the variance of a model's errors of frequencies that all modes share: too stiff throughout [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class ModeData:
    """Measured natural frequencies, and shapes if there are any.

    Attributes
    ----------
    frequency : ndarray (n,)
        Rising [Hz].
    covariance : ndarray (n, n)
        Of their logarithms, the model's error included [-].
    shapes : ndarray (n_out, n) or None
        Real, each of length 1; NaN where a mode was not measured.
    shape_std : ndarray (n,)
        Standard deviation of each component of a shape, relative to the root mean square of them all [-].
    rows : ndarray (n_dof, n_out)
        Sensors as combinations of DOFs.
    numbers : ndarray of int (n,) or None
        Which modes of the model at the start they are, counted from 0 without rigid-body modes: these are
        followed. Without numbers and shapes, modes belong together in the order of their frequencies.
    zeta : ndarray (n,) or None
        Damping ratios [-].
    close : float
        Modes whose frequencies differ by less than this, relatively, are compared as a space [-].
    """

    frequency: NDArray[np.float64]
    covariance: NDArray[np.float64]
    shapes: NDArray[np.float64] | None
    shape_std: NDArray[np.float64]
    rows: NDArray[np.float64]
    numbers: NDArray[np.int64] | None
    zeta: NDArray[np.float64] | None
    close: float

    def whitening(self, kept: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Return W (n, n) with W C Wᵀ = 1 for the modes kept, C their covariance; others are scaled alone."""
        W = np.diag(1 / np.sqrt(np.diag(self.covariance)))
        block = np.ix_(kept, kept)
        W[block] = np.linalg.inv(np.linalg.cholesky(self.covariance[block]))
        return W

    @property
    def n_data(self) -> int:
        """Number of independent residuals of frequencies and shapes: a shape's length says nothing."""
        n = len(self.frequency)
        return n if self.shapes is None else int(np.isfinite(self.shapes).sum())


@dataclass(frozen=True, slots=True, eq=False)
class ModePairs:
    """Measured modes and their partners.

    Attributes
    ----------
    partner : ndarray of int (n,)
        Computed mode of each measured one, rigid-body modes counted; -1 where it was lost.
    computed : ndarray (n,)
        Frequencies of the partners, NaN where lost [Hz].
    mac : ndarray (n,)
        Modal assurance criterion with the partner, or with the space of close modes it is in; NaN without
        shapes [-].
    spaces : tuple of tuple of int
        Sets of close computed modes that partners belong to.
    shapes : ndarray (n_dof, n_modes)
        All computed shapes, to follow them.
    """

    partner: NDArray[np.int64]
    computed: NDArray[np.float64]
    mac: NDArray[np.float64]
    spaces: tuple[tuple[int, ...], ...]
    shapes: NDArray[np.float64]

    @property
    def lost(self) -> tuple[int, ...]:
        """Measured modes without a partner, counted from 0."""
        return tuple(int(i) for i in np.flatnonzero(self.partner < 0))


def place_vectors(
    model: Model, places: Places, names: Sequence[str] | None = None
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Return places as columns (n_dof, n) and their labels; ``names`` picks labelled ones, in their order.

    Raises
    ------
    ModelError
        For a label without a place.
    """
    if isinstance(places, Mapping):
        names = tuple(places) if names is None else tuple(names)
        missing = [name for name in names if name not in places]
        if missing:
            msg = f"there is no place for {', '.join(missing[:6])}; places are given for {', '.join(places)}"
            raise ModelError(msg)
        return dof_vectors(model, [places[name] for name in names])[0], names
    sensors = [p for p in places if isinstance(p, Sensor)]
    if sensors:
        if len(sensors) != len(places):
            msg = f"{len(places) - len(sensors)} of {len(places)} places are no sensors; give one kind only"
            raise ModelError(msg)
        by_name = {s.name: s for s in sensors}
        if names is not None and set(names) <= set(by_name):
            sensors = [by_name[name] for name in names]
        return sensor_vectors(model, sensors), tuple(s.name for s in sensors)
    return dof_vectors(model, places)  # type: ignore[arg-type]


def mode_data(
    model: Model,
    frequency: ArrayLike | None = None,
    shapes: ArrayLike | None = None,
    *,
    modes: Modes | None = None,
    outputs: Places = (),
    numbers: Sequence[int] | None = None,
    frequency_std: ArrayLike = 1e-3,
    shape_std: ArrayLike = 0.03,
    model_error: float = 1e-3,
    close: float = 0.01,
) -> ModeData:
    """Check measured modes and place them on a model.

    Parameters
    ----------
    model : Model
    frequency : array_like (n,), optional
        Natural frequencies, without rigid-body modes [Hz].
    shapes : array_like (n_out, n), optional
        Shapes at the outputs; complex ones are turned to be as real as they can be. NaN is a gap: an output
        at which that mode was not measured.
    modes : Modes, optional
        Both, and damping ratios, in place of bare arrays; those with 0 Hz are left out.
    outputs : places
        Where the shapes are measured.
    numbers : sequence of int, optional
        Which of the model's elastic modes the frequencies belong to, counted from 0, where there are no
        shapes to tell.
    frequency_std, shape_std : float or array_like (n,)
        Standard deviations: of frequencies, relative [-]; of a component of a shape, relative to the root
        mean square of the shape [-].
    model_error : float
        Relative standard deviation with which even the right parameters meet a frequency; half of its
        variance is common to all [-].
    close : float
        Modes whose frequencies differ by less, relatively, are compared as a space [-].

    Raises
    ------
    ModelError
        If arrays do not fit one another, or values are not finite and positive.
    """
    labels: Sequence[str] | None = None
    zeta = None
    if modes is not None:
        elastic = modes.frequency > 0
        frequency, shapes = modes.frequency[elastic], modes.shapes[:, elastic]
        zeta = None if modes.zeta is None else np.asarray(modes.zeta, dtype=float)[elastic]
        labels = modes.labels or None
        if not shapes.shape[0]:
            shapes = None
    f = np.array(frequency, dtype=float, ndmin=1)
    if f.ndim != 1 or not f.size or not (np.isfinite(f) & (f > 0)).all():
        msg = f"the measured frequencies are {f.tolist()[:8]}; at least one is needed, all positive [Hz]"
        raise ModelError(msg)
    if shapes is None and numbers is None and (np.diff(f) < 0).any():
        msg = (
            f"the measured frequencies {f.tolist()[:8]} Hz do not rise; without shapes they are those of the "
            "model in their order: sort them, or say which modes they are (numbers=…)"
        )
        raise ModelError(msg)
    rows = np.zeros((model.n_dof, 0))
    psi = None
    if shapes is not None:
        rows, _ = place_vectors(model, outputs, labels)
        psi = np.asarray(shapes)
        if psi.shape != (rows.shape[1], f.size):
            msg = (
                f"the shapes have shape {psi.shape}; {rows.shape[1]} outputs and {f.size} frequencies need "
                f"({rows.shape[1]}, {f.size})"
            )
            raise ModelError(msg)
        if len(psi) < 2:
            msg = "a shape at one output says nothing; leave the shapes out"
            raise ModelError(msg)
        _check_gaps(psi, f)
        psi = _real(psi)
    if numbers is not None and len(numbers) != f.size:
        msg = f"{len(numbers)} numbers of modes are given for {f.size} frequencies"
        raise ModelError(msg)
    order = np.argsort(f, kind="stable")
    each = [np.broadcast_to(np.asarray(s, dtype=float), f.shape) for s in (frequency_std, shape_std)]
    if not all((np.isfinite(s) & (s >= 0)).all() for s in each) or not (each[0] + model_error > 0).all():
        msg = (
            "standard deviations must be finite and not negative, those of frequencies or the model's above 0"
        )
        raise ModelError(msg)
    return ModeData(
        f[order],
        np.diag(each[0][order] ** 2)
        + model_error**2 * (1 - COMMON) * np.eye(f.size)
        + model_error**2 * COMMON,
        None if psi is None else psi[:, order],
        np.maximum(each[1][order], 1e-6),
        rows,
        None if numbers is None else np.asarray(numbers, dtype=np.int64)[order],
        None if zeta is None or not (zeta > 0).all() else zeta[order],
        close,
    )


def _check_gaps(shapes: NDArray[np.number], frequency: NDArray[np.float64]) -> None:
    """Refuse infinite values, and modes that were measured at one output or none."""
    if np.isinf(shapes).any():
        i, k = np.argwhere(np.isinf(shapes))[0]
        msg = (
            f"the shape at {frequency[k]:.6g} Hz is infinite at output {i}, counted from 0; values are "
            "finite, or NaN where a mode was not measured"
        )
        raise ModelError(msg)
    n = (~np.isnan(shapes)).sum(axis=0)
    if (n < 2).any():
        k = int(np.argmin(n))
        msg = (
            f"the shape at {frequency[k]:.6g} Hz has values at {n[k]} of {len(shapes)} outputs; two or more "
            "are needed: leave the mode out"
        )
        raise ModelError(msg)


def _real(shapes: NDArray[np.number]) -> NDArray[np.float64]:
    """Return shapes of length 1, turned in the complex plane so that most of them is real; gaps stay NaN."""
    known = ~np.isnan(shapes)
    shapes = np.where(known, shapes, 0)
    turn = np.exp(-0.5j * np.angle((shapes**2).sum(axis=0)))
    out = np.real(shapes * turn)
    return np.where(known, out / np.maximum(np.linalg.norm(out, axis=0), 1e-300), np.nan)


@dataclass(frozen=True, slots=True, eq=False)
class ModePoint:
    """Modes at one set of parameter values, paired with the measured ones.

    Attributes
    ----------
    r : ndarray (m,)
        Residuals.
    pairs : ModePairs
    system : System
    eigenpairs : Eigenpairs
    """

    r: NDArray[np.float64]
    pairs: ModePairs
    system: System
    eigenpairs: Eigenpairs


def mode_residual(
    data: ModeData, model: Model, before: ModePairs | None = None, near: System | None = None
) -> ModePoint:
    """Compute modes, find the partners of the measured ones, and compare.

    Frequencies have W ln(f_computed / f_measured), W whitening their noise and the model's errors, half of
    whose variance is common to all. A shape ψ of length 1 has (1 - ΦΦ⁺) ψ √n_out/σ, with Φ the
    shape of its partner or those of the close modes that the partner is one of: what of ψ is not in their
    space, whose square is 1 - MAC for a single one. Nothing depends on how shapes are scaled, or on which
    basis of a space came out. Outputs at which a mode was not measured have no part in its sum and its n_out.

    Partners are chosen so that the sum of MAC less |ln f ratio| is largest, with a little more for the mode
    that a partner has become since ``before``. A mode without any partner counts with the largest residual
    that a paired one may have, so that losing one never pays.

    Parameters
    ----------
    data : ModeData
    model : Model
    before : ModePairs, optional
        Pairs at the last point.
    near : System, optional
        Matrices of a model that differs in some values: what is the same is not formed again.
    """
    system = assemble(model) if near is None else reassemble(near, model)
    top = float(data.frequency[-1]) * np.exp(FAR / 2)
    pairs = solve_eigenpairs(system, max_frequency=top)
    least = len(data.frequency) if data.numbers is None else int(data.numbers.max()) + 1
    n_highest = pairs.n_rigid + least + 6
    if len(pairs.eigenvalues) < n_highest:
        pairs = solve_eigenpairs(system, n_highest)
    shapes = np.asarray(system.Q @ pairs.vectors)
    f = np.sqrt(pairs.eigenvalues) / (2 * np.pi)
    n_rigid = pairs.n_rigid
    if data.shapes is None:
        found = _by_order(data, f, shapes, n_rigid, before, system)
    else:
        found = _by_shape(data, f, shapes, n_rigid, before, system)
    ok = found.partner >= 0
    with np.errstate(invalid="ignore"):
        log_f = np.where(ok, np.log(found.computed / data.frequency), FAR)
    parts = [data.whitening(ok) @ log_f]
    if data.shapes is not None:
        at = data.rows.T @ shapes
        known = np.isfinite(data.shapes)
        for i in range(len(data.frequency)):
            n_out = known[:, i].sum()
            if ok[i]:
                e = _beside(at[:, _space(found, i)], data.shapes[:, i])
            else:
                e = np.where(known[:, i], np.sqrt((1 - LEAST_MAC) / n_out), 0.0)
            parts.append(e * np.sqrt(n_out) / data.shape_std[i])
    return ModePoint(np.concatenate(parts), found, system, pairs)


def _space(pairs: ModePairs, i: int) -> list[int]:
    partner = int(pairs.partner[i])
    return next((list(s) for s in pairs.spaces if partner in s), [partner])


def _beside(Phi: NDArray[np.float64], psi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what of ψ is not in the space of Φ, over the outputs that ψ has; 0 at others."""
    known = np.isfinite(psi)
    out = np.zeros(len(psi))
    out[known] = psi[known] - Phi[known] @ np.linalg.lstsq(Phi[known], psi[known], rcond=1e-9)[0]
    return out


def _sets(f: NDArray[np.float64], n_rigid: int, close: float) -> list[list[int]]:
    """Return elastic modes in sets whose neighbours are closer than a relative distance."""
    sets: list[list[int]] = []
    for k in range(n_rigid, len(f)):
        if sets and f[k] - f[sets[-1][-1]] < close * f[k]:
            sets[-1].append(k)
        else:
            sets.append([k])
    return sets


def _by_order(
    data: ModeData,
    f: NDArray[np.float64],
    shapes: NDArray[np.float64],
    n_rigid: int,
    before: ModePairs | None,
    system: System,
) -> ModePairs:
    n = len(data.frequency)
    nothing = np.full(n, np.nan)
    if data.numbers is None:
        partner = np.arange(n) + n_rigid
    elif before is None:
        partner = data.numbers + n_rigid
    else:  # those that look like the last partners, in the product of the mass matrix
        follow = _followed(before.shapes[:, np.maximum(before.partner, 0)], shapes, system)
        follow[:, :n_rigid] = 0.0
        partner = linear_sum_assignment(-follow)[1].astype(np.int64)
    gone = partner >= len(f)
    partner = np.where(gone, -1, partner)
    computed = np.where(gone, np.nan, f[np.maximum(partner, 0)])
    spaces = tuple(tuple(s) for s in _sets(f, n_rigid, data.close) if len(s) > 1 and set(s) & set(partner))
    return ModePairs(partner, computed, nothing, spaces, shapes)


def _followed(old: NDArray[np.float64], new: NDArray[np.float64], system: System) -> NDArray[np.float64]:
    """Return (φ_oldᵀ M φ_new)², near 1 where a mode has become the other."""
    return np.square((system.Q.T @ old).T @ (system.M @ (system.Q.T @ new)))


def _by_shape(
    data: ModeData,
    f: NDArray[np.float64],
    shapes: NDArray[np.float64],
    n_rigid: int,
    before: ModePairs | None,
    system: System,
) -> ModePairs:
    assert data.shapes is not None
    at = data.rows.T @ shapes
    n = len(data.frequency)
    sets = _sets(f, n_rigid, data.close)
    likeness = mac(data.shapes, at)
    inside = np.zeros((n, len(f)))
    for s in sets:
        for i in range(n):
            e = _beside(at[:, s], data.shapes[:, i]) if len(s) > 1 else None
            inside[i, s] = likeness[i, s] if e is None else 1 - e @ e
    distance = np.abs(np.log(data.frequency[:, None] / np.maximum(f, 1e-300)))
    score = inside - distance + 1e-3 * likeness
    if before is not None:
        follow = _followed(before.shapes[:, np.maximum(before.partner, 0)], shapes, system)
        score = score + 0.1 * np.where((before.partner >= 0)[:, None], follow, 0.0)
    allowed = (inside >= LEAST_MAC) & (distance < FAR)
    allowed[:, :n_rigid] = False
    partner = np.full(n, -1)
    rows, columns = linear_sum_assignment(-np.where(allowed, score, -10.0))
    for i, j in zip(rows, columns, strict=True):
        if allowed[i, j]:
            partner[i] = j
    for s in sets:  # within a space modes follow the order of the frequencies
        mine = np.flatnonzero(np.isin(partner, s))
        partner[mine] = np.sort(partner[mine])
    ok = partner >= 0
    return ModePairs(
        partner,
        np.where(ok, f[np.maximum(partner, 0)], np.nan),
        np.where(ok, inside[np.arange(n), np.maximum(partner, 0)], likeness.max(axis=1, initial=0.0)),
        tuple(tuple(s) for s in sets if len(s) > 1 and set(s) & set(partner[ok])),
        shapes,
    )


def mode_jacobian(data: ModeData, point: ModePoint, refs: Sequence[ParameterRef]) -> NDArray[np.float64]:
    """Return the derivatives of the residuals of :func:`mode_residual`, shape (n_ref, m).

    d ln f = dω²/(2ω²). With P = ΦΦ⁺ the shape's is -(1 - P) dΦ Φ⁺ψ - Φ⁺ᵀ dΦᵀ (1 - P) ψ (Golub and Pereyra,
    *SIAM J. Numer. Anal.* 10, 1973, 413, (4.12)).
    """
    pairs, eigen = point.pairs, point.eigenpairs
    used = [k for i in range(len(pairs.partner)) if pairs.partner[i] >= 0 for k in _space(pairs, i)]
    J = np.zeros((len(refs), point.r.size))
    if not used or not refs:
        return J
    n = max(used) + 1
    if n >= len(eigen.eigenvalues):
        eigen = solve_eigenpairs(point.system, min(n + max(6, n // 4), point.system.n_free))
    outputs = None if data.shapes is None else data.rows.T
    given = eigen if n < len(eigen.eigenvalues) else None
    s = differentiate_modes(
        point.system, refs, n, outputs=outputs, pairs=given, close=2 * data.close, tolerance=1e-6
    )
    n_modes = len(pairs.partner)
    for i in range(n_modes):
        k = int(pairs.partner[i])
        if k < 0:
            continue
        J[:, i] = s.eigenvalue[:, k] / (2 * (2 * np.pi * pairs.computed[i]) ** 2)
        if data.shapes is None or s.shapes is None:
            continue
        columns = _space(pairs, i)
        known = np.flatnonzero(np.isfinite(data.shapes[:, i]))
        Phi = (data.rows.T @ s.modes.shapes[:, columns])[known]
        plus = np.linalg.pinv(Phi, rcond=1e-9)
        psi = data.shapes[known, i]
        e = psi - Phi @ (plus @ psi)
        at = n_modes + i * len(data.shapes) + known
        for p in range(len(refs)):
            d = s.shapes[p][np.ix_(known, np.array(columns))]
            moved = d @ (plus @ psi)
            de = -(moved - Phi @ (plus @ moved)) - plus.T @ (d.T @ e)
            J[p, at] = de * np.sqrt(len(known)) / data.shape_std[i]
    J[:, :n_modes] = J[:, :n_modes] @ data.whitening(pairs.partner >= 0).T
    return J


# -------------------------------------------------------------------------------------------------- FRFs


@dataclass(frozen=True, slots=True, eq=False)
class FRFData:
    """Measured receptances on a model.

    Attributes
    ----------
    frequency : ndarray (n_freq,)
        Lines [Hz].
    H : ndarray of complex (n_freq, n_out, n_in)
        Receptances; 1 where masked.
    mask : ndarray of bool (n_freq, n_out, n_in)
        Values that count.
    noise : ndarray (n_freq, n_out, n_in)
        Standard deviation of ln|H|, and of the phase [-].
    outputs, inputs : ndarray (n_dof, n_out), (n_dof, n_in)
        Places as combinations of DOFs.
    model_error : float
        Relative standard deviation with which even the right parameters meet a natural frequency [-].
    amplitude_error : float
        The same of an amplitude, calibration included [-].
    """

    frequency: NDArray[np.float64]
    H: NDArray[np.complex128]
    mask: NDArray[np.bool_]
    noise: NDArray[np.float64]
    outputs: NDArray[np.float64]
    inputs: NDArray[np.float64]
    model_error: float
    amplitude_error: float

    def lines(self, highest: float, n: int) -> "FRFData":
        """Return at most n evenly spread lines up to a frequency."""
        which = np.flatnonzero(self.frequency <= highest * (1 + 1e-9))
        if len(which) > n:
            which = which[np.unique(np.linspace(0, len(which) - 1, n).round().astype(int))]
        return replace(
            self,
            frequency=self.frequency[which],
            H=self.H[which],
            mask=self.mask[which],
            noise=self.noise[which],
        )


def frf_data(
    model: Model,
    frf: FRF | Measurement | ArrayLike,
    *,
    lines: ArrayLike | None = None,
    outputs: Places | None = None,
    inputs: Places | None = None,
    kind: FRFKind | str = FRFKind.ACCELERANCE,
    band: tuple[float, float] | None = None,
    noise: ArrayLike | None = None,
    model_error: float = 1e-3,
    amplitude_error: float = 0.01,
    form_error: float = EXPLAINED_LEVEL,
) -> FRFData:
    """Check measured FRFs and place them on a model.

    The values that count are those of every comparison (:func:`updating.inference.fit.counted_values`): not
    those of FRFs that symmetry makes zero, nor those that noise hides.

    Parameters
    ----------
    model : Model
    frf : FRF, Measurement or array_like (n_freq, n_out, n_in)
        A measurement brings its sensors along. NaN is where nothing was measured, in bare arrays.
    lines : array_like (n_freq,)
        Frequencies of a bare array [Hz].
    outputs, inputs : places
    kind : FRFKind or str
        Of a bare array.
    band : (float, float), optional
        Lines that count [Hz].
    noise : float or array_like, optional
        Relative standard deviation of the real and of the imaginary part, one number or one that broadcasts
        to the array; that of the measurement, or else estimated from the roughness of the lines, unless given
        [-].
    form_error : float
        Residual level up to which a model counts as right, because beams are not the structure itself: 0 if
        readings have nothing of what moves square to their sensors. For measurements only [nepers].
    model_error, amplitude_error : float
        What even the right parameters miss: natural frequencies, and amplitudes with their calibration,
        relative [-].

    Raises
    ------
    ModelError
        If places are missing or do not fit, or nothing is left.
    """
    if isinstance(frf, Measurement) and outputs is None and inputs is None:
        measurement = frf
        if noise is not None:
            measurement = replace(frf, scatter=_level_of(noise, frf.frf.H.shape))
        lines_in_band(frf.frf, band)
        data = counted_data(model, measurement, band, form_error)
        rows, columns = (sensor_vectors(model, s) for s in (frf.sensors, frf.excitations))
        return _counted(
            data.frequency, data.H, data.mask, data.uncertain, rows, columns, model_error, amplitude_error
        )
    if isinstance(frf, Measurement):
        outputs = frf.sensors if outputs is None else outputs
        inputs = frf.excitations if inputs is None else inputs
        noise = frf.noise if noise is None else noise
        frf = frf.frf
    labelled = isinstance(frf, FRF)
    if not isinstance(frf, FRF):
        if lines is None:
            msg = "bare FRFs need their lines [Hz]: lines=…"
            raise ModelError(msg)
        H = np.array(frf, dtype=complex)
        frf = FRF.from_arrays(lines, np.where(np.isfinite(H), H, 0.0), kind)
        seen = np.isfinite(H).reshape(frf.H.shape)
        if noise is not None and H.ndim < 3 and np.shape(noise) == H.shape:
            noise = np.reshape(noise, frf.H.shape)
    else:
        seen = np.ones(frf.H.shape, dtype=bool)
    if outputs is None or inputs is None:
        msg = "FRFs need the places of their responses and forces: outputs=…, inputs=…"
        raise ModelError(msg)
    rows, _ = place_vectors(model, outputs, frf.outputs if labelled else None)
    columns, _ = place_vectors(model, inputs, frf.inputs if labelled else None)
    if frf.H.shape[1:] != (rows.shape[1], columns.shape[1]):
        msg = (
            f"the FRFs have shape {frf.H.shape}, but {rows.shape[1]} outputs and {columns.shape[1]} inputs "
            "have places"
        )
        raise ModelError(msg)
    level = relative_noise(frf.H) if noise is None else _level_of(noise, frf.H.shape)
    keep = lines_in_band(frf, band)
    frf, seen, level = frf.select(lines=keep), seen[keep], level[keep]
    level = np.where(np.isnan(level), relative_noise(frf.H), level)
    if not (level >= 0).all():
        msg = "the noise must not be negative: the relative standard deviation [-]"
        raise ModelError(msg)
    computed = _computed(model, rows, columns, frf.frequency)
    mask = seen & counted_values(frf, level, computed)
    H = frf.as_kind("receptance").H
    return _counted(frf.frequency, H, mask, level, rows, columns, model_error, amplitude_error)


def lines_in_band(frf: FRF, band: tuple[float, float] | None) -> NDArray[np.bool_]:
    """Return which lines lie above 0 Hz and in a band.

    Raises
    ------
    ModelError
        If none does.
    """
    low, high = band if band is not None else (0.0, np.inf)
    keep = (frf.frequency > 0) & (frf.frequency >= low) & (frf.frequency <= high)
    if not keep.any():
        msg = f"no line lies in the band; the data cover {frf.frequency[0]:g} to {frf.frequency[-1]:g} Hz"
        raise ModelError(msg)
    return keep


def _level_of(noise: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    given = np.asarray(noise, dtype=float)
    try:
        level = np.broadcast_to(given, shape)
    except ValueError:
        msg = f"the noise has shape {given.shape}; a number or that of the FRFs, {shape}, is needed"
        raise ModelError(msg) from None
    if np.isinf(level).any() or (level < 0).any():
        msg = "the noise must be finite and not negative: the relative standard deviation [-]"
        raise ModelError(msg)
    return level


def _computed(
    model: Model, rows: NDArray[np.float64], columns: NDArray[np.float64], frequency: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Return receptances of the model as it is: of the size that tells which are zero by symmetry."""
    reduced = reduce_model(model, np.hstack([rows, columns]), float(frequency[-1]), releasable=False)
    engine = ParametricFRF(reduced, rows, columns, frequency, ())
    return engine.evaluate(np.zeros(0), model.damping.ratio_at(frequency), False)[0]


def _counted(
    frequency: NDArray[np.float64],
    H: NDArray[np.complex128],
    mask: NDArray[np.bool_],
    noise: NDArray[np.float64],
    rows: NDArray[np.float64],
    columns: NDArray[np.float64],
    model_error: float,
    amplitude_error: float,
) -> FRFData:
    if not mask.any():
        msg = "no FRF value is left: all are zero or nothing but noise"
        raise ModelError(msg)
    return FRFData(
        frequency, np.where(mask, H, 1.0), mask, np.maximum(np.where(mask, noise, 1.0), 1e-6), rows, columns,
        model_error, amplitude_error,
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class FRFTerms:
    """Residuals of FRFs and their derivatives.

    Attributes
    ----------
    r : ndarray of complex (m,)
        ln(H_computed / H_measured) of the values that count [nepers and rad].
    weight : ndarray (m,)
        1/σ.
    by_values, by_ratios, by_shifts, by_gains : ndarray of complex (k, m) or None
        Derivatives of r.
    """

    r: NDArray[np.complex128]
    weight: NDArray[np.float64]
    by_values: NDArray[np.complex128] | None = None
    by_ratios: NDArray[np.complex128] | None = None
    by_shifts: NDArray[np.complex128] | None = None
    by_gains: NDArray[np.complex128] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class _OwnDamping:
    """A model's damping beside the engine's.

    Attributes
    ----------
    offset : ndarray of complex (n_freq, n_out, n_in)
        ln(H/H_engine) at the model's values.
    ratios : ndarray (n_knots,)
        There [-].
    by_ratios : ndarray of complex (n_knots, n_freq, n_out, n_in)
        Derivatives of ln H by them.
    """

    offset: NDArray[np.complex128]
    ratios: NDArray[np.float64]
    by_ratios: NDArray[np.complex128]


class FRFResidual:
    """Logarithmic residuals of FRFs on a reduced basis: after it is built nothing depends on the mesh.

    r = ln(g_i g_j H_computed(f (1 + δ(f))) / H_measured(f)): the real part is the amplitude's, the imaginary
    part the phase's, both with the standard deviation of the relative noise. δ, linear between the modes'
    frequencies, and g, one for each output and input, are what even the right parameters miss: a shifted
    resonance moves all lines beside it at once, which no error of single lines could stand for.

    Parameters
    ----------
    data : FRFData
        With the lines to be fitted.
    model : Model
        The basis is made for its values: exact there, and near them.
    refs : sequence of (effect, parameter)
    ratio_knots, shift_knots : ndarray or None
        Frequencies between which modal damping ratios and δ are linear [Hz].
    exact : bool
        Whether ln(H/H_engine) at the model's values is added: the engine takes a modal ratio as 2iζ(ω)K,
        which is the same at resonances alone. Near these values FRFs then are the model's own.
    """

    def __init__(
        self,
        data: FRFData,
        model: Model,
        refs: Sequence[ParameterRef],
        ratio_knots: NDArray[np.float64] | None = None,
        shift_knots: NDArray[np.float64] | None = None,
        *,
        margin: float = 2.5,
        n_krylov: int = 3,
        exact: bool = False,
    ) -> None:
        highest = float(data.frequency[-1])
        forces = np.hstack([data.outputs, data.inputs])
        self.data, self.refs, self.model = data, tuple(refs), model
        self.reduced = reduce_model(
            model, forces, highest, margin=margin, n_krylov=n_krylov, releasable=False
        )
        self.ratio_hats = None if ratio_knots is None else _hats(ratio_knots, data.frequency)
        self.shift_hats = None if shift_knots is None else _hats(shift_knots, data.frequency)
        self._engine = self._engine_at(data.frequency)
        self._own = self._own_damping(ratio_knots) if exact else None

    def _own_damping(self, knots: NDArray[np.float64] | None) -> "_OwnDamping":
        """Return the model's damping beside the engine's, by the modes of the basis, which are its own."""
        d, known, damping = self.data, self.model.values(), self.model.damping
        values = np.array([known[ref] for ref in self.refs], dtype=float)
        H_engine = self._engine.evaluate(values, damping.ratio_at(d.frequency), False)[0]
        H = compute_frf(assemble(self.model), d.frequency, d.outputs.T, d.inputs.T, FRFKind.RECEPTANCE).H
        offset = np.nan_to_num(log_ratio(H, H_engine), nan=0.0)
        if knots is None:
            return _OwnDamping(offset, np.zeros(0), np.zeros((0, *H.shape), dtype=complex))
        basis = self.reduced.basis
        elastic = slice(basis.n_rigid, basis.n_modes)
        square = np.maximum(np.diag(self.reduced.base_sum["K"])[elastic], 1e-300)
        omega_r, omega = np.sqrt(square), 2 * np.pi * d.frequency[:, None]
        f_r = omega_r / (2 * np.pi)
        damped = 2 * damping.ratio_at(f_r) * omega_r + damping.alpha + damping.beta * square
        below = square * (1 + 1j * damping.loss_factor) - omega**2 + 1j * omega * damped
        slope = -2j * omega * omega_r / below**2  # of a mode's part of H, by its ratio
        out, into = (basis.T[:, elastic].T @ part for part in (d.outputs, d.inputs))
        per = np.divide(1.0, H, out=np.zeros_like(H), where=H != 0)
        by_ratios = np.array(
            [((slope * hat)[:, :, None] * out).transpose(0, 2, 1) @ into * per for hat in _hats(knots, f_r).T]
        )
        return _OwnDamping(offset, damping.ratio_at(knots), by_ratios)

    def _engine_at(self, frequency: NDArray[np.float64]) -> ParametricFRF:
        return ParametricFRF(self.reduced, self.data.outputs, self.data.inputs, frequency, self.refs)

    @property
    def n_data(self) -> int:
        """Number of real residuals."""
        return 2 * int(self.data.mask.sum())

    def seen(self, least: float = 1e-3) -> NDArray[np.float64]:
        """Return the natural frequencies in the band that forces excite and outputs show [Hz].

        Parameters
        ----------
        least : float
            Modes with less than this part of the largest product of shapes are left out [-].
        """
        basis, d = self.reduced.basis, self.data
        elastic = slice(basis.n_rigid, basis.n_modes)
        f = np.sqrt(np.maximum(np.diag(self.reduced.base_sum["K"])[elastic], 0.0)) / (2 * np.pi)
        product = np.abs(basis.T[:, elastic].T @ d.outputs).max(axis=1) * np.abs(
            basis.T[:, elastic].T @ d.inputs
        ).max(axis=1)
        inside = (f >= d.frequency[0]) & (f <= d.frequency[-1])
        return f[inside & (product > least * product.max(initial=0.0))]

    def evaluate(
        self,
        values: NDArray[np.float64],
        gradient: bool,
        *,
        ratios: NDArray[np.float64] | None = None,
        shifts: NDArray[np.float64] | None = None,
        gains: NDArray[np.float64] | None = None,
    ) -> FRFTerms:
        """Compute residuals and derivatives.

        Parameters
        ----------
        values : ndarray (n_ref,)
            Values of ``refs``.
        gradient : bool
        ratios : ndarray (n_knots,), optional
            Damping ratios at the knots; the model's unless given [-].
        shifts : ndarray (n_knots,), optional
            δ at the knots [-].
        gains : ndarray (n_out + n_in,), optional
            ln g_i of outputs, then ln g_j of inputs [-].
        """
        d, keep = self.data, self.data.mask
        zeta = self.model.damping.ratio_at(d.frequency)
        own = self._own
        if ratios is not None and self.ratio_hats is not None and own is None:
            zeta = self.ratio_hats @ ratios
        engine, lines = self._engine, d.frequency
        if shifts is not None and self.shift_hats is not None and shifts.any():
            lines = d.frequency * (1 + self.shift_hats @ shifts)
            engine = self._engine_at(lines)
        H, dH, dH_dzeta = engine.evaluate(values, zeta, gradient)
        r = log_ratio(H, d.H)
        if own is not None:
            r = r + own.offset
            if ratios is not None and len(own.ratios):
                r = r + np.tensordot(ratios - own.ratios, own.by_ratios, axes=1)
        n_out = d.outputs.shape[1]
        if gains is not None:
            r = r + gains[:n_out, None] + gains[n_out:]
        r = np.nan_to_num(r, nan=0.0)[keep]
        weight = (1 / d.noise)[keep]
        if not gradient or dH is None or dH_dzeta is None:
            return FRFTerms(r, weight)
        per = np.divide(1.0, H, out=np.zeros_like(H), where=H != 0)
        by_values = np.array([(slope * per)[keep] for slope in dH]).reshape(len(dH), r.size)
        by_ratios = by_shifts = by_gains = None
        if ratios is not None and self.ratio_hats is not None:
            base = dH_dzeta * per
            by_ratios = (
                np.array([(hat[:, None, None] * base)[keep] for hat in self.ratio_hats.T])
                if own is None
                else own.by_ratios[:, keep]
            )
        if shifts is not None and self.shift_hats is not None:
            step = 3e-8  # between the curvature of the logarithm and rounding
            ahead = self._engine_at(lines + step * d.frequency).evaluate(values, zeta, False)[0]
            slope = np.nan_to_num(log_ratio(ahead, H), nan=0.0) / step
            by_shifts = np.array([(hat[:, None, None] * slope)[keep] for hat in self.shift_hats.T])
        if gains is not None:
            one = np.eye(len(gains), dtype=complex)
            sums = one[:, :n_out, None] + one[:, None, n_out:]
            by_gains = np.array([np.broadcast_to(part, H.shape)[keep] for part in sums])
        return FRFTerms(r, weight, by_values, by_ratios, by_shifts, by_gains)


def _hats(knots: NDArray[np.float64], frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    return DampingCurve(knots, knots, 1.0).hats(frequency)


def with_ratios(model: Model, knots: NDArray[np.float64], ratios: NDArray[np.float64]) -> Model:
    """Return a model with other modal damping ratios; its other damping stays."""
    d = model.damping
    return model.with_damping(Damping(knots, ratios, d.alpha, d.beta, d.loss_factor))
