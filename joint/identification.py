"""Identify a joint's dynamic stiffness, line by line, from receptances with and without the joint."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import qr

from fem.array_types import Bools, Complexes, Floats, Ints
from joint._checks import (
    as_frequency,
    as_shape,
    check_finite,
    check_same_lines,
    checked_noise,
    frozen_copy,
    solve_lines,
)
from joint.interface import CoordinateSet, SubstructureFRF

ROUNDING = float(np.finfo(float).eps)
AMPLIFICATION_LIMIT = 1e-9 / ROUNDING

_FEW_DIGITS = 1e-11
"""Part of a sum of squares below which a difference from another has lost more than 11 of its digits [-]."""


class JointIdentificationError(ValueError):
    """A joint that the given receptances cannot determine; the message names the reason."""


@dataclass(frozen=True, slots=True, eq=False)
class JointIdentification:
    """Hold a joint's dynamic stiffness at each line and the measures of its accuracy.

    Attributes
    ----------
    frequency : (n_freq,) array
        Lines [Hz].
    coordinates : CoordinateSet
        The N joint coordinates.
    Z : (n_freq, N, N) complex array
        Dynamic stiffness f/x [N/m, N/rad, N m/m, N m/rad]; NaN at lines where A or B lacks rank.
    basis : (N, p) array
        Z = basis z basisᵀ; the identity (p = N) if no basis was given.
    z : (n_freq, p, p) complex array
        Dynamic stiffness in the coordinates basisᵀ x.
    length : float
        Characteristic length by which rotations were scaled [m].
    rank_A, rank_B : (n_freq,) integer arrays
        Numerical ranks of A = H_ab and of B = H_ba - H_bb A⁺ C; p is full.
    condition_A, condition_B : (n_freq,) arrays
        2-norm condition numbers of the scaled A and B.
    residual : (n_freq,) array
        ‖C - A Z B‖ / ‖C‖ (Frobenius, scaled): the part of C that no Z_j explains. A small residual alone does
        not prove Z. Below 3e-6 it is that of about 50 inputs, evenly spread.
    amplification_limit : float
        Largest amplification of a regular line.
    expanded_by : str
        How coordinates of the substructures that were not measured came in; empty where none did.
    Z_std, z_std : (n_freq, N, N), (n_freq, p, p) complex arrays, or None
        Standard deviations of the real part, plus i times those of the imaginary part, by the noise of H_nn,
        to first order; None if the noise was not given.
    """

    frequency: Floats
    coordinates: CoordinateSet
    Z: Complexes
    basis: Floats
    z: Complexes
    length: float
    rank_A: Ints
    rank_B: Ints
    condition_A: Floats
    condition_B: Floats
    residual: Floats
    amplification_limit: float
    expanded_by: str = ""
    Z_std: Complexes | None = None
    z_std: Complexes | None = None

    def __post_init__(self) -> None:
        for name in [
            "frequency",
            "Z",
            "basis",
            "z",
            "rank_A",
            "rank_B",
            "condition_A",
            "condition_B",
            "residual",
        ]:
            object.__setattr__(self, name, frozen_copy(getattr(self, name)))
        for name in ("Z_std", "z_std"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, frozen_copy(getattr(self, name)))

    @property
    def reduced(self) -> dict[str, tuple[str, ...]]:
        """Which of their six directions joint nodes lack; where they carry load, Z is not the joint's own."""
        return self.coordinates.lacking

    @property
    def amplification(self) -> Floats:
        """cond(A) cond(B), (n_freq,): by how much a relative error of the receptances may grow in Z."""
        return self.condition_A * self.condition_B

    @property
    def regular(self) -> Bools:
        """Mark the lines of full rank whose amplification stays within the limit, (n_freq,)."""
        p = self.z.shape[1]
        full = (self.rank_A == p) & (self.rank_B == p)
        return full & (self.amplification <= self.amplification_limit)


