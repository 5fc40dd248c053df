"""Logarithmic residuals of FRFs on a reduced basis, with exact derivatives."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem.analysis.frf import FRFKind
from fem.analysis.frf_solver import compute_frf
from fem.model import Damping, Model, ParameterRef
from fem.reduction.parametric_frf import ParametricFRF
from fem.reduction.reduced_model import reduce_model
from fem.system import assemble
from updating.correlation import log_ratio
from updating.inference.frf_data import FRFData
from updating.inference.parameters import DampingCurve


@dataclass(frozen=True, slots=True, eq=False)
class FRFTerms:
    """Residuals of FRFs and their derivatives.

    Attributes
    ----------
    r : ndarray of complex (m,)
        ln(H_computed / H_measured) of the values that count, of amplitudes the real part [nepers and rad].
    weight : ndarray (m,)
        1/σ.
    by_values, by_ratios, by_shifts, by_gains : ndarray of complex (k, m) or None
        Derivatives of r.
    """

    r: NDArray[np.complex128]
    weight: NDArray[np.float64]
    by_values: NDArray[np.complex128] | None = None
    by_ratios: NDArray[np.complex128] | None = None
    by_shifts: NDArray[np.complex128] | None = None
    by_gains: NDArray[np.complex128] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class _OwnDamping:
    """A model's damping beside the engine's.

    Attributes
    ----------
    offset : ndarray of complex (n_freq, n_out, n_in)
        ln(H/H_engine) at the model's values.
    ratios : ndarray (n_knots,)
        There [-].
    by_ratios : ndarray of complex (n_knots, n_freq, n_out, n_in)
        Derivatives of ln H by them.
    """

    offset: NDArray[np.complex128]
    ratios: NDArray[np.float64]
    by_ratios: NDArray[np.complex128]


class FRFResidual:
    """Logarithmic residuals of FRFs on a reduced basis: after it is built nothing depends on the mesh.

    r = ln(g_i g_j H_computed(f (1 + δ(f))) / H_measured(f)): the real part is the amplitude's, the imaginary
    part the phase's, both with the standard deviation of the relative noise. δ, linear between the modes'
    frequencies, and g, one for each output and input, are errors with the right parameters: a shifted
    resonance moves all lines beside it at once, which no error of single lines could stand for.

    Parameters
    ----------
    data : FRFData
        With the lines to be fitted.
    model : Model
        The basis is made for its values: exact there, and near them.
    refs : sequence of (effect, parameter)
    ratio_knots, shift_knots : ndarray or None
        Frequencies between which modal damping ratios and δ are linear [Hz].
    exact : bool
        Whether ln(H/H_engine) at the model's values is added: the engine takes a modal ratio as 2iζ(ω)K,
        which is the same at resonances alone. Near these values FRFs then are the model's own.
    """

    def __init__(
        self,
        data: FRFData,
        model: Model,
        refs: Sequence[ParameterRef],
        ratio_knots: NDArray[np.float64] | None = None,
        shift_knots: NDArray[np.float64] | None = None,
        *,
        margin: float = 2.5,
        n_krylov: int = 3,
        exact: bool = False,
    ) -> None:
        highest = float(data.frequency[-1])
        forces = np.hstack([data.outputs, data.inputs])
        self.data, self.refs, self.model = data, tuple(refs), model
        self.reduced = reduce_model(
            model, forces, highest, margin=margin, n_krylov=n_krylov, releasable=False
        )
        self.ratio_hats = None if ratio_knots is None else _hats(ratio_knots, data.frequency)
        self.shift_hats = None if shift_knots is None else _hats(shift_knots, data.frequency)
        self._engine = self._engine_at(data.frequency)
        self._own = self._own_damping(ratio_knots) if exact else None

    def _own_damping(self, knots: NDArray[np.float64] | None) -> "_OwnDamping":
        """Return the model's damping beside the engine's, by the modes of the basis, which are its own."""
        d, known, damping = self.data, self.model.values(), self.model.damping
        values = np.array([known[ref] for ref in self.refs], dtype=float)
        H_engine = self._engine.evaluate(values, damping.ratio_at(d.frequency), False)[0]
        H = compute_frf(assemble(self.model), d.frequency, d.outputs.T, d.inputs.T, FRFKind.RECEPTANCE).H
        offset = np.nan_to_num(log_ratio(H, H_engine), nan=0.0)
        if knots is None:
            return _OwnDamping(offset, np.zeros(0), np.zeros((0, *H.shape), dtype=complex))
        basis = self.reduced.basis
        elastic = slice(basis.n_rigid, basis.n_modes)
        square = np.maximum(np.diag(self.reduced.base_sum["K"])[elastic], 1e-300)
        omega_r, omega = np.sqrt(square), 2 * np.pi * d.frequency[:, None]
        f_r = omega_r / (2 * np.pi)
        damped = 2 * damping.ratio_at(f_r) * omega_r + damping.alpha + damping.beta * square
        below = square * (1 + 1j * damping.loss_factor) - omega**2 + 1j * omega * damped
        slope = -2j * omega * omega_r / below**2  # of a mode's part of H, by its ratio
        out, into = (basis.T[:, elastic].T @ part for part in (d.outputs, d.inputs))
        per = np.divide(1.0, H, out=np.zeros_like(H), where=H != 0)
        by_ratios = np.array(
            [((slope * hat)[:, :, None] * out).transpose(0, 2, 1) @ into * per for hat in _hats(knots, f_r).T]
        )
        return _OwnDamping(offset, damping.ratio_at(knots), by_ratios)

    def _engine_at(self, frequency: NDArray[np.float64]) -> ParametricFRF:
        return ParametricFRF(self.reduced, self.data.outputs, self.data.inputs, frequency, self.refs)

    @property
    def n_data(self) -> int:
        """Number of real residuals."""
        return self.data.n_parts * int(self.data.mask.sum())

    def seen(self, least: float = 1e-3) -> NDArray[np.float64]:
        """Return the natural frequencies in the band that forces excite and outputs show [Hz].

        Parameters
        ----------
        least : float
            Modes with less than this part of the largest product of shapes are left out [-].
        """
        basis, d = self.reduced.basis, self.data
        elastic = slice(basis.n_rigid, basis.n_modes)
        f = np.sqrt(np.maximum(np.diag(self.reduced.base_sum["K"])[elastic], 0.0)) / (2 * np.pi)
        product = np.abs(basis.T[:, elastic].T @ d.outputs).max(axis=1) * np.abs(
            basis.T[:, elastic].T @ d.inputs
        ).max(axis=1)
        inside = (f >= d.frequency[0]) & (f <= d.frequency[-1])
        return f[inside & (product > least * product.max(initial=0.0))]

    def evaluate(
        self,
        values: NDArray[np.float64],
        gradient: bool,
        *,
        ratios: NDArray[np.float64] | None = None,
        shifts: NDArray[np.float64] | None = None,
        gains: NDArray[np.float64] | None = None,
    ) -> FRFTerms:
        """Compute residuals and derivatives.

        Parameters
        ----------
        values : ndarray (n_ref,)
            Values of ``refs``.
        gradient : bool
        ratios : ndarray (n_knots,), optional
            Damping ratios at the knots; the model's unless given [-].
        shifts : ndarray (n_knots,), optional
            δ at the knots [-].
        gains : ndarray (n_out + n_in,), optional
            ln g_i of outputs, then ln g_j of inputs [-].
        """
        d, keep = self.data, self.data.mask
        zeta = self.model.damping.ratio_at(d.frequency)
        own = self._own
        if ratios is not None and self.ratio_hats is not None and own is None:
            zeta = self.ratio_hats @ ratios
        engine, lines = self._engine, d.frequency
        if shifts is not None and self.shift_hats is not None and shifts.any():
            lines = d.frequency * (1 + self.shift_hats @ shifts)
            engine = self._engine_at(lines)
        H, dH, dH_dzeta = engine.evaluate(values, zeta, gradient)
        r = log_ratio(H, d.H)
        if own is not None:
            r = r + own.offset
            if ratios is not None and len(own.ratios):
                r = r + np.tensordot(ratios - own.ratios, own.by_ratios, axes=1)
        n_out = d.outputs.shape[1]
        if gains is not None:
            r = r + gains[:n_out, None] + gains[n_out:]
        r = d.seen(np.nan_to_num(r, nan=0.0)[keep])
        weight = (1 / d.noise)[keep]
        if not gradient or dH is None or dH_dzeta is None:
            return FRFTerms(r, weight)
        per = np.divide(1.0, H, out=np.zeros_like(H), where=H != 0)
        by_values = np.array([(slope * per)[keep] for slope in dH]).reshape(len(dH), r.size)
        by_ratios = by_shifts = by_gains = None
        if ratios is not None and self.ratio_hats is not None:
            base = dH_dzeta * per
            by_ratios = (
                np.array([(hat[:, None, None] * base)[keep] for hat in self.ratio_hats.T])
                if own is None
                else own.by_ratios[:, keep]
            )
        if shifts is not None and self.shift_hats is not None:
            step = 3e-8  # between the curvature of the logarithm and rounding
            ahead = self._engine_at(lines + step * d.frequency).evaluate(values, zeta, False)[0]
            slope = np.nan_to_num(log_ratio(ahead, H), nan=0.0) / step
            by_shifts = np.array([(hat[:, None, None] * slope)[keep] for hat in self.shift_hats.T])
        if gains is not None:
            one = np.eye(len(gains), dtype=complex)
            sums = one[:, :n_out, None] + one[:, None, n_out:]
            by_gains = np.array([np.broadcast_to(part, H.shape)[keep] for part in sums])
        slopes = (None if x is None else d.seen(x) for x in (by_values, by_ratios, by_shifts, by_gains))
        return FRFTerms(r, weight, *slopes)


def _hats(knots: NDArray[np.float64], frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    return DampingCurve(knots, knots, 1.0).hats(frequency)


def with_ratios(model: Model, knots: NDArray[np.float64], ratios: NDArray[np.float64]) -> Model:
    """Return a model with other modal damping ratios; its other damping stays."""
    d = model.damping
    return model.with_damping(Damping(knots, ratios, d.alpha, d.beta, d.loss_factor))
