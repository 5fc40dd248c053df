"""A damping matrix that gives modes their damping ratios."""

import numpy as np
from numpy.typing import ArrayLike

from fem.array_types import Floats
from updating.modal.poles import (
    IdentificationError,
)


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