def characteristic_length(H: Complexes, coordinates: CoordinateSet) -> float:
    """Return the length that makes rotational receptances as large as translational ones.

    ℓ² = median over lines of (‖H_tt‖ / n_t) / (‖H_rr‖ / n_r)

    A moment is ℓ times a force and a rotation a displacement over ℓ, so that ℓ² H_rr compares with H_tt. For
    a beam it is about one over the wavenumber.

    Parameters
    ----------
    H : (n_freq, n, n) complex array
        Receptances x/f among `coordinates`, SI units.
    coordinates : CoordinateSet
        Which of them are rotations.

    Returns
    -------
    float
        Length [m]; 1 if translations or rotations are lacking.
    """
    turn = coordinates.rotational
    if turn.all() or not turn.any():
        return 1.0
    rotations = np.linalg.norm(H[:, turn][:, :, turn], axis=(1, 2)) / turn.sum()
    translations = np.linalg.norm(H[:, ~turn][:, :, ~turn], axis=(1, 2)) / (~turn).sum()
    seen = (rotations > 0) & (translations > 0)
    return float(np.sqrt(np.median(translations[seen] / rotations[seen]))) if seen.any() else 1.0


def identify_joint(
    substructures: SubstructureFRF,
    frequency: npt.ArrayLike,
    H_nn: npt.ArrayLike,
    *,
    basis: npt.ArrayLike | None = None,
    length: float | None = None,
    amplification_limit: float = AMPLIFICATION_LIMIT,
    noise: npt.ArrayLike | None = None,
) -> JointIdentification:
    """Identify the joints' dynamic stiffness from internal receptances, at each line by itself.

    F = H_ab⁺ (H_aa - H_nn)         joint forces on the joint system, per unit internal input
    B = H_ba - H_bb F               joint motions, per unit internal input (equal to H_jn)
    Z_j = F B⁺

    Soleimanian, Tizfahm & Sadeghi (2011), eqs. (18)-(20), after Ren & Beards: the direct solution, with
    A = H_ab and C = H_aa - H_nn. With a basis G, Z_j = G z Gᵀ and A = H_ab G, B = Gᵀ (H_ba - H_bb G F).

    Both least-squares problems are solved by QR with column pivoting, after scaling rotations by a
    characteristic length. A line is *regular* if A and B have full rank and cond(A) cond(B) is at most
    `amplification_limit`: a relative error ε of the receptances makes an error of Z that stays below about
    ε cond(A) cond(B) ‖H_aa‖/‖C‖, mostly far below. The default limit, 1e-9/2.2e-16, answers for 1e-9 where
    receptances are exact to rounding. For measured ones, with error ε and Z wanted to within t, give t/ε.

    A change of the assembly's receptances alone changes the result by dz = -(I + z H_bb) A⁺ dH_nn B⁺, from
    which independent noise of every value makes the deviations.

    Parameters
    ----------
    substructures : SubstructureFRF
        All substructures side by side (`stack_substructures`), with M ≥ N outputs and L ≥ N inputs.
    frequency : (n_freq,) array_like
        Lines of the assembly [Hz]; they must be those of the substructures.
    H_nn : (n_freq, M, L) array_like
        Receptances x/f of the assembly at the internal coordinates of the substructures, in their order.
    basis : (N, p) array_like, optional
        Directions in which the joint acts, for example the transpose of `relative_coordinates` for a
        massless joint; M, L ≥ p is then enough. The identity if None.
    length : float, optional
        Characteristic length for rotations [m]; `characteristic_length` of H_bb if None.
    amplification_limit : float, optional
        Largest cond(A) cond(B) of a regular line.
    noise : array_like, optional
        Standard deviation of circular complex noise of H_nn: a number is relative to each |H|; an array that
        broadcasts to H_nn is absolute [unit of H].

    Returns
    -------
    JointIdentification

    Raises
    ------
    ValueError
        If shapes or lines do not fit, a value is not finite, the noise is not positive, or the basis is not
        of full column rank.
    JointIdentificationError
        If there are fewer internal outputs or inputs than joint coordinates (or basis columns), if H_ab or
        H_ba lacks rank at every line, or if no line is regular. The message names the joint coordinates.
    """
    problem = scaled_problem(substructures, frequency, H_nn, basis, length)
    z, residual, ranks, conditions = _solve_lines(problem)
    parts, W, size, directions = substructures.interface, problem.W, problem.size, problem.directions
    std = [None, None] if noise is None else _deviations(problem, z, noise)
    result = JointIdentification(
        frequency=problem.frequency,
        coordinates=parts.joint,
        Z=W @ z @ W.T,
        basis=problem.basis,
        z=z / np.outer(size, size),
        length=problem.length,
        rank_A=ranks[0],
        rank_B=ranks[1],
        condition_A=conditions[0],
        condition_B=conditions[1],
        residual=residual,
        amplification_limit=float(amplification_limit),
        expanded_by=substructures.expanded_by,
        Z_std=std[0],
        z_std=std[1],
    )
    if not result.regular.any():
        best = int(np.argmin(result.amplification))
        msg = (
            f"no line is regular: the smallest cond(A) cond(B) is {result.amplification[best]:.1e}, at line "
            f"{best} ({problem.frequency[best]:g} Hz), and {amplification_limit:.1e} is allowed; least "
            f"determined is {directions.name(_null_space(problem.A[best], 1))}; add internal outputs and "
            "inputs near the joint, or give a basis"
        )
        raise JointIdentificationError(msg)
    return result


