"""Couple substructures through joints by their receptances, and take a joint out again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fem.array_types import Complexes, Floats
from joint._checks import as_frequency, as_lines, as_square, frozen_copy, solve_lines
from joint.interface import Interface, SubstructureFRF


@dataclass(frozen=True, slots=True, eq=False)
class AssemblyFRF:
    """Hold the receptances of an assembly.

    x_n = H_nn f_n + H_nj f_j,  x_j = H_jn f_n + H_jj f_j

    Attributes
    ----------
    frequency : (n_freq,) array
        Lines [Hz].
    interface : Interface
        M internal outputs, L internal inputs, N joint coordinates: those of the substructures.
    H_nn, H_nj, H_jn, H_jj : (n_freq, M, L), (n_freq, M, N), (n_freq, N, L), (n_freq, N, N) complex arrays
        Receptances x/f [m/N, rad/N, m/(N m), rad/(N m)], e^{+iωt}.
    """

    frequency: Floats
    interface: Interface
    H_nn: Complexes
    H_nj: Complexes
    H_jn: Complexes
    H_jj: Complexes

    def __post_init__(self) -> None:
        for name in ("frequency", "H_nn", "H_nj", "H_jn", "H_jj"):
            object.__setattr__(self, name, frozen_copy(getattr(self, name)))


def joint_impedance(
    frequency: npt.ArrayLike,
    K: npt.ArrayLike,
    M: npt.ArrayLike | None = None,
    C: npt.ArrayLike | None = None,
    D: npt.ArrayLike | None = None,
) -> Complexes:
    """Return the dynamic stiffness of a joint.

    Z_j(ω) = K - ω² M + iω C + i D,  ω = 2π f

    Soleimanian, Tizfahm & Sadeghi (2011), eq. (27), with structural damping D as in their eq. (24).

    Parameters
    ----------
    frequency : (n_freq,) array_like
        Lines [Hz].
    K, M, C, D : (n, n) array_like
        Stiffness [N/m, N m/rad], mass [kg, kg m²], viscous damping [N s/m, N m s/rad] and structural
        damping [N/m, N m/rad]. None means zero.

    Returns
    -------
    (n_freq, n, n) complex array
        f = Z_j x at the joint's coordinates.

    Raises
    ------
    ValueError
        If a matrix is not square, not of the size of `K`, or not finite.
    """
    lines = as_frequency(frequency)
    n = len(np.atleast_1d(np.asarray(K)))
    K, M, C, D = (as_square(matrix, name, n) for matrix, name in ((K, "K"), (M, "M"), (C, "C"), (D, "D")))
    omega = (2 * np.pi * lines)[:, None, None]
    return K - omega**2 * M + 1j * (omega * C + D)


def couple(substructures: SubstructureFRF, Z_j: npt.ArrayLike) -> AssemblyFRF:
    """Join substructures by a joint system.

    H_jn = (I + H_bb Z_j)⁻¹ H_ba            H_nn = H_aa - H_ab Z_j H_jn
    H_jj = (I + H_bb Z_j)⁻¹ H_bb            H_nj = H_ab (I + Z_j H_bb)⁻¹

    Soleimanian, Tizfahm & Sadeghi (2011), eqs. (12)-(15). With (I + Z H)⁻¹ Z = Z (I + H Z)⁻¹ the rows of
    (13) and (15) need no difference of nearly equal terms when the joint is stiff.

    Parameters
    ----------
    substructures : SubstructureFRF
        All substructures side by side (`stack_substructures`).
    Z_j : (n_freq, N, N) array_like
        Dynamic stiffness of the joint system, in the order of `substructures.interface.joint`
        (`joint_impedance`, `stack_joints`) [N/m, N/rad, N m/m, N m/rad].

    Returns
    -------
    AssemblyFRF

    Raises
    ------
    ValueError
        If `Z_j` does not fit the joint coordinates or is not finite.
    numpy.linalg.LinAlgError
        If I + H_bb Z_j is singular: an undamped resonance of the assembly lies exactly on a line.
    """
    joint = substructures.interface.joint.labels
    Z = as_lines(Z_j, "Z_j", substructures.frequency, joint, joint)
    H_aa, H_ab = substructures.H_aa, substructures.H_ab
    H_ba, H_bb = substructures.H_ba, substructures.H_bb
    unit = np.eye(len(joint))
    H_jn = solve_lines(unit + H_bb @ Z, H_ba)
    return AssemblyFRF(
        substructures.frequency,
        substructures.interface,
        H_nn=H_aa - H_ab @ (Z @ H_jn),
        H_nj=solve_lines((unit + Z @ H_bb).mT, H_ab.mT).mT,
        H_jn=H_jn,
        H_jj=solve_lines(unit + H_bb @ Z, H_bb),
    )


def decouple(assembly: AssemblyFRF, Z_j: npt.ArrayLike) -> SubstructureFRF:
    """Take a known joint system out of an assembly, which is to couple its negative.

    From (15), H_bb⁻¹ = H_jj⁻¹ - Z_j; Z_j = Z + (-Z) = 0 leaves the substructures of (12)-(15).

    Errors grow by up to ‖I + Z_j H_bb‖ squared in H_bb: motion that a stiff joint hides is not recovered.

    Parameters
    ----------
    assembly : AssemblyFRF
        The joined structure.
    Z_j : (n_freq, N, N) array_like
        Dynamic stiffness to take out, in the order of `assembly.interface.joint`.

    Returns
    -------
    SubstructureFRF

    Raises
    ------
    ValueError
        If `Z_j` does not fit the joint coordinates or is not finite.
    """
    joined = SubstructureFRF(
        assembly.frequency,
        assembly.interface,
        assembly.H_nn,
        assembly.H_nj,
        assembly.H_jn,
        assembly.H_jj,
    )
    free = couple(joined, -np.asarray(Z_j, dtype=complex))
    return SubstructureFRF(free.frequency, free.interface, free.H_nn, free.H_nj, free.H_jn, free.H_jj)
