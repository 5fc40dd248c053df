"""Modal parameters of greatest likelihood: Gauss-Newton steps for poles, least squares for shapes.

    H_oi(ω) = (iω)^d { Σ_r [ψ_or L_ri/(iω - λ_r) + ψ_or* L_ri*/(iω - λ_r*)] - lower_oi/ω² + upper_oi }

with d = 0, 1, 2 for receptance, mobility, accelerance; s in place of iω after an exponential window. Given
poles λ and participations L, the shapes ψ and the real residuals are a linear least squares problem, with the
same matrix B for each output. The residual depends on λ and L alone (variable projection: Golub and Pereyra,
*SIAM J. Numer. Anal.* 10, 1973, 413, in Kaufman's form, *BIT* 15, 1975, 49), and its derivatives for all
outputs follow from one Gram matrix. Steps and covariances are computed at few nodes in place of the lines,
which lose nothing (:mod:`updating.modal.condensed_lines`).
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as sla

from fem.array_types import Bools, Complexes, Floats, Ints
from updating.least_squares.levenberg_marquardt import Control, Linearisation, Stop, Tolerance, minimise
from updating.modal.condensed_lines import CondensedLines
from updating.modal.modal_fit import ModalFit, ModalFitData, ModalScatter

_BLOCK = 4096
"""Lines that are synthesised at a time."""


_ROUNDING = 1e-10
"""Part of an unknown's information that other unknowns must leave to be more than a rounding error [-]."""

_TALL = 1e7
"""Products in BᵀB beyond which B is made orthogonal by them."""


@dataclass(frozen=True, slots=True, eq=False)
class _Linear:
    """The linear problem at given poles and participations, at the nodes of condensed lines."""

    lines: CondensedLines
    norms: Floats
    Q: Floats
    R: Floats
    x: Floats
    rest: Floats

    @property
    def square(self) -> float:
        """Return the sum of squared residuals at all lines."""
        return self.lines.residual + float((self.rest**2).sum())

    def shapes(self, n: int) -> Floats:
        """Return Re ψ and Im ψ over the outputs' scale, shape (n_modes, 2, n_out)."""
        return self.x[: 2 * n].reshape(n, 2, self.x.shape[1])


