"""Springs whose stiffness and damping depend on frequency: rubber mounts, gaskets, tables from a test."""

from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from fem.array_types import Complexes, Floats
from fem.declarations import Environment, Role, Site
from fem.effects.joint import PointPair, joint_unit
from fem.laws import FractionalKelvinVoigt, FractionalZener, TabulatedLaw, Zener, check_table
from fem.model import DIRECTIONS, Contribution, Model, ModelError, Parameter

LAWS = {"zener": Zener, "fractional_kelvin_voigt": FractionalKelvinVoigt, "fractional_zener": FractionalZener}
"""Viscoelastic laws by name."""

_BOUNDS = {"ratio": ("-", 1e-3, 1e4, True), "tau": ("s", 1e-9, 1e3, True), "alpha": ("-", 0.01, 1.0, False)}


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Viscoelastic(PointPair):
    """A massless element between two points, or to the ground, of stiffness law(ω) K.

    Attributes
    ----------
    K : ndarray (6, 6)
        Static stiffness in the element's axes [N/m, N·m/rad].
    law : Zener, FractionalKelvinVoigt or FractionalZener
        Factor of K over frequency.
    """

    kind: ClassVar[str] = "viscoelastic"
    role: ClassVar[Role] = Role.STIFFNESS | Role.DISSIPATION
    environment: ClassVar[Environment | None] = Environment.ELASTOMER
    K: NDArray[Any]
    law: Zener | FractionalKelvinVoigt | FractionalZener

    def __post_init__(self) -> None:
        self.check()
        if np.shape(self.K) != (6, 6) or np.abs(self.K - self.K.T).max() > 1e-9 * np.abs(self.K).max():
            msg = f"viscoelastic element '{self.name}': K must be a symmetric (6, 6) matrix"
            raise ModelError(msg)
        for f in fields(self.law):
            _, lower, upper, _ = _BOUNDS[f.name]
            value = float(np.real(getattr(self.law, f.name)))
            if not lower <= value <= upper:
                msg = (
                    f"viscoelastic element '{self.name}': {f.name} is {value:g}; "
                    f"it lies between {lower:g} and {upper:g}"
                )
                raise ModelError(msg)

    @property
    def where(self) -> Site:
        """The element's name."""
        return Site(f"element {self.name}")

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the static stiffnesses ``kx … krz`` on K's diagonal and the law's parameters."""
        k = np.diag(self.K)
        out = [
            Parameter(f"k{d}", joint_unit(d), k[i], 0.0, 1e-6 * k[i], 1e6 * k[i], log=True, linear=True)
            for i, d in enumerate(DIRECTIONS)
            if np.real(k[i]) > 0
        ]
        for f in fields(self.law):
            unit, lower, upper, log = _BOUNDS[f.name]
            absent = 1.0 if f.name == "alpha" else 0.0
            out.append(Parameter(f.name, unit, getattr(self.law, f.name), absent, lower, upper, log=log))
        return tuple(out)

    def with_values(self, **values: Any) -> Self:
        """Return an element with other static stiffnesses or another law."""
        K = np.array(self.K, dtype=np.result_type(float, self.K, *map(type, values.values())))
        of_law = {}
        for name, value in values.items():
            if name in _BOUNDS:
                of_law[name] = value
            else:
                i = DIRECTIONS.index(name[1:])
                K[i, i] = value
        return replace(self, K=K, law=replace(self.law, **of_law))

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return law(ω) BᵀKB."""
        dofs, B = self.relative(model)
        return (Contribution(dofs[None], (B.T @ self.K @ B)[None], law=self.law),)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TabulatedStiffness(PointPair):
    """A massless element between two points, or to the ground, with a table of complex 6×6 stiffnesses K(ω).

    Between the table's frequencies every entry is linear, outside constant.

    Attributes
    ----------
    frequency : ndarray (n,)
        Increasing frequencies [Hz].
    K : ndarray of complex (n, 6, 6)
        Dynamic stiffness in the element's axes, symmetric: real part storage, imaginary part loss
        [N/m, N·m/rad].
    factor : float
        Multiplies the table [-].
    """

    kind: ClassVar[str] = "tabulated_stiffness"
    role: ClassVar[Role] = Role.STIFFNESS | Role.DISSIPATION
    frequency: Floats
    K: Complexes
    factor: Any = field(default=1.0)

    def __post_init__(self) -> None:
        self.check()
        what = f"the table of element '{self.name}'"
        if np.shape(self.K)[1:] != (6, 6):
            msg = f"{what} has shape {np.shape(self.K)}; (n, 6, 6) is expected"
            raise ModelError(msg)
        check_table(np.asarray(self.frequency), self.K.reshape(len(self.K), 36), what)
        if np.abs(self.K - np.swapaxes(self.K, 1, 2)).max() > 1e-6 * np.abs(self.K).max():
            msg = f"{what} is not symmetric"
            raise ModelError(msg)

    @property
    def where(self) -> Site:
        """The element's name."""
        return Site(f"element {self.name}")

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the factor."""
        return (Parameter("factor", "-", self.factor, 0.0, 1e-6, 1e6, log=True, linear=True),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return one law for each entry of the table.

        K = Σ_{i<j} K_ij (e_i + e_j)(e_i + e_j)ᵀ + Σ_i (K_ii - Σ_{j≠i} K_ij) e_i e_iᵀ.
        """
        dofs, B = self.relative(model)
        total = self.K.sum(axis=2)
        parts = []
        for i in range(6):
            for j in range(i, 6):
                k = self.K[:, i, j] if i < j else 2 * self.K[:, i, i] - total[:, i]
                if not k.any():
                    continue
                b = B[i] + B[j] if i < j else B[i]
                law = TabulatedLaw(self.frequency, np.real(k), np.imag(k))
                parts.append(Contribution(dofs[None], self.factor * np.outer(b, b)[None], law=law))
        return tuple(parts)
