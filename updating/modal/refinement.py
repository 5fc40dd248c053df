"""Modal parameters of greatest likelihood: Gauss-Newton steps for poles, least squares for shapes.

    H_oi(ω) = (iω)^d { Σ_r [ψ_or L_ri/(iω - λ_r) + ψ_or* L_ri*/(iω - λ_r*)] - lower_oi/ω² + upper_oi }

with d = 0, 1, 2 for receptance, mobility, accelerance; s in place of iω after an exponential window. Given
poles λ and participations L, the shapes ψ and the real residuals are a linear least squares problem, with the
same matrix B for each output. What is left depends on λ and L alone (variable projection: Golub and Pereyra,
*SIAM J. Numer. Anal.* 10, 1973, 413, in Kaufman's form, *BIT* 15, 1975, 49), and its derivatives for all
outputs follow from one Gram matrix.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as sla
from numpy.typing import NDArray

from fem.analysis.frf import FRF

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

_CONVERGED = 1e-3
"""A step that lowers the sum of squares by less than this, relative to its mean for one value, is the last:
on the scale on which a parameter that is wrong by its standard deviation raises it by 1."""

_BLOCK = 2048
"""Lines that are computed at a time."""

_TALL = 1e8
"""Products in BᵀB beyond which B is made orthogonal by them."""

_WELL_CONDITIONED = 1e-5
"""Least diagonal of R, of columns of length 1, for which that is as good as reflections [-]."""

_NEAR = 3.0
"""Lines within this many half-power half-widths of a pole tell the scatter of the FRFs near it."""


@dataclass(frozen=True, slots=True, eq=False)
class Scatter:
    """Covariance of shapes: of (Re ψ_o, Im ψ_o) it is own_o + slope_o · covariance · slope_oᵀ.

    Attributes
    ----------
    covariance : ndarray (n, n)
        Of the unknowns besides the shapes: (ln -Re λ, Im λ / -Re λ) mode by mode, then the real and the
        imaginary part of each participation but the largest of its mode.
    rows, cols : ndarray of int (n - 2 n_modes over 2,)
        Modes and inputs of these participations.
    own : ndarray (n_modes, n_out, 2, 2)
        With the other unknowns known.
    slope : ndarray (n_modes, n_out, 2, n)
        Derivatives by the other unknowns.
    """

    covariance: Floats
    rows: NDArray[np.int64]
    cols: NDArray[np.int64]
    own: Floats
    slope: Floats


@dataclass(frozen=True, slots=True, eq=False)
class ModalFit:
    """Poles, participations, shapes and residuals that fit FRFs.

    Attributes
    ----------
    poles : ndarray of complex (n_modes,)
        [rad/s].
    participation : ndarray of complex (n_modes, n_in)
        The largest entry of each row is 1.
    shapes : ndarray of complex (n_out, n_modes)
        ψ, the residue of a receptance being ψ_or L_ri [m/(N s)].
    lower, upper : ndarray (n_out, n_in)
        Residuals of modes below the band [1/kg] and above it [m/N]; 0 if not asked for.
    H : ndarray of complex (n_freq, n_out, n_in)
        What was fitted, synthesised [unit of the FRF].
    misfit : ndarray of complex (n_freq, n_out, n_in)
        (measured - synthesised) over the standard deviation that was assumed [-].
    covariance : ndarray (2 n_modes, 2 n_modes)
        Of (ln -Re λ, Im λ / -Re λ), mode by mode: relative to the decay [-].
    scatter : Scatter
        Of shapes and of all that they depend on.
    energy : ndarray (n_modes,)
        Rise of the sum of squares of ``misfit`` if the mode is left out and all the rest stays free but the
        poles [-].
    n_parameters : int
        Of one mode.
    converged : bool
    n_steps : int
    """

    poles: Complexes
    participation: Complexes
    shapes: Complexes
    lower: Floats
    upper: Floats
    H: Complexes
    misfit: Complexes
    covariance: Floats
    scatter: Scatter
    energy: Floats
    n_parameters: int
    converged: bool
    n_steps: int


@dataclass(frozen=True, slots=True, eq=False)
class FitData:
    """FRFs with the weights of their fit.

    Attributes
    ----------
    frf : FRF
    scale : ndarray (n_out,)
        Standard deviation of each output [unit of the FRF].
    spread : ndarray (n_freq, n_in)
        By what that is multiplied at each line and input [-].
    lower, upper : bool
        Whether there are residuals of modes below and above the band.
    added_decay : float
        What an exponential window added to the decay of all motions: the FRFs are those at s = iω + this
        [1/s].
    """

    frf: FRF
    scale: Floats
    spread: Floats
    lower: bool = True
    upper: bool = True
    added_decay: float = 0.0

    @property
    def s(self) -> Complexes:
        """Laplace's variable at the lines, shape (n_freq,) [1/s]."""
        return np.asarray(1j * self.frf.omega + self.added_decay, dtype=complex)

    @property
    def target(self) -> Floats:
        """Weighted FRFs as real columns, one for each output, shape (2 n_in n_freq, n_out)."""
        return self.columns(self.frf.H.transpose(2, 0, 1)) / self.scale

    def columns(self, values: Complexes) -> Floats:
        """Return values (n_in, n_freq, n) over the spread, real above imaginary parts."""
        weighted = (values / self.spread.T[:, :, None]).reshape(self.spread.size, values.shape[2])
        return np.vstack([weighted.real, weighted.imag])

    def values(self, columns: Floats) -> Complexes:
        """Return the inverse of :meth:`columns` without the spread, shape (n_freq, n, n_in)."""
        n = self.spread.size
        shape = (self.spread.shape[1], self.spread.shape[0], columns.shape[1])
        weighted = (columns[:n] + 1j * columns[n:]).reshape(shape)
        return weighted.transpose(1, 2, 0)


