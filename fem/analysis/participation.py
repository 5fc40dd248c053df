"""Participation of modes in motions of the base, effective masses, and energies and damping by part."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.sparse.linalg import cg

from fem.analysis.modes import Modes
from fem.array_types import Floats
from fem.elements.frame import Frame
from fem.model import Contribution, Model
from fem.summary import fields_summary
from fem.system import System, law_change, rigid_motions, sum_contributions


@dataclass(frozen=True, slots=True, eq=False)
class Participation:
    """How rigid motions of all supports together drive modes; directions x y z rx ry rz.

    Attributes
    ----------
    factors : ndarray (n_modes, 6)
        Γ = φᵀ M r with the rigid motion r of a unit in a direction [√kg, √kg m].
    effective_masses : ndarray (n_modes, 6)
        Γ², as modes have φᵀ M φ = 1 [kg, kg m²].
    moving : ndarray (6,)
        Sum of the effective masses of all modes: the mass not carried directly by supports [kg, kg m²].
    total : ndarray (6,)
        rᵀ M r of the structure [kg, kg m²].
    about : ndarray (3,)
        Where the axes of the rotations meet [m].
    """

    factors: Floats
    effective_masses: Floats
    moving: Floats
    total: Floats
    about: Floats

    __repr__ = fields_summary

    @property
    def cumulative(self) -> Floats:
        """Effective masses summed over the modes so far, as fractions of ``moving``, shape (n_modes, 6)."""
        return np.cumsum(self.effective_masses, axis=0) / np.where(self.moving > 0, self.moving, np.inf)


def compute_participation(system: System, modes: Modes, about: ArrayLike | None = None) -> Participation:
    """Compute participation factors and effective masses.

    Γ_r = φ_rᵀ M r and Σ Γ_r² = (QᵀMr)ᵀ (QᵀMQ)⁻¹ (QᵀMr) over all modes, which is rᵀMr less the mass that the
    supports carry at once. The rigid-body modes of a free structure have all of it.

    Parameters
    ----------
    system : System
    modes : Modes
        Real modes of the system, all DOFs.
    about : array_like (3,), optional
        Point for the rotations, the origin unless given [m].

    Returns
    -------
    Participation
    """
    place = np.zeros(3) if about is None else np.asarray(about, dtype=float)
    r = rigid_motion_field(system.model, place)
    M = sum_contributions(system.model.contributions(), system.model.n_dof)[1]
    driven = np.asarray(M @ r)
    on_q = np.asarray(system.Q.T @ driven)
    factors = np.asarray(np.real(modes.shapes), dtype=float).T @ driven
    moving = np.array([b @ _mass_solve(system.M, b) for b in on_q.T])
    return Participation(factors, np.square(factors), moving, np.einsum("ij,ij->j", r, driven), place)


def rigid_motion_field(model: Model, about: ArrayLike) -> Floats:
    """Return the motions of a unit (1 m, 1 rad) in x y z rx ry rz, rotations about a point, (n_dof, 6)."""
    motions = rigid_motions(model).copy()
    motions[:, 3:] *= model.mesh.size or 1.0
    # rotations about the mesh's middle, carried: u = θ × (p - about)
    shift = model.mesh.points.mean(axis=0) - np.asarray(about, dtype=float)
    for k, axis in enumerate(np.eye(3)):
        motions[:, 3 + k] += motions[:, :3] @ np.cross(axis, shift)
    return motions


def _mass_solve(M: Any, b: Floats) -> Floats:
    """Solve M x = b, M semidefinite and b in its range, by conjugate gradients scaled by the diagonal."""
    diagonal = M.diagonal()
    kept = np.flatnonzero(diagonal > 1e-14 * diagonal.max(initial=0.0))
    if not b.any() or not kept.size:
        return np.zeros_like(b)
    scale = 1 / np.sqrt(diagonal[kept])
    A = sp.csr_array(sp.csr_array(M)[kept][:, kept].multiply(scale[:, None]).multiply(scale))
    y, _ = cg(A, scale * b[kept], rtol=1e-14, maxiter=2000)
    x = np.zeros_like(b)
    x[kept] = scale * y
    return x


@dataclass(frozen=True, slots=True, eq=False)
class Energies:
    """Energies of modes by parts of the structure, one column for each mode.

    Attributes
    ----------
    parts : tuple of str
        Names of members, then of the effects other than the frame.
    strain, kinetic : ndarray (n_parts, n_modes)
        Shares of the mode's largest strain and kinetic energy [-]. Each column adds up to 1, or to 0 for the
        strain of a rigid-body mode; parts that soften, as a pressure, have a negative share (of motions that
        grow, whose energy is negative, parts that stiffen).
    damping : ndarray (n_parts + 1, n_modes)
        Contribution of each part to the modal damping ratio; the last is that of the structure [-].
    """

    parts: tuple[str, ...]
    strain: Floats
    kinetic: Floats
    damping: Floats

    __repr__ = fields_summary

    @property
    def zeta(self) -> Floats:
        """Modal damping ratios from the energies, shape (n_modes,) [-]; 0 for rigid-body modes."""
        return self.damping.sum(axis=0)

    def largest(self, mode: int, n: int = 3) -> tuple[tuple[str, float], ...]:
        """Return the parts with the largest shares of a mode's strain energy, and these."""
        order = np.argsort(-self.strain[:, mode])[:n]
        return tuple((self.parts[k], float(self.strain[k, mode])) for k in order)


