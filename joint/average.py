"""Identify constant matrices of a joint from all lines together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fem.array_types import Complexes, Floats, Ints
from joint._checks import frozen_copy
from joint.form import JointForm
from joint.identification import (
    ROUNDING,
    JointIdentificationError,
    ScaledProblem,
    characteristic_length,
    factor_tall,
    project_lines,
    scaled_problem,
)
from joint.interface import CoordinateSet, SubstructureFRF
from joint.substructuring import couple

MISFIT_LIMIT = 0.5
"""Part of C = H_aa - H_nn that constant matrices may leave unexplained; beyond it they are refused [-]."""

_BLOCK = 1 << 22
"""Numbers of the equations that are held at a time."""


@dataclass(frozen=True, slots=True, eq=False)
class AverageIdentification:
    """Hold constant matrices of a joint, fitted to all lines.

    Attributes
    ----------
    form : JointForm
        Form of the joint.
    values : (n,) array
        θ, in the order of ``form.names`` [their units].
    std : (n,) array
        Standard deviations from the equations' residual. They take the receptances in A and B for exact and
        so are too small where these are noisy; `fit_joint` gives ones to rely on.
    condition : float
        2-norm condition number of the scaled equations.
    length : float
        Characteristic length by which rotations were scaled [m].
    lines : (n_lines,) integer array
        Lines that took part: those at which A and B have full rank.
    residual : (n_lines,) array
        Part of each line's equations that the matrices leave [-].
    misfit : float
        ‖H_nn rebuilt - H_nn‖ / ‖H_aa - H_nn‖ over all lines [-].
    expanded_by : str
        How coordinates of the substructures that were not measured came in; empty where none did.
    """

    form: JointForm
    values: Floats
    std: Floats
    condition: float
    length: float
    lines: Ints
    residual: Floats
    misfit: float
    expanded_by: str = ""

    def __post_init__(self) -> None:
        for name in ("values", "std", "lines", "residual"):
            object.__setattr__(self, name, frozen_copy(getattr(self, name)))

    @property
    def K(self) -> Floats:
        """Stiffness, (N, N) [N/m, N/rad, N m/m, N m/rad]."""
        return self.form.matrix("K", self.values)

    @property
    def M(self) -> Floats:
        """Mass, (N, N) [kg, kg m, kg m²]."""
        return self.form.matrix("M", self.values)

    @property
    def C(self) -> Floats:
        """Viscous damping, (N, N) [N s/m, …]."""
        return self.form.matrix("C", self.values)

    @property
    def D(self) -> Floats:
        """Structural damping, (N, N) [N/m, …]."""
        return self.form.matrix("D", self.values)

    def Z(self, frequency: npt.ArrayLike) -> Complexes:
        """Return the dynamic stiffness at lines [Hz], (n_freq, N, N)."""
        return self.form.Z(frequency, self.values)


def identify_average(
    substructures: SubstructureFRF,
    frequency: npt.ArrayLike,
    H_nn: npt.ArrayLike,
    form: JointForm,
    *,
    complete: bool = False,
    length: float | None = None,
    misfit_limit: float = MISFIT_LIMIT,
) -> AverageIdentification:
    """Identify a joint's K, M, C and D from all lines together: the average solution.

    A Z_j B = C with Z_j = Σ θ f(ω) T is linear in θ. With A = Q_A R_A, Bᵀ = Q_B R_B each line gives

        R_A Z_j R_Bᵀ = Q_Aᴴ C Q_B*

    p² complex equations, which are scaled to one size and stacked over all lines with real and imaginary
    parts apart. Masses and viscous dampers are scaled by the highest ω. An orthogonal factorisation that
    takes the lines block by block solves them; normal equations would square the condition number.

    Soleimanian, Tizfahm & Sadeghi (2011), eqs. (21)-(26).

    The joint must be a function of the coordinates given: constant matrices of a larger set, seen at some of
    its coordinates only, make a Z_j that is no quadratic function of ω (their sec. V).

    Parameters
    ----------
    substructures : SubstructureFRF
        All substructures side by side, with M and L at least the number of directions in which the form acts.
    frequency : (n_freq,) array_like
        Lines of the assembly [Hz].
    H_nn : (n_freq, M, L) array_like
        Receptances x/f of the assembly at the internal coordinates of the substructures.
    form : JointForm
        Form of the joint: `full_form` or `relative_form`, linear.
    complete : bool
        Says that the joint has no coordinates but those given, though they are not all six of each node.
    length : float, optional
        Characteristic length for rotations [m].
    misfit_limit : float
        Largest part of C that may stay unexplained.

    Returns
    -------
    AverageIdentification

    Raises
    ------
    ValueError
        If shapes or lines do not fit, or a value is not finite.
    JointIdentificationError
        If joint coordinates are left out, the form is not linear, the data do not determine θ (the
        combination is named), or constant matrices do not explain the data.
    """
    joint = substructures.interface.joint
    if form.coordinates.labels != joint.labels:
        msg = (
            "the form's coordinates are not the joint coordinates of the substructures, or not in their order"
        )
        raise JointIdentificationError(msg)
    if not form.linear:
        msg = "viscoelastic terms are not linear in their parameters; use fit_joint"
        raise JointIdentificationError(msg)
    if not complete:
        _check_complete(joint)
    ell = characteristic_length(substructures.H_bb, joint) if length is None else length
    problem = scaled_problem(substructures, frequency, H_nn, form.basis(ell), ell)
    R, weight, lines = _equations(problem, form)
    theta, std, condition = _solve(R, form, problem)
    residual = _residuals(problem, form, theta, weight, lines)
    Z = form.Z(problem.frequency, theta)
    change = problem.H_aa - problem.H_nn
    rebuilt = couple(substructures, Z).H_nn
    misfit = float(np.linalg.norm(rebuilt - problem.H_nn) / (np.linalg.norm(change) or 1.0))
    if not misfit <= misfit_limit:
        msg = (
            f"constant matrices leave {misfit:.0%} of H_aa - H_nn unexplained, and {misfit_limit:.0%} is "
            "allowed: Z_j is no function K - ω²M + iωC + iD at these coordinates. Joint coordinates may be "
            "lacking, substructures may be wrong, or the data too noisy; identify_joint solves line by line"
        )
        raise JointIdentificationError(msg)
    return AverageIdentification(
        form, theta, std, condition, problem.length, lines, residual, misfit, substructures.expanded_by
    )


def _check_complete(joint: CoordinateSet) -> None:
    short = joint.lacking
    if short:
        node = next(iter(short))
        msg = (
            f"the joint coordinates are reduced: node {node} lacks {' '.join(short[node])}"
            f"{f', and {len(short) - 1} more nodes lack some' if len(short) > 1 else ''}. Constant matrices "
            "seen at some of their coordinates only make a Z_j that is no quadratic function of ω, so "
            "that an average over lines has no meaning. Expand the measured motions to all six "
            "(SEREP, SEMM, virtual point), use identify_joint, or say complete=True if the joint acts at "
            "these alone"
        )
        raise JointIdentificationError(msg)


@dataclass(frozen=True, slots=True, eq=False)
class _RegularLines:
    """Each line's R_A and R_B, and the right-hand side R_A z R_Bᵀ = G."""

    R_A: Complexes
    R_B: Complexes
    G: Complexes


