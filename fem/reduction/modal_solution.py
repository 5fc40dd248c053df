"""One solved state of a reduced model: modes by one eigenproblem, and damping at each line."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.linalg as sla
from numpy.typing import NDArray

from fem.array_types import Complexes, Floats
from fem.reduction.reduced_model import ReducedModel


@dataclass(slots=True, eq=False)
class ModalSolution:
    """A solved eigenproblem and the damping at each line: applies Z(ω)⁻¹ in modal coordinates.

    ``resisting`` (n_freq, k, k) are S, the forces of local damping and laws against the motions ``U``, and
    ``yielding`` I + S G with G the response to such forces. ``stiffness``, ``connections`` and ``mass``
    (n_freq,) are the factors of K and M in changes of Z, and ``by_zeta`` (r, n_freq) is its slope by ζ.
    """

    lam: Floats
    V: Floats
    stiffness: Complexes
    connections: Complexes
    mass: Complexes
    by_zeta: Complexes
    inverse: Complexes
    U: Floats | None
    resisting: Complexes
    yielding: Complexes
    U_connections: Floats | None = None
    _correct: NDArray[Any] | None = field(default=None, init=False, repr=False)

    @classmethod
    def of(
        cls,
        reduced: ReducedModel,
        total: dict[str, Any],
        omega: NDArray[Any],
        zeta: Floats,
        damped: Floats | None,
        losses: Floats | None = None,
        modal: Callable[[Floats], Floats] | None = None,
        *,
        viscous: bool = False,
    ) -> "ModalSolution":
        """Solve the eigenproblem of a reduced model's matrices, and prepare the local damping at each line.

        Parameters
        ----------
        reduced : ReducedModel
        total : dict
            The sums of all terms: K, M, C, D, ``connections`` and ``laws``.
        omega : ndarray (n_freq,)
            Angular frequencies, complex for decaying motion [rad/s].
        zeta : ndarray (n_freq,) or (2, n_freq)
            Damping ratio at each line, and that of connections if it is another [-].
        damped : ndarray (r, k) or None
            An orthonormal basis of the motions that local damping acts on; found here if None.
        losses : ndarray (r, r), optional
            A structural damping i X so small that it counts by what it does to each mode alone.
        modal : callable, optional
            From natural frequencies [Hz] to modal damping ratios, which add 2iζ_r ω_r ω to each mode as a
            model's do.
        viscous : bool
            Whether ``zeta`` adds 2iζ(ω) ω_r ω to each mode, as viscous modal damping does, in place of
            2iζ(ω) ω_r², which is that of a loss factor. Its changes with K and M are then those at the
            resonances.
        """
        damping = reduced.model.damping
        zeta, *others = np.atleast_2d(zeta)
        lam, V = sla.eigh(total["K"], total["M"], check_finite=False)
        n_rigid = reduced.basis.n_rigid
        near_zero = np.abs(lam[:n_rigid]) < 1e-6 * np.abs(lam[min(n_rigid, len(lam) - 1)])
        lam[:n_rigid] = np.where(near_zero, 0.0, lam[:n_rigid])
        elastic = 1 + 1j * damping.loss_factor + 1j * omega * damping.beta
        inertia: Complexes = (1j * omega * damping.alpha - omega**2).astype(complex)
        by_zeta = 2j * lam[:, None] * np.ones(len(omega))
        stiffness, mass = elastic + 2j * zeta, inertia
        if viscous:
            by_zeta = 2j * np.sqrt(np.maximum(lam, 0.0))[:, None] * omega
            stiffness, mass = elastic + 1j * zeta, inertia + 1j * zeta * omega**2
        # Arrays over modes, columns and lines are kept in this order: a product from the left is then one
        # GEMM.
        if modal is not None:
            omega_r = np.sqrt(np.maximum(lam, 0.0))
            inertia = inertia + 2j * (modal(omega_r / (2 * np.pi)) * omega_r)[:, None] * omega
        if losses is not None:
            inertia = inertia + 1j * np.einsum("rm,rs,sm->m", V, losses, V, optimize=True)[:, None]
        inverse = (1 / (lam[:, None] * elastic + by_zeta * zeta + inertia))[:, None, :]
        laws, connections = total["laws"], stiffness
        if others and total["connections"].any():
            more = 2j * (others[0] - zeta)
            laws, connections = [*laws, (more, total["connections"])], stiffness + more
        U = range_of([total["C"], total["D"], *(X for _, X in laws)]) if damped is None else damped
        if U is None or not U.shape[1]:
            nothing = np.zeros((len(omega), 0, 0), dtype=complex)
            return cls(lam, V, stiffness, connections, mass, by_zeta, inverse, None, nothing, nothing)
        C, D = U.T @ total["C"] @ U, U.T @ total["D"] @ U
        Um, U_connections = V.T @ U, U.T @ total["connections"] @ U if others else None
        S = 1j * (omega[:, None, None] * C + D)
        for factor, X in laws:
            S = S + factor[:, None, None] * (U.T @ X @ U)
        # G = Umᵀ diag(1/...) Um is symmetric: one product gives its upper half at all lines.
        i, j = np.triu_indices(U.shape[1])
        half, where = times((Um[:, i] * Um[:, j]).T, inverse)[:, 0].T, np.empty(2 * [U.shape[1]], dtype=int)
        where[i, j] = where[j, i] = np.arange(len(i))
        G = half[:, where]
        yielding = np.eye(U.shape[1]) + S @ G
        return cls(lam, V, stiffness, connections, mass, by_zeta, inverse, Um, S, yielding, U_connections)

    @property
    def correct(self) -> NDArray[Any]:
        """(I + S G)⁻¹ S at each line (computed once)."""
        if self._correct is None:
            self._correct = np.linalg.solve(self.yielding, self.resisting)
        return self._correct

    def resisted(self, motions: Complexes) -> NDArray[Any]:
        """Return the forces (n_freq, k, n) of local dampers, from the motions without them."""
        # Where local damping acts on this many times more motions than are asked for, these alone are solved
        # for
        if 8 * motions.shape[2] < motions.shape[1] and self._correct is None:
            return np.linalg.solve(self.yielding, self.resisting @ motions)
        return self.correct @ motions

    def read(self, B: Floats, F: Complexes, places: Sequence[Floats]) -> tuple[Complexes, list[Complexes]]:
        """Return Bᵀ Z⁻¹ F and, for the motions P of each of some places, Bᵀ Z⁻¹ P, each (n_freq, n, m).

        B is (r, n); F (r, m, n_freq) and P (r, m) are in modal coordinates. The responses of all
        coordinates are never formed, as fewer are read.
        """
        R, X = self.V.T @ B, F * self.inverse
        if self.U is None:
            return lines_first(times(R.T, X)), [self._undamped(R, P) for P in places]
        U, n = self.U, R.shape[1]
        resisted = self._undamped(R, U) @ self.correct
        moved = lines_first(times(np.hstack([R, U]).T, X))
        at = [self._undamped(R, P) - resisted @ self._undamped(U, P) for P in places]
        return moved[:, :n] - resisted @ moved[:, n:], at

    def _undamped(self, A: Floats, B: Floats) -> Complexes:
        """Return Aᵀ Z⁻¹ B without local damping, (n_freq, n, m); A (r, n), B (r, m) in modal coordinates."""
        each = (A[:, :, None] * B[:, None, :]).reshape(len(A), -1)
        return lines_first(times(each.T, self.inverse).reshape(A.shape[1], B.shape[1], -1))

    def solve(self, B: Floats, *, transposed: bool = False) -> Complexes:
        """Return Z⁻¹ B or Z⁻ᵀ B in modal coordinates, (r, n, n_freq), for forces B (r, n).

        Local damping enters by Woodbury's identity, line by line; only it can make Z unsymmetric.
        """
        forces = self.V.T @ B
        if self.U is None:
            return forces[:, :, None] * self.inverse
        k, n = self.U.shape[1], forces.shape[1]
        each = (self.U[:, :, None] * forces[:, None, :]).reshape(len(forces), k * n)
        undamped = lines_first(times(each.T, self.inverse).reshape(k, n, -1))
        by = np.swapaxes(self.correct, 1, 2) @ undamped if transposed else self.resisted(undamped)
        resisted = times(self.U, np.moveaxis(by, 0, 2))
        np.subtract(forces[:, :, None], resisted, out=resisted)
        resisted *= self.inverse
        return resisted


def times(A: Floats, X: Complexes) -> Complexes:
    """Multiply a real matrix (m, r) with a complex array (r, n, n_freq) over r, by one real product."""
    flat = np.ascontiguousarray(X).reshape(len(X), -1).view(float)
    return (A @ flat).view(complex).reshape(len(A), *X.shape[1:])


def lines_first(X: Complexes) -> Complexes:
    """Return a copy of an array over lines (n, m, n_freq) as one matrix for each line, (n_freq, n, m)."""
    return np.ascontiguousarray(np.moveaxis(X, 2, 0))


def range_of(matrices: list[Floats]) -> Floats | None:
    """Return an orthonormal basis of the range of local damping and laws, None without any."""
    sizes = [float(np.abs(X).max()) for X in matrices]
    if max(sizes) == 0:
        return None
    # Not of squares, which lose a soft damper next to a stiff one: dissipation is semidefinite, so that
    # the range of the sum is that of all. Gyroscopic forces are skew, and squared; there are few.
    both = np.zeros_like(matrices[0])
    for X, size in zip(matrices, sizes, strict=True):
        if size > 0:
            skew = (X - X.T) / (2 * size)
            both += (X + X.T) / (2 * size) + (skew @ skew.T if skew.any() else 0.0)
    eigenvalues, vectors = sla.eigh(both, check_finite=False)
    return vectors[:, np.abs(eigenvalues) > 1e-13 * np.abs(eigenvalues).max()]