@dataclass(frozen=True, slots=True, eq=False)
class _Directions:
    """Say combinations of scaled basis columns in terms of joint coordinates."""

    labels: Sequence[str]
    columns: Floats

    def name(self, combinations: Complexes) -> str:
        """Name each column of (p, k) combinations, the large terms only."""
        return "; ".join(self._name_one(self.columns @ vector) for vector in combinations.T)

    def _name_one(self, weights: Complexes) -> str:
        lead = int(np.argmax(np.abs(weights)))
        weights = np.real(weights / weights[lead])
        order = [i for i in np.argsort(-np.abs(weights), kind="stable") if abs(weights[i]) > 0.05]
        if len(order) == 1:
            return self.labels[lead]
        return " ".join(f"{weights[i]:+.2f} {self.labels[i]}" for i in order)


@dataclass(frozen=True, slots=True, eq=False)
class ScaledProblem:
    """Hold A z (R - Q A⁺ C) = C, C = H_aa - H_nn, with rotations scaled by a characteristic length.

    Attributes
    ----------
    frequency : (n_freq,) array
        Lines [Hz].
    A, R, Q : (n_freq, M, p), (n_freq, p, L), (n_freq, p, p) complex arrays
        H_ab W, Wᵀ H_ba and Wᵀ H_bb W, scaled.
    H_aa, H_nn : (n_freq, M, L) complex arrays
        As given, not scaled.
    scale_out, scale_in : (M,), (L,) arrays
        Factors of the rows and columns of C.
    W : (N, p) array
        Z_j = W z Wᵀ.
    size : (p,) array
        Factors by which the columns of the basis were divided.
    basis : (N, p) array
    length : float
        Characteristic length [m].
    directions : _Directions
        Names combinations of W's columns.
    labels : (tuple of str, tuple of str)
        Of the internal outputs and inputs.
    """

    frequency: Floats
    A: Complexes
    R: Complexes
    Q: Complexes
    H_aa: Complexes
    H_nn: Complexes
    scale_out: Floats
    scale_in: Floats
    W: Floats
    size: Floats
    basis: Floats
    length: float
    directions: _Directions
    labels: tuple[tuple[str, ...], tuple[str, ...]]