def _lines(problem: ScaledProblem) -> tuple[_RegularLines, Ints]:
    seen = project_lines(problem)
    p = problem.A.shape[2]
    use = np.flatnonzero(seen.rank == p)
    F = seen.inverse_A[use] @ seen.QC[use]
    Q_B, R_B, rank, _, _ = factor_tall((problem.R[use] - problem.Q[use] @ F).mT)
    good = rank == p
    return _RegularLines(seen.R_A[use[good]], R_B[good], (seen.QC[use] @ Q_B.conj())[good]), use[good]


def _equations(problem: ScaledProblem, form: JointForm) -> tuple[Floats, tuple[_RegularLines, Floats], Ints]:
    """Return the triangular factor of [E g], the lines' factors with their weights, and the lines."""
    lines, use = _lines(problem)
    size = np.linalg.norm(lines.G, axis=(1, 2))
    weight = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
    inverse = np.linalg.pinv(problem.W)
    T = inverse @ form.matrices @ inverse.T
    omega = 2 * np.pi * problem.frequency[use]
    factors, which = form.slopes(omega, np.zeros(len(form.parameters)))
    p = T.shape[1]
    n = len(form.parameters)
    step = max(1, _BLOCK // (2 * p * p * (n + 1)))
    R = np.zeros((0, n + 1))
    for start in range(0, len(use), step):
        at = slice(start, start + step)
        X = lines.R_A[at, None] @ (T @ lines.R_B[at, None].mT)  # (lines, matrices, p, p)
        columns = factors[:, at].T[:, :, None, None] * X[:, which]
        both = np.concatenate([columns, lines.G[at, None]], axis=1) * weight[at, None, None, None]
        E = np.moveaxis(both.reshape(both.shape[0], n + 1, p * p), 1, 2).reshape(-1, n + 1)
        R = np.asarray(np.linalg.qr(np.vstack([R, E.real, E.imag]), mode="r"), dtype=float)
    return R, (lines, weight), use


def _solve(R: Floats, form: JointForm, problem: ScaledProblem) -> tuple[Floats, Floats, float]:
    n = len(form.parameters)
    E, g = R[:, :n], R[:, n]
    size = np.linalg.norm(E, axis=0)
    lost = np.flatnonzero(size == 0)
    if lost.size:
        msg = f"the data say nothing about {form.names[lost[0]]}"
        raise JointIdentificationError(msg)
    U, s, Vt = np.linalg.svd(E / size, full_matrices=False)
    rank = int((s > n * ROUNDING * s[0]).sum())
    if rank < n:
        weights = Vt[-1] / size
        lead = np.argsort(-np.abs(Vt[-1]))[:4]
        words = ", ".join(form.names[i] for i in lead if abs(Vt[-1][i]) > 0.1)
        msg = (
            f"{len(problem.frequency)} lines determine {rank} of {n} parameters; not distinguished are "
            f"{words} (a combination with {form.names[lead[0]]} changed by {weights[lead[0]]:.2g}); more "
            "lines, internal coordinates, or a form with fewer parameters are needed"
        )
        raise JointIdentificationError(msg)
    theta = (Vt.T @ ((U.T @ g) / s)) / size
    residual = np.linalg.norm(g - E @ theta)
    rows = 2 * len(problem.frequency) * problem.A.shape[2] ** 2
    covariance = (Vt.T / s**2) @ Vt
    std = np.sqrt(np.diag(covariance)) / size * residual / np.sqrt(max(rows - n, 1))
    return theta, std, float(s[0] / s[-1])


def _residuals(
    problem: ScaledProblem,
    form: JointForm,
    theta: Floats,
    weighted: tuple[_RegularLines, Floats],
    use: Ints,
) -> Floats:
    lines, weight = weighted
    inverse = np.linalg.pinv(problem.W)
    z = inverse @ form.Z(problem.frequency[use], theta) @ inverse.T
    residual = lines.R_A @ z @ lines.R_B.mT - lines.G
    return np.linalg.norm(residual, axis=(1, 2)) * weight
