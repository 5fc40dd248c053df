"""Joints whose stiffness and damping depend on frequency: rubber, gaskets, adhesives."""

from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar, Self

import numpy as np

from fem.declarations import Entry, Environment, Marker, Role, StiffnessAt
from fem.effects.joint import Joint, joint_unit
from fem.effects.places import InDirection
from fem.laws import Maxwell, SpringPot
from fem.model import DIRECTIONS, Contribution, Effect, Law, Model, Parameter, ParameterRef

_REFERENCE = 100.0
"""Frequency at which a spring-pot's strength is meant [Hz]."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _JointViscoelastic(InDirection):
    """Common part: a direction, elastic or rigid in the model, and a branch parallel to the spring."""

    assumed: float
    stiffness: Any = 1e6

    @property
    def rigid(self) -> bool:
        """Whether the model is rigid in the direction."""
        return bool(np.isinf(self.assumed))

    def _stiffness(self) -> tuple[Parameter, ...]:
        unit = joint_unit(self.direction)
        one = Parameter("stiffness", unit, self.stiffness, np.inf, 1e-6, 1e18, log=True)
        return (one,) if self.rigid else ()

    def _parts(self, model: Model, share: Any, law: Law) -> tuple[Contribution, ...]:
        dofs, b = self.strain(model, self.direction)
        i = DIRECTIONS.index(self.direction)
        k = self.stiffness if self.rigid else self.of(model).K[i, i]
        K = k * np.outer(b, b)
        branch = Contribution(dofs[None], (share * K)[None], law=law)
        return (Contribution(dofs[None], K[None]), branch) if self.rigid else (branch,)

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return the joint's stiffness in the direction, where it has one."""
        return () if self.rigid else ((self.joint, f"k{self.direction}"),)

    def released(self) -> tuple[tuple[str, str], ...]:
        """Return the joint's constraint in the direction, where it is rigid."""
        return ((self.joint, self.direction),) if self.rigid else ()

    def _grid(self, scale: StiffnessAt, laws: list[dict[str, float]]) -> tuple[dict[str, float], ...]:
        if not self.rigid:
            return tuple(laws)
        k = scale((self.joint, self.direction))
        return tuple(
            {"stiffness": float(f * k), **law} for f, law in product(np.geomspace(1e-2, 1e2, 9), laws)
        )

    @classmethod
    def _each(cls, model: Model, **values: float) -> tuple[Self, ...]:
        return tuple(
            cls(
                name=f"{cls.kind}:{j.name}.{d}",
                joint=j.name,
                direction=d,
                assumed=np.inf if d in j.rigid else float(j.K[i, i]),
                **values,
            )
            for j in model.of_kind(Joint)
            for i, d in enumerate(DIRECTIONS)
            if d in j.rigid or d in j.elastic
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JointZener(_JointViscoelastic):
    """A spring and a dashpot in series, parallel to a joint's spring: k (1 + r iωτ / (1 + iωτ)).

    The model's k stays where it has one: ΔZ = k r iωτ / (1 + iωτ). Where the model is rigid, k is a parameter
    too. With a small τ it is a dashpot (``joint_viscous_damping``), with a large one a stiffer joint
    (``joint_stiffness``): these are its twins if the band shows but one side of 1/τ.

    Attributes
    ----------
    joint, direction : str
        Name of a joint and one of its directions, elastic or rigid.
    ratio : float
        r, stiffness that is added at high frequency over the static one [-].
    tau : float
        τ, relaxation time [s].
    assumed : float
        The model's stiffness; ``inf`` where it is rigid [N/m or N·m/rad].
    stiffness : float
        The static stiffness where the model is rigid [N/m or N·m/rad].
    """

    kind: ClassVar[str] = "joint_zener"
    role: ClassVar[Role] = Role.STIFFNESS | Role.DISSIPATION
    environment: ClassVar[Environment | None] = Environment.ELASTOMER
    marker: ClassVar[Marker | None] = Marker("diamond", "sky")
    entry: ClassVar[Entry | None] = Entry(
        quantities="`ratio` [-], `tau` [s], `stiffness` [N/m or N·m/rad] where the model is rigid",
        meaning="a spring and a dashpot in series, parallel to a joint's spring",
        places="each direction of each joint",
    )
    ratio: Any
    tau: Any

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the ratio, the relaxation time and, where the model is rigid, the stiffness."""
        low = 0.1 if self.rigid else 0.0  # below it is a spring, which is another kind
        return (
            *self._stiffness(),
            Parameter("ratio", "-", self.ratio, 0.0, low, 30.0),
            Parameter("tau", "s", self.tau, self.tau, 1e-6, 1.0, log=True),
        )

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return the spring where the model is rigid, and the branch parallel to it."""
        return self._parts(model, self.ratio, Maxwell(self.tau))

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """Relaxation at 1.6 Hz to 16 kHz, a half to ten times stiffer at high frequency."""
        many = not self.rigid
        ratios, taus = ((0.3, 1.0, 3.0, 10.0), 9) if many else ((0.5, 3.0), 5)
        laws = [{"ratio": r, "tau": float(t)} for t in np.geomspace(1e-5, 0.1, taus) for r in ratios]
        return self._grid(scale, laws)

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Each elastic and each rigid direction of each joint."""
        return cls._each(model, ratio=1.0, tau=1e-3)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class JointFractional(_JointViscoelastic):
    """A spring-pot parallel to a joint's spring: k (1 + s (iω/ω₀)^α), ω₀ = 2π · 100 Hz.

    The fractional Kelvin-Voigt law, of rubber over many decades. The model's k stays where it has one; where
    the model is rigid, k is a parameter too. With an exponent near 0 it is a loss factor
    (``joint_structural_damping``), near 1 a dashpot (``joint_viscous_damping``), and over a narrow band a
    ``joint_zener`` does the same: these are its twins.

    Attributes
    ----------
    joint, direction : str
        Name of a joint and one of its directions, elastic or rigid.
    strength : float
        s, stiffness of the spring-pot at 100 Hz in multiples of the static one [-].
    exponent : float
        α [-].
    assumed : float
        The model's stiffness; ``inf`` where it is rigid [N/m or N·m/rad].
    stiffness : float
        The static stiffness where the model is rigid [N/m or N·m/rad].
    """

    kind: ClassVar[str] = "joint_fractional"
    role: ClassVar[Role] = Role.STIFFNESS | Role.DISSIPATION
    environment: ClassVar[Environment | None] = Environment.ELASTOMER
    marker: ClassVar[Marker | None] = Marker("diamond", "vermilion")
    entry: ClassVar[Entry | None] = Entry(
        quantities="`strength` [-], `exponent` [-], `stiffness` [N/m or N·m/rad] where the model is rigid",
        meaning="a spring-pot parallel to a joint's spring (fractional Kelvin-Voigt), `strength` at 100 Hz",
        places="each direction of each joint",
    )
    strength: Any
    exponent: Any

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the strength, the exponent and, where the model is rigid, the stiffness."""
        low = 0.05 if self.rigid else 0.0
        return (
            *self._stiffness(),
            Parameter("strength", "-", self.strength, 0.0, low, 30.0),
            Parameter("exponent", "-", self.exponent, self.exponent, 0.15, 0.85),
        )

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return the spring where the model is rigid, and the spring-pot parallel to it."""
        return self._parts(model, self.strength, SpringPot(1 / (2 * np.pi * _REFERENCE), self.exponent))

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """Exponents of 0.3 to 0.7 and strengths of 0.03 to 3."""
        strengths = (0.03, 0.1, 0.3, 1.0, 3.0) if not self.rigid else (0.1, 0.5, 2.0)
        return self._grid(scale, [{"strength": s, "exponent": a} for a in (0.3, 0.5, 0.7) for s in strengths])

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Each elastic and each rigid direction of each joint."""
        return cls._each(model, strength=0.3, exponent=0.5)