def scaled_problem(
    substructures: SubstructureFRF,
    frequency: npt.ArrayLike,
    H_nn: npt.ArrayLike,
    basis: npt.ArrayLike | None,
    length: float | None,
) -> ScaledProblem:
    """Check, scale and gather the matrices that the direct and the average solution start from.

    See `identify_joint` for the arguments and the exceptions.
    """
    parts = substructures.interface
    lines = as_frequency(frequency)
    check_same_lines(lines, substructures.frequency, "H_nn", "the substructures")
    assembly = as_shape(H_nn, "H_nn", lines, parts.outputs.labels, parts.inputs.labels)
    G = _as_basis(basis, len(parts.joint))
    _check_counts(
        len(parts.outputs),
        len(parts.inputs),
        G.shape[1],
        "joint coordinates" if basis is None else "basis columns",
    )
    ell = characteristic_length(substructures.H_bb, parts.joint) if length is None else float(length)
    if not (np.isfinite(ell) and ell > 0):
        msg = f"length is {ell} m; a positive length is needed"
        raise ValueError(msg)

    scale_out, scale_in, scale_joint = (
        np.where(part.rotational, ell, 1.0) for part in (parts.outputs, parts.inputs, parts.joint)
    )
    # Columns of unit length in scaled joint coordinates; without a basis W is the scaling itself.
    size = np.linalg.norm(G / scale_joint[:, None], axis=0)
    W = G / size
    A = np.asarray(substructures.H_ab @ W, dtype=complex)
    A *= scale_out[:, None]
    R = np.asarray(W.T @ substructures.H_ba, dtype=complex)
    R *= scale_in
    Q = W.T @ substructures.H_bb @ W
    directions = _Directions(parts.joint.labels, W / scale_joint[:, None])
    _check_rank(A, "H_ab", "no internal output responds to the joint forces", directions)
    _check_rank(R.mT, "H_ba", "no internal input moves the joint coordinates", directions)
    return ScaledProblem(
        frequency=lines,
        A=A,
        R=R,
        Q=Q,
        H_aa=substructures.H_aa,
        H_nn=assembly,
        scale_out=scale_out,
        scale_in=scale_in,
        W=W,
        size=size,
        basis=G,
        length=ell,
        directions=directions,
        labels=(parts.outputs.labels, parts.inputs.labels),
    )


def _as_basis(basis: npt.ArrayLike | None, n: int) -> Floats:
    if basis is None:
        return np.eye(n)
    G = np.asarray(basis, dtype=float)
    if G.ndim != 2 or G.shape[0] != n or not 1 <= G.shape[1] <= n:
        msg = f"basis has shape {G.shape}; ({n}, p) with 1 ≤ p ≤ {n} is needed"
        raise ValueError(msg)
    if not np.isfinite(G).all() or np.linalg.matrix_rank(G) < G.shape[1]:
        msg = f"the {G.shape[1]} columns of basis are dependent or not finite; independent ones are needed"
        raise ValueError(msg)
    return G


def _check_counts(n_outputs: int, n_inputs: int, needed: int, kind: str) -> None:
    for found, word in ((n_outputs, "outputs"), (n_inputs, "inputs")):
        if found < needed:
            msg = (
                f"{found} internal {word} cannot determine {needed} {kind}; at least {needed} are needed "
                f"(N_a ≥ N_b), or a basis of at most {found} columns"
            )
            raise JointIdentificationError(msg)


def _check_rank(tall: Complexes, name: str, meaning: str, directions: _Directions) -> None:
    """Refuse a matrix that lacks column rank at every line."""
    p = tall.shape[2]
    few = np.unique(np.linspace(0, len(tall) - 1, 8).astype(np.int64))
    if (_rank_and_condition(tall[few])[0] == p).any():
        return
    rank, _ = _rank_and_condition(tall)
    best = int(np.argmax(rank))
    if rank[best] < p:
        null = _readable(_null_space(tall[best], p - int(rank[best])))
        msg = (
            f"{name} has rank {rank[best]} of {p} at best over {len(rank)} lines: {meaning} "
            f"{directions.name(null)}; add internal coordinates that do, or give a basis without them"
        )
        raise JointIdentificationError(msg)


def _rank_and_condition(tall: Complexes) -> tuple[Ints, Floats]:
    """Return numerical rank and 2-norm condition number of (n_freq, m, p) matrices, m ≥ p."""
    singular = np.linalg.svd(tall, compute_uv=False)
    largest, smallest = singular[:, 0], singular[:, -1]
    rank = (singular > max(tall.shape[1:]) * ROUNDING * largest[:, None]).sum(axis=1)
    condition = np.divide(largest, smallest, out=np.full_like(largest, np.inf), where=smallest > 0)
    return rank, condition