def fit_modes(
    data: ModalFitData, poles: Complexes, participation: Complexes, most_steps: int = 60
) -> ModalFit:
    """Find the poles and participations nearest to given ones that fit FRFs best.

    Variable projection gives gradient and Gauss-Newton matrix of the residual after the linear unknowns, and
    no Jacobian that ``scipy.optimize.least_squares`` could take: the steps are those of
    :mod:`updating.least_squares.levenberg_marquardt`. The covariance has all linear unknowns free, and in
    each FRF the noise that the fit leaves.
    """
    poles = np.array(poles, dtype=complex)
    L: Complexes = np.array(participation, dtype=complex)
    pivot = np.argmax(np.abs(L), axis=1)
    L = L / L[np.arange(len(L)), pivot][:, None]
    problem = _Refinement(data, poles, L, pivot)
    start = problem.start()
    lines, free = start.linear.lines, np.full(len(start.x), np.inf)
    rounding = Tolerance(0.5e-28 * (lines.residual + float((lines.target**2).sum())))
    control = Control(
        reach=lambda x: free,
        promised_gain=rounding,
        # A step that lowers the sum of squares by less than this, relative to its mean for one value, is the
        # last: on the scale on which a parameter that is wrong by its standard deviation raises it by 1
        actual_gain=replace(rounding, relative=1e-3 / lines.n_values),
        max_iterations=most_steps,
        max_evaluations=most_steps,
        max_trials=14,
        # Damping of the first step: poles come from a linear fit and are near [-]
        damping=1e-6,
        raised_by=10.0,
        lowered_by=10.0,
    )
    found = minimise(problem, start, (-free, free), control)
    point, last = found.point, found.linearisation
    slopes = last.slopes if last.at is point else problem.slopes(point)
    return _fit(
        data,
        point.linear,
        slopes,
        point.poles,
        point.L,
        pivot,
        found.stop is not Stop.OUT_OF_ITERATIONS,
        found.n_iterations,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _ModalPoint:
    """Poles and participations, with the linear problem that is solved there."""

    x: Floats
    poles: Complexes
    L: Complexes
    linear: _Linear

    @property
    def cost(self) -> float:
        return 0.5 * self.linear.square


@dataclass(frozen=True, slots=True, eq=False)
class _ModalLinearisation(Linearisation):
    at: _ModalPoint
    slopes: "_Slopes"


@dataclass(frozen=True, slots=True, eq=False)
class _Refinement:
    """Half the sum of squares as a function of poles and participations.

    x holds (ln decay, frequency beyond that at the start over the decay there) of each pole, then the real
    and the imaginary part of each participation but the largest of its mode, which stays 1.
    """

    data: ModalFitData
    first: Complexes
    L: Complexes
    pivot: Ints

    def start(self) -> _ModalPoint:
        of_poles = np.stack([np.log(-self.first.real), np.zeros(self.first.size)], axis=1)
        free = self.L[_free(self.L.shape, self.pivot)]
        x = np.concatenate([of_poles.ravel(), np.stack([free.real, free.imag], axis=1).ravel()])
        linear = _solve(self.data, self.data.condensed(self.first), self.first, self.L)
        return _ModalPoint(x, self.first, self.L, linear)

    def at(self, x: Floats, near: _ModalPoint) -> _ModalPoint:
        # Poles that are no modes run away from the first steps on. Each is stopped by itself: a step that
        # was solved again with them held would bend the paths of the modes.
        n, present = 2 * self.first.size, near.poles.real / self.first.real
        # Longest step of a pole in one iteration, in parts of its decay [-]
        reach = 0.5 * np.stack([np.ones(self.first.size), present], axis=1).ravel()
        x = np.concatenate([near.x[:n] + np.clip(x[:n] - near.x[:n], -reach, reach), x[n:]])
        of_poles = x[:n].reshape(-1, 2)
        frequency = self.first.imag - self.first.real * of_poles[:, 1]
        poles = np.asarray(-np.exp(of_poles[:, 0]) + 1j * frequency, dtype=complex)
        L = self.L.copy()
        L[_free(L.shape, self.pivot)] = x[n::2] + 1j * x[n + 1 :: 2]
        lines = near.linear.lines
        if not lines.holds(self.data.singular(poles)):
            lines = self.data.condensed(np.concatenate([near.poles, poles]))
        return _ModalPoint(x, poles, L, _solve(self.data, lines, poles, L))

    def slopes(self, point: _ModalPoint) -> "_Slopes":
        return _slopes(self.data, point.linear, point.poles, point.L, self.pivot)

    def linearised(self, point: _ModalPoint) -> _ModalLinearisation:
        slopes = self.slopes(point)
        # Slopes are by frequency over the present decay, and x has it over that at the start.
        unit, n = np.ones(len(point.x)), 2 * self.first.size
        unit[1:n:2] = self.first.real / point.poles.real
        matrix = slopes.square() * np.outer(unit, unit)
        return _ModalLinearisation(-slopes.gradient * unit, matrix, point, slopes)


def _free(shape: tuple[int, ...], pivot: Ints) -> tuple[Ints, Ints]:
    """Return rows and columns of the participations that are unknown: all but the largest of each mode."""
    rows, cols = np.indices(shape)
    keep = cols != pivot[:, None]
    return rows[keep], cols[keep]


def _factor(data: ModalFitData, omega: Floats) -> Complexes:
    """Return s^d."""
    return np.asarray(data.s(omega) ** data.frf.kind.derivatives, dtype=complex)


def _fractions(data: ModalFitData, omega: Floats, poles: Complexes) -> tuple[Complexes, Complexes]:
    """Return s^d/(s - λ) and s^d/(s - λ*), shape (n_freq, n_modes)."""
    s = data.s(omega)[:, None]
    g = _factor(data, omega)[:, None]
    return g / (s - poles), g / (s - poles.conj())


def _pairs(p: Complexes, q: Complexes, participation: Complexes) -> Complexes:
    """Return the factors of Re ψ and Im ψ for one input, shape (n_freq, 2 n_modes)."""
    out = np.empty((p.shape[0], 2 * p.shape[1]), dtype=complex)
    one, two = p * participation, q * participation.conj()
    out[:, 0::2], out[:, 1::2] = one + two, 1j * (one - two)
    return out


def _statics(data: ModalFitData, omega: Floats) -> list[Complexes]:
    """Return the factors of the residuals of modes below and above the band, shape (n_freq,) each."""
    g = _factor(data, omega)
    return [values for wanted, values in ((data.lower, g / data.s(omega) ** 2), (data.upper, g)) if wanted]


def _solve(data: ModalFitData, lines: CondensedLines, poles: Complexes, L: Complexes) -> _Linear:
    n, n_in, n_nodes = 2 * poles.size, L.shape[1], lines.omega.size
    p, q = _fractions(data, lines.omega, poles)
    static = np.array(_statics(data, lines.omega), dtype=complex).reshape(-1, n_nodes).T
    n_static = static.shape[1]
    B = np.zeros((n_in, 2 * n_nodes, n + n_in * n_static))
    for i in range(n_in):
        columns = lines.columns(np.concatenate([_pairs(p, q, L[:, i]), static], axis=1), i)
        B[i, :, :n] = columns[:, :n]
        B[i, :, n + i :: n_in] = columns[:, n:]
    B = B.reshape(-1, n + n_in * n_static)
    norms = np.maximum(np.linalg.norm(B, axis=0), 1e-300)
    Q, R = _orthogonal(B / norms)
    y = Q.T @ lines.target
    x = _back(R, y) / norms[:, None]
    return _Linear(lines, norms, Q, R, x, lines.target - Q @ y)


def _orthogonal(B: Floats) -> tuple[Floats, Floats]:
    """Return Q and R with B = QR: of a very tall, well-conditioned B by its normal equations, twice.

    The second pass makes Q orthogonal to rounding if the condition number is below 1/√ε (Yamamoto,
    Nakatsukasa, Yanagisawa and Fukaya, *Electron. Trans. Numer. Anal.* 44, 2015, 306); products take a
    fraction of the time of reflections.
    """
    if B.size * B.shape[1] > _TALL:
        try:
            Q, first = _half_orthogonal(B)
            # Least diagonal of R, of columns of length 1, for which that is as good as reflections [-]
            if np.abs(first.diagonal()).min() > 1e-5:
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


@dataclass(frozen=True, slots=True, eq=False)
class _Slopes:
    """Products of dB, the derivatives of B by the unknowns.

    The unknowns are (ln decay, frequency over decay) of the modes, then the real and the imaginary part of
    the free participations. Each has two columns in dB, for Re ψ and Im ψ of its mode.

    Attributes
    ----------
    X : ndarray (n_modes, 2, n_out)
        Shapes.
    mode : ndarray of int (n,)
        Mode of each unknown.
    at : list of ndarray of int
        Which columns of dB are not 0 at each input.
    gram : list of ndarray
        Products of these columns with each other, input by input.
    with_Q : list of ndarray
        Products of the columns of Q with them, input by input.
    Q2 : list of ndarray
        Products of the columns of Q with each other, input by input.
    inside : ndarray (n_basis, 2 n)
        Sum of ``with_Q``.
    gradient : ndarray (n,)
        -Jᵀr.
    """

    X: Floats
    mode: Ints
    at: list[Ints]
    gram: list[Floats]
    with_Q: list[Floats]
    Q2: list[Floats]
    inside: Floats
    gradient: Floats

    def square(self) -> Floats:
        """Return JᵀJ, (n, n)."""
        G = -self.inside.T @ self.inside
        for at, gram in zip(self.at, self.gram, strict=True):
            G[np.ix_(at, at)] += gram
        return _summed(G, self.X, self.X, self.mode)

    def alone(self) -> Floats:
        """Return the diagonal of JᵀJ if all other unknowns and the shapes were known, about, (n,)."""
        size = np.zeros(2 * self.mode.size)
        for at, gram in zip(self.at, self.gram, strict=True):
            size[at] += gram.diagonal()
        return (size.reshape(-1, 2) * (self.X[self.mode] ** 2).sum(axis=2)).sum(axis=1)

    def square_of(self, i: int, power: Floats) -> Floats:
        """Return JᵀVJ over the lines of input i, V being a variance of each output, (n, n)."""
        at, across = self.at[i], self.with_Q[i].T @ self.inside
        G = self.inside.T @ self.Q2[i] @ self.inside
        G[at] -= across
        G[:, at] -= across.T
        G[np.ix_(at, at)] += self.gram[i]
        return _summed(G, self.X, self.X * power, self.mode)


def _slopes(data: ModalFitData, now: _Linear, poles: Complexes, L: Complexes, pivot: Ints) -> _Slopes:
    n, n_in, (rows, cols) = poles.size, L.shape[1], _free(L.shape, pivot)
    mode = np.repeat(np.concatenate([np.arange(n), rows]), 2)
    Q, rest = (values.reshape(n_in, 2 * now.lines.omega.size, -1) for values in (now.Q, now.rest))
    X, inside = now.shapes(n), np.zeros((Q.shape[2], 2 * mode.size))
    projected = np.zeros((2 * mode.size, rest.shape[2]))
    places, gram, with_Q = [], [], []
    for i in range(n_in):
        free = np.flatnonzero(cols == i)
        columns = _derivatives(data, now.lines, poles, L, rows[free], i)
        # Re L_ri has the columns (c, d), and Im L_ri has (d, -c)
        pairs = 4 * n + 2 * np.arange(free.size)[:, None] + np.array([0, 1, 1, 0])
        which = np.concatenate([np.arange(4 * n), pairs.ravel()])
        sign = np.concatenate([np.ones(4 * n), np.tile([1.0, 1.0, 1.0, -1.0], free.size)])
        unknown = np.concatenate([np.arange(n), n + free])
        at = (4 * unknown[:, None] + np.arange(4)).ravel()
        places.append(at)
        gram.append((columns.T @ columns)[np.ix_(which, which)] * np.outer(sign, sign))
        with_Q.append((Q[i].T @ columns)[:, which] * sign)
        inside[:, at] += with_Q[i]
        projected[at] += (columns.T @ rest[i])[which] * sign[:, None]
    gradient = np.einsum("iao,iao->i", projected.reshape(mode.size, 2, X.shape[2]), X[mode])
    return _Slopes(X, mode, places, gram, with_Q, [q.T @ q for q in Q], inside, gradient)


def _derivatives(
    data: ModalFitData, lines: CondensedLines, poles: Complexes, L: Complexes, modes: Ints, i: int
) -> Floats:
    """Return the different columns of dB at input i, (2 n_nodes, 4 n_modes + 2 n).

    Four for each pole, and two for each of the modes whose participation is unknown there.
    """
    omega, n = lines.omega, poles.size
    p, q = _fractions(data, omega, poles)
    s, decay = data.s(omega)[:, None], -poles.real
    p2, q2 = p / (s - poles), q / (s - poles.conj())
    D = np.empty((omega.size, 4 * n + 2 * modes.size), dtype=complex)
    of_poles = D[:, : 4 * n].reshape(omega.size, n, 2, 2)  # …, pole, its two unknowns, ψ's parts
    of_poles[:, :, 0] = _pairs(-decay * p2, -decay * q2, L[:, i]).reshape(omega.size, n, 2)
    of_poles[:, :, 1] = _pairs(1j * decay * p2, -1j * decay * q2, L[:, i]).reshape(omega.size, n, 2)
    D[:, : 4 * n] = of_poles.reshape(omega.size, 4 * n)
    D[:, 4 * n :] = _pairs(p[:, modes], q[:, modes], np.ones(modes.size, dtype=complex))
    return lines.columns(D, i)


def _summed(G: Floats, X: Floats, Y: Floats, mode: Ints) -> Floats:
    """Return Σ_o x_oᵀ G y_o for each two unknowns."""
    S = np.einsum("rao,sbo->rasb", X, Y)[mode][:, :, mode]
    J2 = np.einsum("iajb,iajb->ij", G.reshape(mode.size, 2, mode.size, 2), S, optimize=True)
    return (J2 + J2.T) / 2


def _covariance(
    data: ModalFitData,
    slopes: _Slopes,
    poles: Complexes,
    L: Complexes,
    pivot: Ints,
    misfit: Complexes,
    inverse: Floats,
) -> ModalScatter:
    """Return (JᵀJ)⁻¹ JᵀVJ (JᵀJ)⁻¹ with V the mean square that ``misfit`` has in each FRF, and the shapes'.

    The weights may suit an FRF better or worse: its noise does not follow them. Shapes follow the other
    unknowns by dx = -B⁺ dB x (Kaufman), and have (BᵀB)⁻¹ = ``inverse`` · ``inverse``ᵀ of their own.
    """
    n, (n_freq, n_in), n_out = poles.size, data.spread.shape, misfit.shape[1]
    rows, cols = _free(L.shape, pivot)
    if not n:
        return ModalScatter(
            np.zeros((0, 0)), rows, cols, np.zeros((0, n_out, 2, 2)), np.zeros((0, n_out, 2, 0))
        )
    freedom = 1 - min((n + n_in) / n_in, 0.5 * n_freq) / n_freq
    power = (np.abs(misfit) ** 2).mean(axis=0) / (2 * freedom)
    X, mode, J2 = slopes.X, slopes.mode, slopes.square()
    V = np.zeros(J2.shape)
    for i in range(n_in):
        V += slopes.square_of(i, power[:, i])
    # A pole without a part in any FRF, or far outside the band, has no information: its variance is huge, and
    # finite. Rounding errors in its place would make all other poles uncertain.
    unknown = np.flatnonzero(J2.diagonal() <= _ROUNDING * slopes.alone())
    for square in (J2, V):
        square[unknown] = square[:, unknown] = 0.0
        # Information that an unknown has at least, so that no variance overflows [-]
        square[unknown, unknown] = 1e-100
    size = np.sqrt(J2.diagonal())
    values, vectors = np.linalg.eigh(J2 / np.outer(size, size))
    # unknowns that the data do not determine at all get a large variance, not none
    unsure = (vectors / np.maximum(values, 1e-13)) @ vectors.T / np.outer(size, size)
    shapes = inverse[: 2 * n].reshape(n, 2, -1)
    conditional = (
        np.einsum("rak,rbk->rab", shapes, shapes)[:, None]
        * (data.scale**2 * power.mean(axis=1))[:, None, None]
    )
    turned = (shapes.reshape(2 * n, -1) @ slopes.inside).reshape(n, 2, mode.size, 2)
    slope = -np.einsum("raib,ibo,o->roai", turned, X[mode], data.scale, optimize=True)
    return ModalScatter(unsure @ V @ unsure, rows, cols, conditional, slope)


def _fit(
    data: ModalFitData,
    now: _Linear,
    slopes: _Slopes,
    poles: Complexes,
    L: Complexes,
    pivot: Ints,
    converged: bool,
    steps: int,
) -> ModalFit:
    n, n_in = poles.size, data.spread.shape[1]
    x = now.x * data.scale
    static = x[2 * n :].reshape(-1, n_in, x.shape[1]).transpose(0, 2, 1)
    zero = np.zeros((x.shape[1], n_in))
    lower = static[0] if data.lower else zero
    upper = static[-1] if data.upper else zero
    shapes = (x[0 : 2 * n : 2] + 1j * x[1 : 2 * n : 2]).T
    H = _synthesised(data, poles, L, shapes, static)
    misfit = (data.frf.H - H) / (data.spread[:, None, :] * data.scale[:, None])
    inverse = sla.solve_triangular(now.R, np.eye(len(now.R))) if _regular(now.R) else np.linalg.pinv(now.R)
    inverse = inverse / now.norms[:, None]
    rows = inverse[: 2 * n].reshape(n, 2, len(now.R))
    scatter = _covariance(data, slopes, poles, L, pivot, misfit, inverse)
    block = rows @ rows.transpose(0, 2, 1)
    X = now.shapes(n)
    energy = np.einsum("rao,rao->r", X, np.linalg.solve(block, X)) if n else np.zeros(0)
    return ModalFit(
        poles=poles,
        participation=L,
        shapes=shapes,
        lower=lower,
        upper=upper,
        H=H,
        misfit=misfit,
        covariance=scatter.covariance[: 2 * n, : 2 * n],
        scatter=scatter,
        energy=energy,
        n_parameters=2 * (x.shape[1] + n_in),
        converged=converged,
        n_steps=steps,
    )


def synthesise(data: ModalFitData, fit: ModalFit, which: Bools) -> Complexes:
    """Return the part of some modes in the FRFs of a fit, (n_freq, n_out, n_in)."""
    return _synthesised(data, fit.poles[which], fit.participation[which], fit.shapes[:, which])


def _synthesised(
    data: ModalFitData, poles: Complexes, L: Complexes, shapes: Complexes, static: Floats | None = None
) -> Complexes:
    """Return the sum of modes and of residuals (n, n_out, n_in) at all lines, (n_freq, n_out, n_in)."""
    omega, n_out, n_in = data.frf.omega, len(shapes), L.shape[1]
    residues = (shapes.T[:, :, None] * L[:, None, :]).reshape(poles.size, n_out * n_in)
    out = np.empty((omega.size, n_out * n_in), dtype=complex)
    for first in range(0, omega.size, _BLOCK):  # large temporary arrays cost more than the arithmetic
        part = omega[first : first + _BLOCK]
        p, q = _fractions(data, part, poles)
        here = p @ residues + q @ residues.conj()
        if static is not None:
            for values, by in zip(_statics(data, part), static, strict=True):
                here += np.outer(values, by)
        out[first : first + _BLOCK] = here
    return out.reshape(-1, n_out, n_in)


def _regular(R: Floats) -> bool:
    d = np.abs(R.diagonal())
    return not d.size or bool(d.min() > 1e-13 * d.max())


def scatter_near(fit: ModalFit, data: ModalFitData) -> Floats:
    """Return the ratio of the noise near each pole to the assumed one, shape (n_modes,) [-].

    The root mean square of ``misfit`` over the lines within three half-power half-widths, nine lines at
    least, over that of all lines, times the root of 1 + 2 Σ ρ_j: ρ_j is the correlation of the misfit j lines
    apart, up to the first that chance may give. Windows and errors of the model correlate lines: then there
    are fewer independent ones than there are lines. Not below 1.
    """
    usual = float((np.abs(fit.misfit) ** 2).mean() / 2)
    return np.array([_scatter(fit.misfit[_near(data, pole)], usual) for pole in fit.poles])


def _near(data: ModalFitData, pole: complex) -> Ints:
    """Return the lines near a pole."""
    apart = np.abs(data.frf.omega - pole.imag) / (data.added_decay - pole.real)
    # Lines within this many half-power half-widths of a pole tell the scatter of the FRFs near it
    return np.sort(np.argsort(apart, kind="stable")[: max(9, int((apart <= 3.0).sum()))])


def _scatter(misfit: Complexes, usual: float) -> float:
    """Return the ratio of the noise in the misfit of a few lines to the usual one of mean square 1 + 1."""
    e = misfit.reshape(len(misfit), -1)
    spectrum = np.abs(np.fft.fft(e, 2 * len(e), axis=0)) ** 2
    together = np.fft.ifft(spectrum.sum(axis=1)).real[: len(e) // 2] / e.size
    power = together[0] / 2  # of the real and of the imaginary part
    chance = 2 / np.sqrt(e.size)
    ends = np.flatnonzero(together <= chance * together[0])
    together = together[: ends[0]] if ends.size else together
    inflation = 2 * together.sum() / max(2 * power, 1e-300) - 1
    excess = power / max(usual, 1e-300)
    return float(np.sqrt((excess if excess > 1 + chance else 1.0) * max(inflation, 1.0)))


def local_gain(data: ModalFitData, fit: ModalFit, pole: complex, participation: Complexes) -> float:
    """Return how much one more mode lowers the sum of squares of the misfit near it, over the noise left.

    Its pole and its participation stay, and so do all other modes.
    """
    lines = _near(data, pole)
    p, q = _fractions(data, data.frf.omega[lines], np.array([pole]))
    columns = np.stack(
        [_pairs(p, q, one) / data.spread[lines, i, None] for i, one in enumerate(participation)]
    )
    B = np.concatenate([columns.real, columns.imag], axis=1).reshape(-1, 2)
    e = fit.misfit[lines].transpose(2, 0, 1)
    y = np.concatenate([e.real, e.imag], axis=1).reshape(len(B), -1)
    Q, _ = np.linalg.qr(B / np.maximum(np.linalg.norm(B, axis=0), 1e-300))
    inside = Q.T @ y
    left = (y - Q @ inside).reshape(len(participation), 2, lines.size, -1)
    usual = float((np.abs(fit.misfit) ** 2).mean() / 2)
    misfit = (left[:, 0] + 1j * left[:, 1]).transpose(1, 2, 0)
    return float((inside**2).sum()) / _scatter(misfit, usual) ** 2
