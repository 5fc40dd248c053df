"""Receptances as sums over modes whose frequencies and damping ratios err, with derivatives."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem.reduction.modal_solution import ModalSolution, ModeErrors, times
from fem.reduction.parametric_frf import ParametricFRF
from fem.reduction.terms import Term


@dataclass(frozen=True, slots=True, eq=False)
class ModalResponses:
    """A solved state with errors of modes.

    Attributes
    ----------
    Xo, Xi : ndarray (r, n, n_freq)
        Responses to unit forces at outputs and inputs, in modal coordinates.
    """

    engine: ParametricFRF
    values: NDArray[np.float64]
    zeta: NDArray[np.float64]
    state: ModalSolution
    alone: list[Term]
    Xo: NDArray[np.complex128]
    Xi: NDArray[np.complex128]
    errors: ModeErrors

    @classmethod
    def of(
        cls,
        engine: ParametricFRF,
        values: NDArray[np.float64],
        zeta: NDArray[np.float64],
        errors: ModeErrors,
    ) -> "ModalResponses":
        """Solve with errors of the modes.

        Parameters
        ----------
        engine : ParametricFRF
        values : ndarray (n_par,)
            Values of the engine's parameters.
        zeta : ndarray (n_freq,) or (2, n_freq)
            Damping ratio at each line, and that of connections if it is another [-].
        errors : ModeErrors
        """
        values = np.asarray(values, dtype=float)
        state, _, alone = engine.solve(values, zeta, errors)
        Xi, Xo = state.solve(engine.inputs), state.solve(engine.outputs, transposed=True)
        return cls(engine, values, zeta, state, alone, Xo, Xi, errors)

    @property
    def shapes(self) -> NDArray[np.float64]:
        """Shapes of the modes at the outputs, (r, n_out)."""
        return self.state.V.T @ self.engine.outputs

    @property
    def H(self) -> NDArray[np.complex128]:
        """Receptances (n_freq, n_out, n_in)."""
        return np.moveaxis(times(self.shapes.T, self.Xi), 2, 0)

    def parts(self) -> NDArray[np.complex128]:
        """Return the part of each mode with an error in the receptances, (n, n_freq, n_out, n_in)."""
        own = self._own
        return np.einsum("ro,rif->rfoi", self.shapes[own], self.Xi[own])

    def slopes(self) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return dH by the parameters, (n_par, …), and by ζ at each line, as :meth:`ParametricFRF.evaluate`.

        The errors' part neglects the change of the mode shapes with the parameters. That change is as small
        beside the derivative as the errors are beside 1.
        """
        damped = self.state.lam * self.errors.damping_factor(len(self.state.lam))
        return self.engine.derivatives(self.values, self.zeta, self.state, self.Xi, self.alone, damped)

    def error_slopes(self) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return dH by δ and by κ, each (n, n_freq, n_out, n_in)."""
        own, state = self._own, self.state
        lam, ratio = state.lam[own, None], np.atleast_2d(self.zeta)[0]
        factor = self.errors.damping_factor(len(state.lam))[own, None]
        loss = 2j * ratio * factor
        stiffness = state.stiffness - 2j * ratio + loss
        product = np.einsum("rof,rif->rfoi", self.Xo[own], self.Xi[own])
        by = [(-lam * X)[:, :, None, None] * product for X in (stiffness, loss)]
        return by[0], by[1]

    @property
    def _own(self) -> slice:
        first = self.errors.first
        return slice(first, first + len(self.errors.eigenvalue))