def compute_energies(model: Model, modes: Modes) -> Energies:
    """Compute strain and kinetic energy and damping of modes by member and effect.

    A part with matrices K_e, M_e, C_e and D_e has the shares φᵀK_eφ/φᵀKφ and φᵀM_eφ/φᵀMφ, and adds
    (ω φᵀC_eφ + φᵀD_eφ) / (2ω² φᵀMφ) to the damping ratio (Ungar and Kerwin, J. Acoust. Soc. Am. 34, 1962):
    the energy it takes in a cycle over 4π times the mode's. This is the first order of small damping; see
    :func:`fem.analysis.complex_modes.solve_complex_modes` for the rest. An element with a law has its K at
    the mode's frequency, storage and loss.

    Parameters
    ----------
    model : Model
    modes : Modes
        Real modes on all DOFs of the model.

    Returns
    -------
    Energies
    """
    omega = modes.omega
    phi = np.asarray(np.real(modes.shapes), dtype=float)
    parts: dict[str, tuple[Contribution, ...]] = {}
    for effect in model.effects:
        if isinstance(effect, Frame):
            for member, rows in model.mesh.members.items():
                contributions = effect.contribution_of(model, rows)
                N = getattr(effect.members[member], "pretension", 0.0)
                pulled = (effect.geometric_stiffness(model, member, N),) if N else ()
                parts[member] = (*contributions, *pulled)
    for effect in model.effects:
        contributions = () if isinstance(effect, Frame) else tuple(effect.contribute(model))
        if contributions:
            name = effect.name if effect.name not in parts else f"{effect.name} ({effect.kind})"
            parts[name] = contributions
    work = np.array([sum(_work(c, phi, omega) for c in contributions) for contributions in parts.values()])
    strain, kinetic, lost = np.moveaxis(work, 1, 0)
    total, mass = strain.sum(axis=0), kinetic.sum(axis=0)
    elastic = omega > 0
    damping = model.damping
    square = np.where(elastic, 2 * omega**2 * mass, np.inf)
    of_all = damping.ratio_at(modes.frequency) + np.where(
        elastic, damping.alpha / np.where(elastic, 2 * omega, 1.0), 0.0
    )
    of_all = of_all + (damping.beta * omega + damping.loss_factor) * total / square
    of_all = np.where(elastic, of_all, 0.0)
    return Energies(
        tuple(parts),
        np.where(omega != 0, strain / np.where(omega != 0, total, 1.0), 0.0),
        kinetic / mass,
        np.vstack([lost / square, of_all]),
    )


def _work(c: Contribution, phi: Floats, omega: Floats) -> Floats:
    """Return φᵀKφ, φᵀMφ and φᵀ(D + ωC)φ of some elements, shape (3, n_modes)."""
    u = phi[c.dofs]

    def form(X: Any) -> Floats:
        if X is None:
            return np.zeros(len(omega))
        return np.einsum("bin,bij,bjn->n", u, np.real(X), u, optimize=True)

    if c.law is None:
        return np.array([form(c.K), form(c.M), form(c.D) + omega * form(c.C)])
    change = law_change(c.law, omega)
    return np.array([form(c.static) + np.real(change) * form(c.K), 0 * omega, np.imag(change) * form(c.K)])
