"""Derivatives of element matrices with respect to the parameters of effects.

They come from a complex step through an effect's element matrices, exact to rounding: with a step of 10⁻²⁰⁰
neither truncation nor cancellation is left. Constraints do not depend on parameters.
"""

from dataclasses import dataclass

import numpy as np

from fem.array_types import Bools, Complexes, Floats, Ints
from fem.model import Array, Contribution, Law, Model, ModelError, ParameterRef, parameter_values

_STEP = 1e-200
"""Complex step; derivatives are exact to rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class MatrixDerivative:
    """The derivative of one contribution with respect to one parameter.

    Attributes
    ----------
    dofs : ndarray of int (b, m)
        Global DOF numbers of the elements that change.
    K, M, C, D : ndarray (b, m, m) or None
        Derivatives; K that of the stiffness at ω = 0.
    law : Law or None
        Dependence on frequency at the parameter's value plus the complex step, and ``stiffness``, the complex
        (b, m, m) that it multiplies.
    """

    dofs: Ints
    K: Floats | None
    M: Floats | None
    C: Floats | None
    D: Floats | None
    law: Law | None = None
    stiffness: Array | None = None

    def dynamic_stiffness(self, model: Model, omega: float) -> Complexes:
        """Return dZ(ω) of the elements, (b, m, m), with the structure's Rayleigh and structural damping."""
        damping = model.damping
        factors = (
            1 + 1j * (damping.loss_factor + omega * damping.beta),
            1j * omega * damping.alpha - omega**2,
            1j * omega,
            1j,
        )
        m = self.dofs.shape[1]
        Z = np.zeros((len(self.dofs), m, m), dtype=complex)
        for factor, X in zip(factors, (self.K, self.M, self.C, self.D), strict=True):
            if X is not None:
                Z += factor * X
        if self.law is not None and self.stiffness is not None:
            storage, loss = self.law(np.array([omega]))
            storage = storage[0] - self.law(np.zeros(1))[0][0]
            change = complex(np.real(storage), np.real(loss[0]))
            slope = complex(np.imag(storage), np.imag(loss[0])) / _STEP
            Z += slope * np.real(self.stiffness) + change * np.imag(self.stiffness) / _STEP
        return Z


def differentiate_matrices(model: Model, ref: ParameterRef) -> tuple[MatrixDerivative, ...]:
    """Return the derivatives of the element matrices with respect to one parameter.

    A complex step of 10⁻²⁰⁰ through the contributions of the effect and of those that refer to it. Elements
    that do not change are left out.

    Parameters
    ----------
    model : Model
    ref : (effect, parameter)
        Names of an effect of the model and of its parameter.

    Raises
    ------
    ModelError
        For an effect or parameter that the model does not have, or a value that is not finite.
    """
    effect, value = model.effect(ref[0]), finite_value(model, ref)
    changed = effect.with_values(**{ref[1]: value + 1j * _STEP})
    parts = list(model.parts_of(changed))
    others = [e for e in model.effects if ref in e.refers_to(model)]
    if others:
        stepped = model.with_values({ref: value + 1j * _STEP})
        parts += [part for e in others for part in stepped.parts_of(e)]
    out = []
    for part in parts:
        slopes = [None if X is None else np.imag(X) / _STEP for X in (part.static, part.M, part.C, part.D)]
        moving = part.law is not None
        changed = np.full(len(part.dofs), moving)
        for X in slopes:
            if X is not None:
                changed |= X.any(axis=(1, 2))
        if not changed.any():
            continue
        K, M, C, D = (None if X is None or not X.any() else X[changed] for X in slopes)
        law, stiffness = (part.law, _kept(part, changed)) if moving else (None, None)
        out.append(MatrixDerivative(part.dofs[changed], K, M, C, D, law, stiffness))
    return tuple(out)


def finite_value(model: Model, ref: ParameterRef) -> float:
    """Return the present value of a parameter; raise an error if there is none that is finite."""
    name, parameter = ref
    values = parameter_values(model.effect(name))
    if parameter not in values:
        msg = f"effect '{name}' has no parameter '{parameter}'; it has {', '.join(values) or 'none'}"
        raise ModelError(msg)
    if not np.isfinite(values[parameter]):
        msg = f"parameter '{parameter}' of effect '{name}' is {values[parameter]}; give it a finite value"
        raise ModelError(msg)
    return values[parameter]


def _kept(part: Contribution, rows: Bools) -> Array:
    assert part.K is not None
    return part.K[rows]
