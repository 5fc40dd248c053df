"""Joints whose stiffness or damping depends on amplitude, by describing functions.

In harmonic motion δ = a sin ωt a force f(δ) has the fundamental component k(a) δ with the complex stiffness
k(a) = (1/πa) ∫₀^2π f(a sin τ) (sin τ + i cos τ) dτ (Krylov & Bogoliubov; Worden & Tomlinson, Nonlinearity in
Structural Dynamics, ch. 3). Each of these effects has the matrices of one amplitude; `stiffness_at` gives k
at any, for :mod:`fem.analysis.harmonic_balance`. Their change with the amplitude
tells them from one another and from linear ones: a search takes them up where measurements at two or more
force levels differ.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from fem.array_types import Complexes, Floats
from fem.declarations import Entry, Role, StiffnessAt
from fem.effects.joint import TRANSLATIONS, joint_unit
from fem.effects.places import InDirection
from fem.model import Contribution, Model, ModelError, Parameter

ANY_AMPLITUDE = 1e-5
"""Amplitude of what is proposed, which a search replaces [m or rad]."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class AmplitudeDependent(InDirection):
    """An element in parallel with a joint's spring in one direction, with the matrices of one amplitude.

    Attributes
    ----------
    joint, direction : str
        Name of a joint and a direction in which it moves.
    amplitude : float
        a, amplitude of the relative motion [m or rad].
    reference : float
        The joint's stiffness in the direction, which sets the scale [N/m or N·m/rad].
    """

    amplitude_dependent: ClassVar[bool] = True
    amplitude: float
    reference: float = 1e6

    def __post_init__(self) -> None:
        if not self.amplitude > 0:
            msg = f"{self.kind} '{self.name}': the amplitude is {self.amplitude}; it must be positive"
            raise ModelError(msg)

    @property
    def _length(self) -> str:
        return "m" if self.direction in TRANSLATIONS else "rad"

    @property
    def _force(self) -> str:
        return "N" if self.direction in TRANSLATIONS else "N·m"

    def equivalent(self) -> tuple[Any, Any]:
        """Return the storage and the loss stiffness at the amplitude [N/m or N·m/rad]."""
        raise NotImplementedError

    def stiffness_at(self, amplitude: Floats) -> Complexes:
        """Return k at amplitudes of any shape, all above 0 [N/m or N·m/rad]."""
        raise NotImplementedError

    def slopes_at(self, amplitude: Floats) -> tuple[Complexes, Mapping[str, Complexes]]:
        """Return dk/da, and dk by each parameter, at amplitudes of any shape."""
        raise NotImplementedError

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return K and D of the equivalent stiffness."""
        dofs, b = self.strain(model, self.direction)
        square = np.outer(b, b)
        storage, loss = self.equivalent()
        K, D = ((k * square)[None] if k is not None else None for k in (storage, loss))
        return (Contribution(dofs[None], K, D=D),)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JointCubic(AmplitudeDependent):
    """A cubic spring in parallel with a joint's spring, f = k₃ δ³: k(a) = ¾ k₃ a².

    Attributes
    ----------
    cubic : float
        k₃, negative for softening [N/m³ or N·m/rad³].
    """

    kind: ClassVar[str] = "joint_cubic"
    role: ClassVar[Role] = Role.STIFFNESS
    entry: ClassVar[Entry | None] = Entry(
        quantities="`cubic` [N/m³ or N·m/rad³]",
        meaning="a cubic spring in parallel with a joint's spring, from two force levels",
        places="each elastic direction of each joint, with two force levels",
    )
    cubic: Any

    def parameters(self) -> tuple[Parameter, ...]:
        """Return k₃."""
        unit = f"{self._force}/{self._length}³"
        return (Parameter("cubic", unit, self.cubic, 0.0, -1e30, 1e30, linear=True),)

    def equivalent(self) -> tuple[Any, Any]:
        """Return ¾ k₃ a² and no loss."""
        return 0.75 * self.cubic * self.amplitude**2, None

    def stiffness_at(self, amplitude: Floats) -> Complexes:
        """Return ¾ k₃ a²."""
        return (0.75 * self.cubic * amplitude**2).astype(complex)

    def slopes_at(self, amplitude: Floats) -> tuple[Complexes, Mapping[str, Complexes]]:
        """Return 3/2 k₃ a, and ¾ a² by k₃."""
        by_parameter = {"cubic": (0.75 * amplitude**2).astype(complex)}
        return (1.5 * self.cubic * amplitude).astype(complex), by_parameter

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """Equivalent stiffnesses of 10⁻³ to 30 times the joint's, softening up to nine tenths of it."""
        unit = self.reference / (0.75 * self.amplitude**2)
        up = np.geomspace(1e-3, 30.0, 14)
        return tuple({"cubic": float(f * unit)} for f in (*up, *(-up[up < 0.9])))

    @classmethod
    def propose(cls, model: Model) -> tuple[Self, ...]:
        """Each elastic direction of each joint."""
        return cls.of_elastic(model, amplitude=ANY_AMPLITUDE, cubic=0.0)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JointGap(AmplitudeDependent):
    """A spring in parallel with a joint's spring that acts only beyond a gap on either side.

    k(a) = k (1 - 2/π (asin(g/a) + (g/a) √(1 - (g/a)²))) for a > g, 0 below.

    Attributes
    ----------
    stiffness : float
        k, beyond the gap [N/m or N·m/rad].
    gap : float
        g, from the middle to either stop [m or rad].
    """

    kind: ClassVar[str] = "joint_gap"
    role: ClassVar[Role] = Role.STIFFNESS
    entry: ClassVar[Entry | None] = Entry(
        quantities="`stiffness` [N/m or N·m/rad], `gap` [m or rad]",
        meaning="a spring parallel to a joint's that acts beyond a gap on either side, from two force levels",
        places="each elastic direction of each joint, with two force levels",
    )
    stiffness: Any
    gap: Any

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the stiffness and the gap."""
        return (
            Parameter("stiffness", joint_unit(self.direction), self.stiffness, 0.0, 0.0, 1e18),
            Parameter("gap", self._length, self.gap, self.gap, 0.0, 100 * self.amplitude),
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

    def stiffness_at(self, amplitude: Floats) -> Complexes:
        """Return k (1 - 2/π (asin x + x √(1 - x²))) with x = g/a, 0 for x above 1."""
        x = np.minimum(self.gap / amplitude, 1.0)
        return (self.stiffness * (1 - 2 / np.pi * (np.arcsin(x) + x * np.sqrt(1 - x**2)))).astype(complex)

    def slopes_at(self, amplitude: Floats) -> tuple[Complexes, Mapping[str, Complexes]]:
        """Return the slopes by a, by k, and by g: dk/dx = -4/π k √(1 - x²)."""
        x = np.minimum(self.gap / amplitude, 1.0)
        root = np.sqrt(1 - x**2)
        by_x = -4 / np.pi * self.stiffness * root
        by_parameter = {
            "stiffness": (1 - 2 / np.pi * (np.arcsin(x) + x * root)).astype(complex),
            "gap": (by_x / amplitude).astype(complex),
        }
        return (-by_x * x / amplitude).astype(complex), by_parameter

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """Stiffnesses of a hundredth to a hundred times the joint's, and gaps below the amplitude."""
        return tuple(
            {"stiffness": float(f * self.reference), "gap": g * self.amplitude}
            for f in np.geomspace(1e-2, 1e2, 9)
            for g in (0.03, 0.1, 0.3, 0.6, 0.9)
        )

    @classmethod
    def propose(cls, model: Model) -> tuple[Self, ...]:
        """Each elastic direction of each joint."""
        return cls.of_elastic(model, amplitude=ANY_AMPLITUDE, stiffness=0.0, gap=1e-6)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JointFriction(AmplitudeDependent):
    """Dry friction parallel to a joint's spring, F sign(dδ/dt): k(a) = i 4F/(πa), less the larger the motion.

    Attributes
    ----------
    force : float
        F, force of sliding friction [N or N·m].
    """

    kind: ClassVar[str] = "joint_friction"
    role: ClassVar[Role] = Role.DISSIPATION
    entry: ClassVar[Entry | None] = Entry(
        quantities="`force` [N or N·m]",
        meaning="dry friction in parallel with a joint's spring, from two force levels",
        places="each elastic direction of each joint, with two force levels",
    )
    force: Any

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the force."""
        return (Parameter("force", self._force, self.force, 0.0, 0.0, 1e12, linear=True),)

    def equivalent(self) -> tuple[Any, Any]:
        """Return no stiffness, and the loss 4F/(πa)."""
        return None, 4 * self.force / (np.pi * self.amplitude)

    def stiffness_at(self, amplitude: Floats) -> Complexes:
        """Return i 4F/(πa)."""
        return 4j * self.force / (np.pi * amplitude)

    def slopes_at(self, amplitude: Floats) -> tuple[Complexes, Mapping[str, Complexes]]:
        """Return -i 4F/(πa²), and i 4/(πa) by F."""
        return -4j * self.force / (np.pi * amplitude**2), {
            "force": (4j / (np.pi * amplitude)).astype(complex)
        }

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """Losses of 10⁻³ to 10 times the joint's stiffness."""
        unit = self.reference * np.pi * self.amplitude / 4
        return tuple({"force": float(f * unit)} for f in np.geomspace(1e-3, 10.0, 17))

    @classmethod
    def propose(cls, model: Model) -> tuple[Self, ...]:
        """Each elastic direction of each joint."""
        return cls.of_elastic(model, amplitude=ANY_AMPLITUDE, force=0.0)
