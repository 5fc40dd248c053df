"""Largest responses to a motion of the base that is given by its response spectrum.

    System, spectra by direction → solve_spectrum → SpectrumResponse

Each mode has the peak φ Γ S_a(f)/ω². Peaks of modes are combined by their correlation (CQC: Der Kiureghian,
Earthq. Eng. Struct. Dyn. 9, 1981) or as if they had none (SRSS). What the modes leave out follows the base
without delay: the static response to the rest of the inertia at the acceleration of the rigid end of the
spectrum, the missing mass. Directions are combined as uncorrelated.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from fem.analysis.base_excitation import rigid_base_load
from fem.analysis.line_loads import line_axes, line_dofs
from fem.analysis.loads import Key
from fem.analysis.modes import Modes, solve_modes
from fem.analysis.participation import compute_energies
from fem.analysis.section_forces import line_mass, line_stiffness
from fem.analysis.selection import Selection, dof_vectors
from fem.analysis.statics import constraint_forces, factor_stiffness
from fem.analysis.tabulated import Tabulated
from fem.array_types import Floats
from fem.model import Model, ModelError
from fem.summary import fields_summary
from fem.system import System, sum_contributions

COMBINATIONS = ("cqc", "srss")


@dataclass(frozen=True, slots=True, eq=False)
class SpectrumResponse:
    """Largest sizes of responses to a motion of the base.

    Attributes
    ----------
    model : Model
    modes : Modes
        Those that were combined.
    zeta : ndarray (n_modes,)
        Their damping ratios with local dampers, by energies [-].
    directions : tuple of str
    acceleration_of_modes : ndarray (n_modes, n_dir)
        S_a of each mode [m/s²].
    effective_mass : ndarray (n_modes, n_dir)
        Γ² [kg, kg m²].
    total_mass : ndarray (n_dir,)
        rᵀMr of the structure [kg, kg m²].
    displacement, acceleration : ndarray (n_out,)
        Relative to the base, and absolute pseudo-acceleration [m, m/s²].
    outputs : tuple of str
    motion : ndarray (n_dof,)
        Largest displacement of each DOF relative to the base [m, rad].
    base_force : ndarray (n_dir,)
        Resultant of the inertia along each direction, of the motion in that direction [N, N·m].
    reactions : mapping of (str, str) to float
        Of supports and rigid directions of joints [N, N·m].
    line_forces : ndarray (n_lines, 2, 6)
        N, Vy, Vz, T, My, Mz at both ends of each line [N, N·m].
    combination : str
    missing_mass : bool
        Whether it was added.
    """

    model: Model
    modes: Modes
    zeta: Floats
    directions: tuple[str, ...]
    acceleration_of_modes: Floats
    effective_mass: Floats
    total_mass: Floats
    displacement: Floats
    acceleration: Floats
    outputs: tuple[str, ...]
    motion: Floats
    base_force: Floats
    reactions: Mapping[Key, float]
    line_forces: Floats
    combination: str
    missing_mass: bool

    __repr__ = fields_summary

    @property
    def mass_share(self) -> Floats:
        """Effective mass over the structure's, (n_modes, n_dir) [-]; 0 along a direction without mass."""
        return self.effective_mass / np.where(self.total_mass > 0, self.total_mass, np.inf)

    @property
    def mode_motions(self) -> Floats:
        """Largest displacements φ Γ S_a / ω² of each mode alone, (n_modes, n_dir, n_dof) [m, rad]."""
        factors = np.sqrt(self.effective_mass) * self.acceleration_of_modes / self.modes.omega[:, None] ** 2
        return factors[:, :, None] * np.real(self.modes.shapes.T[:, None])


def modal_correlation(omega: ArrayLike, zeta: ArrayLike) -> Floats:
    """Return the correlation of the peaks of modes under white noise, shape (n, n).

    ρ = 8 √(ζᵢζⱼ) (ζᵢ + r ζⱼ) r^(3/2) / ((1 - r²)² + 4 ζᵢζⱼ r (1 + r²) + 4 (ζᵢ² + ζⱼ²) r²), r = ωⱼ/ωᵢ (Der
    Kiureghian 1981, equation 25).

    Parameters
    ----------
    omega : array_like (n,)
        Above 0 [rad/s].
    zeta : array_like (n,)
        Where both are 0 modes of different frequencies have no correlation.
    """
    w, z = np.asarray(omega, dtype=float), np.asarray(zeta, dtype=float)
    r = w / w[:, None]
    zi, zj = z[:, None], z
    top = 8 * np.sqrt(zi * zj) * (zi + r * zj) * r**1.5
    bottom = (1 - r**2) ** 2 + 4 * zi * zj * r * (1 + r**2) + 4 * (zi**2 + zj**2) * r**2
    rho = np.divide(top, bottom, out=np.zeros_like(top), where=bottom > 0)
    return np.where(np.eye(w.size, dtype=bool), 1.0, rho)


def combined(peaks: Floats, correlation: Floats) -> Floats:
    """Return √(Σ ρᵢⱼ Rᵢ Rⱼ) over the first axis of signed peaks of modes (n_modes, …)."""
    flat = peaks.reshape(len(peaks), -1)
    total = np.einsum("ik,ik->k", flat, correlation @ flat)
    return np.sqrt(np.maximum(total, 0.0)).reshape(peaks.shape[1:])