@dataclass(frozen=True, slots=True, eq=False)
class _Linear:
    """The linear problem at given poles and participations."""

    B: Floats
    norms: Floats
    Q: Floats
    R: Floats
    x: Floats
    rest: Floats

    @property
    def square(self) -> float:
        return float((self.rest**2).sum())

    def shapes(self, n: int) -> Floats:
        """Return Re ψ and Im ψ over the outputs' scale, shape (n_modes, 2, n_out)."""
        return self.x[: 2 * n].reshape(n, 2, self.x.shape[1])


def fit_modes(data: FitData, poles: Complexes, participation: Complexes, most_steps: int = 60) -> ModalFit:
    """Find the poles and participations nearest to given ones that fit FRFs best.

    Steps are Gauss and Newton's, damped after Levenberg and Marquardt. The covariance has all linear unknowns
    free, and in each FRF the noise that the fit leaves.
    """
    poles = np.array(poles, dtype=complex)
    L: Complexes = np.array(participation, dtype=complex)
    pivot = np.argmax(np.abs(L), axis=1)
    L = L / L[np.arange(len(L)), pivot][:, None]
    target = data.target
    now = _solve(data, target, poles, L)
    rounding = 1e-28 * float((target**2).sum())
    damping, converged, step = 1e-6, False, 0
    J2, gradient = _normal_equations(data, now, poles, L, pivot)
    while poles.size and step < most_steps and not converged:
        step += 1
        size = np.sqrt(np.maximum(J2.diagonal(), 1e-300))
        scaled = J2 / np.outer(size, size)
        move = np.linalg.solve(scaled + damping * np.eye(len(scaled)), gradient / size) / size
        n = 2 * poles.size
        decay = -poles.real
        change = np.clip(move[:n].reshape(-1, 2), -0.5, 0.5)
        new_poles = -decay * np.exp(change[:, 0]) + 1j * (poles.imag + decay * change[:, 1])
        new_L = L.copy()
        rows, cols = _free(L.shape, pivot)
        new_L[rows, cols] += move[n::2] + 1j * move[n + 1 :: 2]
        trial = _solve(data, target, new_poles, new_L)
        if trial.square <= now.square:
            gain = now.square - trial.square
            converged = gain <= max(_CONVERGED * now.square / target.size, rounding)
            poles, L, now, damping = new_poles, new_L, trial, max(damping / 10, 1e-12)
            J2, gradient = _normal_equations(data, now, poles, L, pivot)
        else:
            damping = max(10 * damping, 1e-6)
            converged = damping > 1e6
    return _fit(data, now, poles, L, pivot, converged, step)


