"""Joints whose stiffness or damping depends on amplitude, by describing functions.

In harmonic motion δ = a sin ωt a force f(δ) has the fundamental component k(a) δ with the complex stiffness
k(a) = (1/πa) ∫₀^2π f(a sin τ) (sin τ + i cos τ) dτ (Krylov & Bogoliubov; Worden & Tomlinson, Nonlinearity in
Structural Dynamics, ch. 3). Each of these effects has the matrices of one amplitude. What tells them from
one another is how they change with it, which needs measurements at two or more force levels: they are not
proposed.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fem.effects.joint import TRANSLATIONS, joint_unit
from fem.effects.places import OnJoint
from fem.model import Contribution, Model, ModelError, Parameter


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _AmplitudeDependent(OnJoint):
    amplitude_dependent: ClassVar[bool] = True
    direction: str
    amplitude: float

    def __post_init__(self) -> None:
        if not self.amplitude > 0:
            msg = f"{self.kind} '{self.name}': the amplitude is {self.amplitude}; it must be positive"
            raise ModelError(msg)

    @property
    def where(self) -> str:
        """Joint and direction."""
        return f"joint {self.joint}, {self.direction}"

    @property
    def _length(self) -> str:
        return "m" if self.direction in TRANSLATIONS else "rad"

    @property
    def _force(self) -> str:
        return "N" if self.direction in TRANSLATIONS else "N·m"

    def equivalent(self) -> tuple[Any, Any]:
        """Return the storage and the loss stiffness at the amplitude [N/m or N·m/rad]."""
        raise NotImplementedError

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return K and D of the equivalent stiffness."""
        dofs, b = self.strain(model, self.direction)
        square = np.outer(b, b)
        storage, loss = self.equivalent()
        K, D = ((k * square)[None] if k is not None else None for k in (storage, loss))
        return (Contribution(dofs[None], K, D=D),)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JointCubic(_AmplitudeDependent):
    """A cubic spring beside a joint's own, f = k₃ δ³: k(a) = ¾ k₃ a².

    Attributes
    ----------
    joint, direction : str
        Name of a joint and a direction in which it moves.
    amplitude : float
        a, amplitude of the relative motion [m or rad].
    cubic : float
        k₃, negative for softening [N/m³ or N·m/rad³].
    """

    kind: ClassVar[str] = "joint_cubic"
    cubic: Any

    def parameters(self) -> tuple[Parameter, ...]:
        """Return k₃."""
        unit = f"{self._force}/{self._length}³"
        return (Parameter("cubic", unit, self.cubic, 0.0, -1e30, 1e30, linear=True),)

    def equivalent(self) -> tuple[Any, Any]:
        """Return ¾ k₃ a² and no loss."""
        return 0.75 * self.cubic * self.amplitude**2, None

    def starts(self, scale: Callable[[tuple[str, str]], float]) -> tuple[dict[str, float], ...]:
        """Equivalent stiffnesses of 10² to 10⁸, either way."""
        return tuple(
            {"cubic": s * 10.0**e / (0.75 * self.amplitude**2)} for e in (2, 4, 6, 8) for s in (-1, 1)
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JointGap(_AmplitudeDependent):
    """A spring beside a joint's own that acts only beyond a gap on either side.

    k(a) = k (1 - 2/π (asin(g/a) + (g/a) √(1 - (g/a)²))) for a > g, 0 below.

    Attributes
    ----------
    joint, direction : str
        Name of a joint and a direction in which it moves.
    amplitude : float
        a, amplitude of the relative motion [m or rad].
    stiffness : float
        k, beyond the gap [N/m or N·m/rad].
    gap : float
        g, from the middle to either stop [m or rad].
    """

    kind: ClassVar[str] = "joint_gap"
    stiffness: Any
    gap: Any

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the stiffness and the gap."""
        return (
            Parameter("stiffness", joint_unit(self.direction), self.stiffness, 0.0, 0.0, 1e18),
            Parameter("gap", self._length, self.gap, self.gap, 0.0, 10 * self.amplitude),
        )

    def equivalent(self) -> tuple[Any, Any]:
        """Return k(a) and no loss."""
        x = self.gap / self.amplitude
        if np.real(x) >= 1:
            return 0.0 * self.stiffness, None
        root = np.sqrt(1 - x**2)
        # asin by real arithmetic, with its slope for complex steps: numpy's of a complex number loses them
        angle = (
            np.arcsin(np.real(x)) + 1j * np.imag(x) / np.real(root) if np.iscomplexobj(x) else np.arcsin(x)
        )
        return self.stiffness * (1 - 2 / np.pi * (angle + x * root)), None

    def starts(self, scale: Callable[[tuple[str, str]], float]) -> tuple[dict[str, float], ...]:
        """Stiffnesses of 10² to 10⁸ and gaps of a tenth to nine tenths of the amplitude."""
        return tuple(
            {"stiffness": 10.0**e, "gap": g * self.amplitude} for e in (2, 4, 6, 8) for g in (0.1, 0.5, 0.9)
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JointFriction(_AmplitudeDependent):
    """Dry friction beside a joint's spring, F sign(dδ/dt): k(a) = i 4F/(πa), less the larger the motion.

    Attributes
    ----------
    joint, direction : str
        Name of a joint and a direction in which it moves.
    amplitude : float
        a, amplitude of the relative motion [m or rad].
    force : float
        F, force of sliding friction [N or N·m].
    """

    kind: ClassVar[str] = "joint_friction"
    force: Any

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the force."""
        return (Parameter("force", self._force, self.force, 0.0, 0.0, 1e12, linear=True),)

    def equivalent(self) -> tuple[Any, Any]:
        """Return no stiffness, and the loss 4F/(πa)."""
        return None, 4 * self.force / (np.pi * self.amplitude)

    def starts(self, scale: Callable[[tuple[str, str]], float]) -> tuple[dict[str, float], ...]:
        """Losses of 10² to 10⁷."""
        return tuple({"force": 10.0**e * np.pi * self.amplitude / 4} for e in range(2, 8))