def solve_spectrum(
    system: System,
    spectra: Mapping[str, Tabulated],
    outputs: Selection,
    *,
    n_modes: int | None = None,
    max_frequency: float | None = None,
    combination: str = "cqc",
    missing_mass: bool = True,
    rigid_acceleration: Mapping[str, float] | None = None,
    about: ArrayLike | None = None,
) -> SpectrumResponse:
    """Combine the largest responses of modes to a motion of the base.

    Parameters
    ----------
    system : System
        Fixed by supports.
    spectra : mapping of str to Tabulated
        Pseudo-acceleration S_a over frequency, for the damping that the modes have, by direction ``"x"`` …
        ``"rz"`` [m/s², rad/s²]. Outside its frequencies it has the values of its ends.
    outputs : selection
        DOF numbers, (point, direction) pairs, or rows of combinations (n, n_dof).
    n_modes, max_frequency : int, float, optional
        Modes to be combined: their number (20 unless given), or all up to a frequency [Hz].
    combination : str
        ``"cqc"`` or ``"srss"``.
    missing_mass : bool
        Whether what the modes leave out is added, as not correlated with them.
    rigid_acceleration : mapping of str to float, optional
        Acceleration of the base itself by direction, at which the missing mass moves; that of the spectrum
        at its highest frequency unless given [m/s²].
    about : array_like (3,), optional
        Point about which the base turns, the origin unless given [m].

    Raises
    ------
    ModelError
        For a structure that is not supported, an unknown combination or direction, or no spectrum.
    """
    if combination not in COMBINATIONS:
        msg = f"the combination is '{combination}'; allowed are {', '.join(COMBINATIONS)}"
        raise ModelError(msg)
    if not spectra:
        msg = "no spectrum is given; give one for a direction, such as {'x': Tabulated.of(frequency, sa)}"
        raise ModelError(msg)
    factor = factor_stiffness(system)
    model = system.model
    modes = solve_modes(system, n_modes, max_frequency)
    phi = np.asarray(np.real(modes.shapes), dtype=float)
    omega, zeta = modes.omega, compute_energies(model, modes).zeta  # local dampers included
    correlation = modal_correlation(omega, zeta) if combination == "cqc" else np.eye(modes.n_modes)
    correlation = np.pad(correlation, (0, 1))
    correlation[-1, -1] = 1.0  # the missing mass
    rows, labels = dof_vectors(model, outputs)
    K, M, _, _ = sum_contributions(model.contributions(), model.n_dof)
    squares: dict[str, Floats] = {}
    at_supports: dict[Key, float] = {}
    levels, masses, totals, force = [], [], [], []
    supports = tuple(c for c in model.constraints() if not c.everywhere)
    for direction, spectrum in spectra.items():
        r, driven = rigid_base_load(system, direction, about)
        gamma, sa = phi.T @ driven, spectrum.at(modes.frequency)
        rigid = (rigid_acceleration or {}).get(direction, float(spectrum.values[-1])) * missing_mass
        rest = np.asarray(system.Q.T @ (driven - M @ (phi @ gamma)))
        u = np.column_stack([phi * (gamma * sa / omega**2), rigid * (system.Q @ factor.solve(rest))])
        a = np.column_stack([phi * (gamma * sa), rigid * (r - phi @ gamma)])
        found = {"u": rows.T @ u, "a": rows.T @ a, "dofs": u, "lines": _line_forces(model, u, a)}
        for key, peaks in found.items():
            square = combined(np.moveaxis(peaks, -1, 0), correlation) ** 2
            squares[key] = squares.get(key, np.zeros(square.shape)) + square
        for key, peaks in constraint_forces(supports, np.asarray(K @ u - M @ a)).items():
            square = combined(peaks[:, None], correlation) ** 2
            at_supports[key] = at_supports.get(key, 0.0) + float(square[0])
        total = float(r @ driven)
        levels.append(sa)
        masses.append(gamma**2)
        totals.append(total)
        resultant = np.append(gamma**2 * sa, rigid * (total - float((gamma**2).sum())))
        force.append(float(combined(resultant[:, None], correlation)[0]))
    return SpectrumResponse(
        model,
        modes,
        zeta,
        tuple(spectra),
        np.column_stack(levels),
        np.column_stack(masses),
        np.array(totals),
        np.sqrt(squares["u"]),
        np.sqrt(squares["a"]),
        labels,
        np.sqrt(squares["dofs"]),
        np.array(force),
        MappingProxyType({key: float(np.sqrt(value)) for key, value in at_supports.items()}),
        np.sqrt(squares["lines"]),
        combination,
        missing_mass,
    )


def _line_forces(model: Model, u: Floats, a: Floats) -> Floats:
    """Return section forces at both ends of lines, (n_lines, 2, 6, n), under motions and accelerations."""
    dofs, axes = line_dofs(model), line_axes(model)
    ends = np.einsum("bij,bjc->bic", line_stiffness(model), u[dofs])
    ends -= np.einsum("bij,bjc->bic", line_mass(model), a[dofs])
    out = np.empty((len(dofs), 2, 6, u.shape[1]))
    for end, sign in ((0, -1.0), (1, 1.0)):
        force, moment = ends[:, 6 * end : 6 * end + 3], ends[:, 6 * end + 3 : 6 * end + 6]
        moment = moment - np.cross(axes.offset[:, end, :, None], force, axis=1)
        out[:, end] = sign * np.concatenate([axes.R @ force, axes.R @ moment], axis=1)
    return out