def _free(shape: tuple[int, ...], pivot: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return rows and columns of the participations that are unknown: all but the largest of each mode."""
    rows, cols = np.indices(shape)
    keep = cols != pivot[:, None]
    return rows[keep], cols[keep]


def _factor(data: FitData) -> Complexes:
    """Return s^d."""
    return np.asarray(data.s**data.frf.kind.derivatives, dtype=complex)


def _fractions(data: FitData, poles: Complexes) -> tuple[Complexes, Complexes]:
    """Return s^d/(s - λ) and s^d/(s - λ*), shape (n_freq, n_modes)."""
    s = data.s[:, None]
    g = _factor(data)[:, None]
    return g / (s - poles), g / (s - poles.conj())


def _pairs(p: Complexes, q: Complexes, L: Complexes) -> Complexes:
    """Return what multiplies Re ψ and Im ψ, shape (n_in, n_freq, 2 n_modes)."""
    out = np.empty((L.shape[1], p.shape[0], 2 * p.shape[1]), dtype=complex)
    for i in range(L.shape[1]):
        one, two = p * L[:, i], q * L[:, i].conj()
        out[i, :, 0::2], out[i, :, 1::2] = one + two, 1j * (one - two)
    return out


def _solve(data: FitData, target: Floats, poles: Complexes, L: Complexes) -> _Linear:
    n_freq, n_in = data.spread.shape
    n_columns = 2 * poles.size + n_in * (int(data.lower) + int(data.upper))
    whole = np.empty((2, n_in, n_freq, n_columns))
    for lines, part in _blocks(data):
        whole[:, :, lines] = _basis(part, poles, L).reshape(2, n_in, -1, n_columns)
    B = whole.reshape(-1, n_columns)
    norms = np.maximum(np.linalg.norm(B, axis=0), 1e-300)
    Q, R = _orthogonal(B / norms)
    y = Q.T @ target
    x = _back(R, y) / norms[:, None]
    return _Linear(B, norms, Q, R, x, target - Q @ y)


def _blocks(data: FitData) -> Iterator[tuple[slice, FitData]]:
    """Yield the data by blocks of lines: large temporary arrays cost more than what is computed."""
    n_freq = len(data.spread)
    if n_freq <= _BLOCK:
        yield slice(0, n_freq), data
        return
    for first in range(0, n_freq, _BLOCK):
        lines = slice(first, min(first + _BLOCK, n_freq))
        frf = data.frf.select(lines=np.arange(lines.start, lines.stop))
        yield lines, replace(data, frf=frf, spread=data.spread[lines])


def _basis(data: FitData, poles: Complexes, L: Complexes) -> Floats:
    """Return the columns of the linear problem, over the spread."""
    n_freq, n_in = data.spread.shape
    parts = [_pairs(*_fractions(data, poles), L)]
    g = _factor(data)
    for wanted, values in ((data.lower, g / data.s**2), (data.upper, g)):
        if wanted:
            static = np.zeros((n_in, n_freq, n_in), dtype=complex)
            static[np.arange(n_in), :, np.arange(n_in)] = values
            parts.append(static)
    return data.columns(np.concatenate(parts, axis=2))


def _orthogonal(B: Floats) -> tuple[Floats, Floats]:
    """Return Q and R with B = QR: of a very tall, well-conditioned B by its normal equations, twice.

    The second pass makes Q orthogonal to rounding if the condition number is below 1/√ε (Yamamoto,
    Nakatsukasa, Yanagisawa and Fukaya, *Electron. Trans. Numer. Anal.* 44, 2015, 306); products take a
    fraction of the time of reflections.
    """
    if B.size * B.shape[1] > _TALL:
        try:
            Q, first = _half_orthogonal(B)
            if np.abs(first.diagonal()).min() > _WELL_CONDITIONED:
                Q, second = _half_orthogonal(Q)
                return Q, second @ first
        except np.linalg.LinAlgError:
            pass
    Q, R = sla.qr(B, mode="economic")
    return Q, R


def _half_orthogonal(B: Floats) -> tuple[Floats, Floats]:
    R = sla.cholesky(B.T @ B)
    return B @ sla.solve_triangular(R, np.eye(len(R))), R


def _back(R: Floats, y: Floats) -> Floats:
    """Return R⁻¹y, of least size where R has no rank."""
    x = sla.solve_triangular(R, y) if _regular(R) else np.linalg.lstsq(R, y, rcond=1e-13)[0]
    return np.asarray(x, dtype=float)


def _derivatives(
    data: FitData, poles: Complexes, L: Complexes, pivot: NDArray[np.int64]
) -> tuple[Floats, NDArray[np.int64]]:
    """Return dB of (ln decay, frequency over decay) of the modes and of the free participations.

    Columns go in twos, for Re ψ and Im ψ of the mode that the second value names for each unknown.
    """
    n_freq, n_in = data.spread.shape
    n, (rows, cols) = poles.size, _free(L.shape, pivot)
    p, q = _fractions(data, poles)
    s, decay = data.s[:, None], -poles.real
    p2, q2 = p / (s - poles), q / (s - poles.conj())
    D = np.zeros((n_in, n_freq, n + rows.size, 2, 2), dtype=complex)  # …, unknown, its two parts, ψ's parts
    D[:, :, :n, 0] = _pairs(-decay * p2, -decay * q2, L).reshape(n_in, n_freq, n, 2)
    D[:, :, :n, 1] = _pairs(1j * decay * p2, -1j * decay * q2, L).reshape(n_in, n_freq, n, 2)
    for k, (mode, column) in enumerate(zip(rows, cols, strict=True), start=n):
        a, b = p[:, mode], q[:, mode]
        D[column, :, k, 0, 0], D[column, :, k, 0, 1] = a + b, 1j * (a - b)
        D[column, :, k, 1, 0], D[column, :, k, 1, 1] = 1j * (a - b), -(a + b)
    columns = data.columns(D.reshape(n_in, n_freq, 4 * (n + rows.size)))
    return columns, np.repeat(np.concatenate([np.arange(n), rows]), 2)


def _normal_equations(
    data: FitData, now: _Linear, poles: Complexes, L: Complexes, pivot: NDArray[np.int64]
) -> tuple[Floats, Floats]:
    """Return JᵀJ and -Jᵀr of what :func:`_derivatives` differentiates by."""
    n_freq, n_in = data.spread.shape
    Q, rest = (values.reshape(2, n_in, n_freq, -1) for values in (now.Q, now.rest))
    n_unknown = 2 * (poles.size + L.size - len(L))
    G = np.zeros((2 * n_unknown, 2 * n_unknown))
    inside, left = np.zeros((Q.shape[3], len(G))), np.zeros((len(G), rest.shape[3]))
    mode = np.zeros(0, dtype=np.int64)
    for lines, part in _blocks(data):
        columns, mode = _derivatives(part, poles, L, pivot)
        G += columns.T @ columns
        inside += Q[:, :, lines].reshape(len(columns), -1).T @ columns
        left += columns.T @ rest[:, :, lines].reshape(len(columns), -1)
    G -= inside.T @ inside
    X = now.shapes(poles.size)
    gradient = np.einsum("iao,iao->i", left.reshape(mode.size, 2, X.shape[2]), X[mode])
    return _summed(G, X, X, mode), gradient


def _summed(G: Floats, X: Floats, Y: Floats, mode: NDArray[np.int64]) -> Floats:
    """Return Σ_o x_oᵀ G y_o for each two unknowns."""
    S = np.einsum("rao,sbo->rasb", X, Y)[mode][:, :, mode]
    J2 = np.einsum("iajb,iajb->ij", G.reshape(mode.size, 2, mode.size, 2), S, optimize=True)
    return (J2 + J2.T) / 2


def _covariance(
    data: FitData,
    now: _Linear,
    poles: Complexes,
    L: Complexes,
    pivot: NDArray[np.int64],
    misfit: Complexes,
    inverse: Floats,
) -> Scatter:
    """Return (JᵀJ)⁻¹ JᵀVJ (JᵀJ)⁻¹ with V the mean square that ``misfit`` has in each FRF, and the shapes'.

    The weights may suit an FRF better or worse: its noise is what it is. Shapes follow the other unknowns by
    dx = -B⁺ dB x (Kaufman), and have (BᵀB)⁻¹ = ``inverse`` · ``inverse``ᵀ of their own.
    """
    n, (n_freq, n_in), n_out = poles.size, data.spread.shape, misfit.shape[1]
    rows, cols = _free(L.shape, pivot)
    if not n:
        return Scatter(np.zeros((0, 0)), rows, cols, np.zeros((0, n_out, 2, 2)), np.zeros((0, n_out, 2, 0)))
    columns, mode = _derivatives(data, poles, L, pivot)
    inside = now.Q.T @ columns
    rest = (columns - now.Q @ inside).reshape(2, n_in, n_freq, -1)
    X = now.shapes(n)
    freedom = 1 - min((n + n_in) / n_in, 0.5 * n_freq) / n_freq
    power = (np.abs(misfit) ** 2).mean(axis=0) / (2 * freedom)
    J2, V = np.zeros((mode.size, mode.size)), np.zeros((mode.size, mode.size))
    for i in range(n_in):
        part = rest[:, i].reshape(2 * n_freq, -1)
        G = part.T @ part
        J2 += _summed(G, X, X, mode)
        V += _summed(G, X, X * power[:, i], mode)
    size = np.sqrt(np.maximum(J2.diagonal(), 1e-300))
    values, vectors = np.linalg.eigh(J2 / np.outer(size, size))
    # what the data do not tell at all gets a large variance, not none
    unsure = (vectors / np.maximum(values, 1e-13)) @ vectors.T / np.outer(size, size)
    shapes = inverse[: 2 * n].reshape(n, 2, -1)
    own = (
        np.einsum("rak,rbk->rab", shapes, shapes)[:, None]
        * (data.scale**2 * power.mean(axis=1))[:, None, None]
    )
    turned = (shapes.reshape(2 * n, -1) @ inside).reshape(n, 2, mode.size, 2)
    slope = -np.einsum("raib,ibo,o->roai", turned, X[mode], data.scale, optimize=True)
    return Scatter(unsure @ V @ unsure, rows, cols, own, slope)


def _fit(
    data: FitData,
    now: _Linear,
    poles: Complexes,
    L: Complexes,
    pivot: NDArray[np.int64],
    converged: bool,
    steps: int,
) -> ModalFit:
    n, n_in = poles.size, data.spread.shape[1]
    x = now.x * data.scale
    static = x[2 * n :].reshape(-1, n_in, x.shape[1]).transpose(0, 2, 1)
    zero = np.zeros((x.shape[1], n_in))
    lower = static[0] if data.lower else zero
    upper = static[-1] if data.upper else zero
    misfit = data.values(now.rest)
    inverse = sla.solve_triangular(now.R, np.eye(len(now.R))) if _regular(now.R) else np.linalg.pinv(now.R)
    inverse = inverse / now.norms[:, None]
    rows = inverse[: 2 * n].reshape(n, 2, len(now.R))
    scatter = _covariance(data, now, poles, L, pivot, misfit, inverse)
    block = rows @ rows.transpose(0, 2, 1)
    X = now.shapes(n)
    energy = np.einsum("rao,rao->r", X, np.linalg.solve(block, X)) if n else np.zeros(0)
    return ModalFit(
        poles,
        L,
        (x[0 : 2 * n : 2] + 1j * x[1 : 2 * n : 2]).T,
        lower,
        upper,
        data.frf.H - misfit * data.spread[:, None, :] * data.scale[:, None],
        misfit,
        scatter.covariance[: 2 * n, : 2 * n],
        scatter,
        energy,
        2 * (x.shape[1] + n_in),
        converged,
        steps,
    )


def synthesise(data: FitData, fit: ModalFit, which: NDArray[np.bool_]) -> Complexes:
    """Return what some of the modes of a fit are of its FRFs, (n_freq, n_out, n_in)."""
    p, q = _fractions(data, fit.poles[which])
    psi, L = fit.shapes[:, which], fit.participation[which]
    return np.einsum("fr,or,ri->foi", p, psi, L, optimize=True) + np.einsum(
        "fr,or,ri->foi", q, psi.conj(), L.conj(), optimize=True
    )


def _regular(R: Floats) -> bool:
    d = np.abs(R.diagonal())
    return not d.size or bool(d.min() > 1e-13 * d.max())


def scatter_near(fit: ModalFit, data: FitData) -> Floats:
    """Return by what the noise near each pole exceeds the assumed one, shape (n_modes,) [-].

    The root mean square of ``misfit`` over the lines within three half-power half-widths, nine lines at
    least, over that of all lines, times the root of 1 + 2 Σ ρ_j: ρ_j is the correlation of the misfit j lines
    apart, up to the first that chance may give. Windows and errors of the model correlate lines: then there
    are fewer independent ones than there are lines. Not below 1.
    """
    out = np.ones(fit.poles.size)
    usual = (np.abs(fit.misfit) ** 2).mean() / 2
    for r, pole in enumerate(fit.poles):
        apart = np.abs(data.frf.omega - pole.imag) / (data.added_decay - pole.real)
        near = np.sort(np.argsort(apart, kind="stable")[: max(9, int((apart <= _NEAR).sum()))])
        e = fit.misfit[near].reshape(near.size, -1)
        spectrum = np.abs(np.fft.fft(e, 2 * near.size, axis=0)) ** 2
        together = np.fft.ifft(spectrum.sum(axis=1)).real[: near.size // 2] / e.size
        power = together[0] / 2  # of the real and of the imaginary part
        chance = 2 / np.sqrt(e.size)
        ends = np.flatnonzero(together <= chance * together[0])
        together = together[: ends[0]] if ends.size else together
        inflation = 2 * together.sum() / max(2 * power, 1e-300) - 1
        excess = power / max(usual, 1e-300)
        out[r] = np.sqrt((excess if excess > 1 + chance else 1.0) * max(inflation, 1.0))
    return out