@dataclass(frozen=True, slots=True, eq=False)
class Projection:
    """Hold the projection of each line's internal outputs: C = Q_A (F_R + …), with A = Q_A R_A.

    Attributes
    ----------
    R_A, inverse_A : (n_freq, p, p) complex arrays
        Triangular factor of A, and its inverse where the rank is full.
    QC : (n_freq, p, L) complex array
        Q_Aᴴ C.
    rest, size : (n_freq,) arrays
        ‖C - Q_A Q_Aᴴ C‖ and ‖C‖.
    rank, condition : (n_freq,) arrays
        Of A.
    """

    R_A: Complexes
    inverse_A: Complexes
    QC: Complexes
    rest: Floats
    size: Floats
    rank: Ints
    condition: Floats


def project_lines(problem: ScaledProblem) -> Projection:
    """Project C on the columns of A, line by line in one buffer: C itself is never stored.

    Raises ValueError where H_nn holds a value that is not finite: the sizes of C tell without a pass of their
    own.
    """
    Q_A, R_A, rank, condition, inverse = factor_tall(problem.A)
    n_freq, n_out, p = problem.A.shape
    n_in = len(problem.scale_in)
    QC = np.empty((n_freq, p, n_in), dtype=complex)
    rest, size = np.empty(n_freq), np.empty(n_freq)
    C = np.empty((n_out, n_in), dtype=complex)
    flat, scale = C.view(float), np.outer(problem.scale_out, np.repeat(problem.scale_in, 2))
    Qh = np.conj(Q_A.mT, order="C")
    with np.errstate(over="ignore", invalid="ignore"):
        for k in range(n_freq):
            np.subtract(problem.H_aa[k], problem.H_nn[k], out=C)
            flat *= scale
            np.matmul(Qh[k], C, out=QC[k])
            square = _square(C)
            size[k] = np.sqrt(square)
            remainder = square - _square(QC[k])
            if remainder < _FEW_DIGITS * square:
                remainder = square * _small_rest(C, Q_A[k], QC[k])
            rest[k] = np.sqrt(remainder)
    if not np.isfinite(size).all():
        check_finite(problem.H_nn, "H_nn", problem.frequency, *problem.labels)
    return Projection(R_A, inverse, QC, rest, size, rank, condition)


