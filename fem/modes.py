"""Natural frequencies and mode shapes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """Natural modes, mass-normalised: φᵀ M φ = I.

    Attributes
    ----------
    frequency : ndarray (n_modes,)
        Natural frequencies, rising; rigid-body modes are 0 [Hz].
    shapes : ndarray (n_dof, n_modes)
        Mode shapes; for computed modes all DOFs of the mesh, ``6 p + d`` [m/√kg·m, rad].
    zeta : ndarray (n_modes,) or None
        Modal damping ratios [-].
    labels : tuple of str
        Labels of the rows where they are not the DOFs of a mesh (measured shapes).
    n_rigid : int
        Number of rigid-body modes among them.
    """

    frequency: NDArray[np.float64]
    shapes: NDArray[np.floating] | NDArray[np.complexfloating]
    zeta: NDArray[np.float64] | None = None
    labels: tuple[str, ...] = ()
    n_rigid: int = 0

    @property
    def n_modes(self) -> int:
        """Number of modes."""
        return self.frequency.size

    @property
    def omega(self) -> NDArray[np.float64]:
        """Natural angular frequencies, shape (n_modes,) [rad/s]."""
        return 2 * np.pi * self.frequency
