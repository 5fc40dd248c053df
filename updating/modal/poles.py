"""Poles from FRFs by polyreference least squares in the frequency domain, and which persist over orders.

FRF ─ fit_orders → Stabilisation (poles of every order) ─ track_poles → Track, Track, …
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy
import scipy.linalg as sla

from fem.analysis.frf import FRF
from fem.array_types import Bools, Complexes, Floats, Ints
from fem.summary import fields_summary

MATHEMATICAL_DAMPING = 0.2
"""Poles with a larger damping ratio are taken for mathematical ones [-]."""

FREQUENCY_STEP, DAMPING_STEP, PARTICIPATION_MAC = 0.005, 0.05, 0.98
"""A pole is stable if from the order before frequency and damping ratio changed by less, and its
participation's MAC is above [-]."""

REACH = 0.6
"""A pole continues a track if it lies within this many half-power half-widths, its participation's 1 - MAC
added."""

LEAST_ORDERS = 4
"""A track with fewer orders is not tried as a mode."""

GUARD = 0.02
"""Part of the half circle of the z-plane that is kept free at each end of the band."""


class IdentificationError(ValueError):
    """FRFs or settings from which modes cannot be identified; the message gives the value found."""


@dataclass(frozen=True, slots=True, eq=False)
class Stabilisation:
    """Poles of models of rising order: the data of a stabilisation diagram.

    Attributes
    ----------
    order : ndarray of int (n,)
        Order of the denominator's matrix polynomial that the pole belongs to.
    poles : ndarray of complex (n,)
        With negative real parts and frequencies in the band, sorted by order, then by frequency [rad/s].
    participation : ndarray of complex (n, n_in)
        Participation of the forces, of length 1.
    stable_frequency, stable_damping, stable_participation : ndarray of bool (n,)
        Whether the nearest pole of the order before differs by less than ``FREQUENCY_STEP``,
        ``DAMPING_STEP``, and whether the MAC of the participations is above ``PARTICIPATION_MAC``.
    orders : ndarray of int (n_orders,)
        All orders that were computed.
    """

    order: Ints
    poles: Complexes
    participation: Complexes
    stable_frequency: Bools
    stable_damping: Bools
    stable_participation: Bools
    orders: Ints

    __repr__ = fields_summary

    @property
    def frequency(self) -> Floats:
        """|λ| / 2π, shape (n,) [Hz]."""
        return np.abs(self.poles) / (2 * np.pi)

    @property
    def zeta(self) -> Floats:
        """Damping ratios -Re λ / |λ|, shape (n,) [-]."""
        return -self.poles.real / np.abs(self.poles)

    @property
    def stable(self) -> Bools:
        """Poles that are stable in all three respects, shape (n,)."""
        return self.stable_frequency & self.stable_damping & self.stable_participation


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A pole that persists over orders.

    Attributes
    ----------
    members : ndarray of int (n,)
        Indices of ``Stabilisation.poles``, at most one for each order.
    pole : complex
        Median of the real and the imaginary parts [rad/s].
    participation : ndarray of complex (n_in,)
        Of the member that lies nearest to the median, of length 1.
    frequency, zeta : float
        Of ``pole`` [Hz, -].
    frequency_scatter : float
        Standard deviation of the members [Hz].
    """

    members: Ints
    pole: complex
    participation: Complexes
    frequency: float
    zeta: float
    frequency_scatter: float


def fit_orders(frf: FRF, orders: Ints, scale: Floats, weight: Floats) -> Stabilisation:
    """Fit right matrix fractions of several orders and return their poles.

    Each row of the FRFs is B_o(z) A(z)⁻¹ with polynomials in z = e^{iϑ}, A of real (n_in, n_in) and B_o of
    real (1, n_in) coefficients; ϑ runs from ``GUARD``·π to (1 - ``GUARD``)·π over the band. The equation
    error B_o - H_o A is least, B_o being eliminated output by output; that leaves normal equations in A alone
    (Guillaume, Verboven, Vanlanduit, Van der Auweraer, Peeters, IMAC XXI, 2003). A's lowest coefficient is
    the identity, which gives the poles that only fit noise negative damping (Cauberghe, Guillaume, Verboven,
    Vanlanduit, Parloo, *Mech. Syst. Signal Process.* 19, 2005, 989). B_o has the highest order throughout, so
    that the equations of an order are the leading part of those of the highest, and all orders come from one
    matrix.

    Parameters
    ----------
    frf : FRF
    orders : ndarray of int (n_orders,)
        Orders of A, rising.
    scale : ndarray (n_out,)
        Scale of each output [unit of the FRF].
    weight : ndarray (n_freq,)
        Weights of the lines [-].
    """
    each = _poles(frf.frequency, frf.H, orders, scale, weight)
    found = [(np.full(len(poles), order), poles, w) for order, (poles, w) in zip(orders, each, strict=True)]
    order, poles, w = (np.concatenate(part) for part in zip(*found, strict=True))
    return Stabilisation(order, poles, w, *_stable(order, poles, w), orders)


def poles_of_order(frequency: Floats, H: Complexes, order: int, scale: Floats) -> Complexes:
    """Return the poles of one order as :func:`fit_orders` does [rad/s], all lines weighted alike."""
    ((poles, _),) = _poles(frequency, H, np.array([order]), scale, np.ones(len(frequency)))
    return poles


def _poles(
    frequency: Floats, H: Complexes, orders: Ints, scale: Floats, weight: Floats
) -> list[tuple[Complexes, Complexes]]:
    """Return the poles of each order in the band, by frequency, and their participations."""
    highest, n_in = int(orders[-1]), H.shape[2]
    low, high = float(frequency[0]), float(frequency[-1])
    slope = (1 - 2 * GUARD) * np.pi / (high - low)  # of the angle over the frequency [1/Hz]
    angle = GUARD * np.pi + slope * (frequency - low)
    H = H / scale[:, None]
    columns = np.maximum(np.sqrt((np.abs(H) ** 2).mean(axis=(0, 1))), 1e-300)
    M = _normal_matrix(H / columns, np.exp(1j * angle), highest, weight)
    found = []
    for order in orders:
        z, w = _roots(M, int(order), n_in)
        with np.errstate(divide="ignore"):
            s: Complexes = np.asarray(np.log(z), dtype=complex)
        poles = 2 * np.pi * (s.real / slope + 1j * ((s.imag - GUARD * np.pi) / slope + low))
        keep = (s.real < 0) & (poles.imag >= 2 * np.pi * low) & (poles.imag <= 2 * np.pi * high)
        keep &= -poles.real <= MATHEMATICAL_DAMPING * np.abs(poles)
        poles, w = poles[keep], w[keep] * columns
        rising = np.argsort(poles.imag)
        w = w / np.maximum(np.linalg.norm(w, axis=1, keepdims=True), 1e-300)
        found.append((poles[rising], w[rising]))
    return found


def channel_sizes(H: Complexes) -> tuple[Floats, Floats]:
    """Return sizes of outputs (n_out,) and inputs (n_in,) whose products come nearest to the FRFs' sizes.

    Geometric means of the root mean squares over the lines: a channel's unit changes its own size alone.
    """
    size = np.sqrt((np.abs(H) ** 2).mean(axis=0))
    log = np.log(np.maximum(size, max(1e-12 * float(size.max(initial=0.0)), 1e-300)))
    of_output = log.mean(axis=1)
    return np.exp(of_output), np.exp((log - of_output[:, None]).mean(axis=0))


def track_poles(stabilisation: Stabilisation) -> tuple[Track, ...]:
    """Follow poles from the highest order to the lowest, and return those that last, by frequency.

    The distance of two poles is |λ₁ - λ₂| over the larger of their |Re λ|, plus 1 - MAC of their
    participations. At each order, poles and tracks are paired with the least sum of distances below
    ``REACH``, a track being the median of its last five members; poles that are left begin tracks of their
    own. Half-power widths as the measure keep close modes apart as far as data can, whatever their frequency.
    """
    s = stabilisation
    tracks: list[list[int]] = []
    for order in s.orders[::-1]:
        rows = np.flatnonzero(s.order == order)
        if tracks and rows.size:
            ends = [t[-5:] for t in tracks]
            middle = np.array([_median(s.poles[end]) for end in ends])
            apart = _distance(
                middle,
                np.array([s.participation[t[-1]] for t in tracks]),
                s.poles[rows],
                s.participation[rows],
            )
            pairs = scipy.optimize.linear_sum_assignment(np.minimum(apart, REACH))
            joined = [(t, r) for t, r in zip(*pairs, strict=True) if apart[t, r] < REACH]
        else:
            joined = []
        for t, r in joined:
            tracks[t].append(int(rows[r]))
        taken = {r for _, r in joined}
        tracks += [[int(row)] for r, row in enumerate(rows) if r not in taken]
    done = [_track(s, np.array(t)) for t in tracks if len(t) >= LEAST_ORDERS]
    return tuple(sorted(done, key=lambda track: track.frequency))


def _track(s: Stabilisation, members: Ints) -> Track:
    poles = s.poles[members]
    pole = _median(poles)
    nearest = int(members[np.argmin(np.abs(poles - pole))])
    return Track(
        np.sort(members),
        pole,
        s.participation[nearest],
        abs(pole) / (2 * np.pi),
        -pole.real / abs(pole),
        float(s.frequency[members].std(ddof=1)),
    )


def _median(poles: Complexes) -> complex:
    return complex(np.median(poles.real), np.median(poles.imag))


def _distance(a: Complexes, u: Complexes, b: Complexes, v: Complexes) -> Floats:
    """Return the distances of poles a with participations u from poles b with v, shape (n_a, n_b)."""
    width = np.maximum(-a.real[:, None], -b.real)
    alike = np.abs(u.conj() @ v.T) ** 2  # lengths are 1
    return np.abs(a[:, None] - b) / width + 1 - np.minimum(alike, 1.0)


def _normal_matrix(H: Complexes, z: Complexes, order: int, weight: Floats) -> Floats:
    """Return Σ_o (T_o - S_oᵀ R⁻¹ S_o), shape ((order + 1) n_in, (order + 1) n_in).

    All blocks are moments of z, Re Σ_k z_kʲ (…), that depend on the difference j of the powers alone.
    """
    n_freq, n_out, n_in = H.shape
    n = order + 1
    powers = z[None, :] ** np.arange(-order, order + 1)[:, None] * weight**2
    lag = np.arange(n)[None, :] - np.arange(n)[:, None] + order
    R = powers.sum(axis=1).real[lag]
    S = (powers @ H.reshape(n_freq, -1)).real.reshape(-1, n_out, n_in)[lag]  # (row, power, output, input)
    G = np.conj(H.transpose(0, 2, 1)) @ H
    T = (powers @ G.reshape(n_freq, -1)).real.reshape(-1, n_in, n_in)[lag]  # (power, power, input, input)
    T = T.transpose(0, 2, 1, 3).reshape(n * n_in, n * n_in)
    W = sla.solve_triangular(sla.cholesky(R, lower=True), S.reshape(n, -1), lower=True)
    W = W.reshape(n, n, n_out, n_in).transpose(0, 2, 1, 3).reshape(n * n_out, n * n_in)
    M = T - W.T @ W
    return (M + M.T) / 2


def _roots(M: Floats, order: int, n_in: int) -> tuple[Complexes, Complexes]:
    """Return z with det A(z) = 0 and rows w with w A(z) = 0, of A with A_0 = I and the order asked for."""
    n = order * n_in
    block, right = M[n_in : n_in + n, n_in : n_in + n], M[n_in : n_in + n, :n_in]
    try:
        A = -sla.cho_solve(sla.cho_factor(block), right)
    except np.linalg.LinAlgError:  # exact data of fewer modes leave M without rank
        A = -np.linalg.lstsq(block, right, rcond=1e-14)[0]
    # A(z) = I + A_1 z + … has in μ = 1/z the transposed block companion matrix
    companion = np.eye(n, k=-n_in)
    companion[:n_in] = -A.reshape(order, n_in, n_in).transpose(2, 0, 1).reshape(n_in, n)
    values, vectors = np.linalg.eig(companion)
    mu: Complexes = values.astype(complex)
    rows: Complexes = vectors[:n_in].astype(complex)
    upper = (mu.imag < 0) & (np.abs(mu) > 0)
    return 1 / mu[upper], rows[:, upper].T


def _stable(order: Ints, poles: Complexes, w: Complexes) -> tuple[Bools, Bools, Bools]:
    """Compare each pole with the nearest one of the order before."""
    frequency, zeta = np.abs(poles), -poles.real / np.abs(poles)
    of_frequency, of_damping, of_participation = (np.zeros(poles.size, dtype=bool) for _ in range(3))
    levels = np.unique(order)
    for before, here in pairwise(levels):
        old, new = np.flatnonzero(order == before), np.flatnonzero(order == here)
        apart = _distance(poles[new], w[new], poles[old], w[old])
        near = old[np.argmin(apart, axis=1)]
        of_frequency[new] = np.abs(frequency[near] / frequency[new] - 1) < FREQUENCY_STEP
        of_damping[new] = np.abs(zeta[near] / zeta[new] - 1) < DAMPING_STEP
        alike = np.abs(np.einsum("ki,ki->k", w[near].conj(), w[new])) ** 2
        of_participation[new] = alike > PARTICIPATION_MAC
    return of_frequency, of_damping, of_participation