def _small_rest(C: Complexes, Q: Complexes, QC: Complexes) -> float:
    """Return ‖C - Q Qᴴ C‖² / ‖C‖² of evenly spread columns, without a difference of squares."""
    # Inputs that tell how small a residual below 3e-6 is
    for step in (max(1, C.shape[1] // 48), 1):
        some = np.ascontiguousarray(C[:, ::step])
        if size := _square(some):
            some -= Q @ QC[:, ::step]
            return _square(some) / size
    return 0.0


def _square(values: Complexes) -> float:
    """Return the sum of |values|²."""
    flat = values.view(float).ravel()
    return float(flat @ flat)


def _squares(values: Complexes) -> Floats:
    """Return the sum of |values|² at each line, (n_freq,)."""
    flat = values.reshape(len(values), values[0].size if len(values) else 0).view(float)
    return np.vecdot(flat, flat)


def _solve_lines(
    problem: ScaledProblem,
) -> tuple[Complexes, Floats, Ints, Floats]:
    """Solve A z (R - Q A⁺ C) = C for z at each line; return z, residual, ranks and conditions (2, n_freq)."""
    n_freq, _, p = problem.A.shape
    z = np.full((n_freq, p, p), complex(np.nan, np.nan))
    residual = np.full(n_freq, np.nan)
    ranks = np.zeros((2, n_freq), dtype=np.int64)
    conditions = np.full((2, n_freq), np.inf)
    seen = project_lines(problem)
    ranks[0], conditions[0] = seen.rank, seen.condition
    full = ranks[0] == p
    use = slice(None) if full.all() else np.flatnonzero(full)
    QC = seen.QC[use]
    F = seen.inverse_A[use] @ QC
    B = problem.Q[use] @ F
    np.subtract(problem.R[use], B, out=B)
    Q_B, _, rank, condition, inverse_B = factor_tall(B.mT)
    ranks[1, use], conditions[1, use] = rank, condition
    good = rank == p
    # B = (Q_B R_B)ᵀ, so that Z B = F gives Z = F Q_B* R_Bᵀ⁻¹, with F = A⁺ C
    inside = QC @ np.conj(Q_B, out=np.empty_like(Q_B))
    z[use] = np.where(good[:, None, None], seen.inverse_A[use] @ inside @ inverse_B.mT, np.nan)
    # the part of C outside the columns of A, and of the part inside that outside the rows of B
    spanned = _squares(QC)
    outside = spanned - _squares(inside)
    small = outside < _FEW_DIGITS * spanned
    few = slice(None) if small.all() else np.flatnonzero(small)
    outside[few] = _squares(QC[few] - inside[few] @ Q_B[few].mT)
    misfit = np.sqrt(seen.rest[use] ** 2 + outside)
    residual[use] = np.where(
        good, np.divide(misfit, seen.size[use], where=misfit > 0, out=np.zeros_like(misfit)), np.nan
    )
    return z, residual, ranks, conditions


def _deviations(problem: ScaledProblem, z: Complexes, noise: npt.ArrayLike) -> list[Complexes]:
    """Return the deviations of W z Wᵀ and of z over the basis' own sizes."""
    level = checked_noise(noise, problem.H_nn.shape)
    sigma = level if level.ndim else level * np.abs(problem.H_nn)
    known = np.asarray(np.isfinite(z).all(axis=(1, 2)))
    z, Q, unit = z[known], problem.Q[known], np.eye(z.shape[1])
    B = solve_lines(unit + Q @ z, problem.R[known])
    left = (unit + z @ Q) @ np.linalg.pinv(problem.A[known]) * problem.scale_out
    right = problem.scale_in[:, None] * np.linalg.pinv(B)
    out = []
    for rows in (problem.W, np.diag(1 / problem.size)):
        spread = np.abs(rows @ left) ** 2 @ sigma[known] ** 2 @ np.abs(right @ rows.T) ** 2
        std = np.full((len(known), len(rows), len(rows)), complex(np.nan, np.nan))
        std[known] = np.sqrt(spread / 2) * (1 + 1j)
        out.append(std)
    return out


def factor_tall(
    tall: Complexes,
) -> tuple[Complexes, Complexes, Ints, Floats, Complexes]:
    """Factorise (n_freq, m, p) matrices, m ≥ p, into Q R; return Q, R, ranks, condition numbers and R⁻¹.

    R⁻¹ is only meaningful at lines of full rank.
    """
    Q, R = np.linalg.qr(tall)
    U, singular, Vh = np.linalg.svd(R)
    largest, smallest = singular[:, 0], singular[:, -1]
    rank: Ints = (singular > max(tall.shape[1:]) * ROUNDING * largest[:, None]).sum(axis=1)
    condition = np.divide(largest, smallest, out=np.full_like(largest, np.inf), where=smallest > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = (Vh.conj().mT / singular[:, None, :]) @ U.conj().mT
    return (
        np.asarray(Q, dtype=complex),
        np.asarray(R, dtype=complex),
        rank,
        condition,
        np.asarray(inverse, dtype=complex),
    )


def _null_space(A: Complexes, dimension: int) -> Complexes:
    """Return the right singular vectors of the smallest singular values, (p, dimension)."""
    return np.linalg.svd(A, full_matrices=False)[2][-dimension:].conj().T


def _readable(null: Complexes) -> Complexes:
    """Combine null vectors so that each holds one coordinate that the others lack."""
    lead = qr(null.T, mode="r", pivoting=True)[-1][: null.shape[1]]
    return np.asarray(np.linalg.solve(null[lead].T, null.T).T, dtype=complex)
