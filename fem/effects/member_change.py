"""Young's modulus or density of one member other than the model has it."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

from fem.declarations import Entry, Marker, Relevant, Role, StiffnessAt
from fem.effects.on_member import WithinMember
from fem.effects.places import is_sprung, stiffness_of_sprung
from fem.elements.frame import Frame, changes_between, member_contribution, nominal
from fem.model import Contribution, Model, Parameter, ParameterRef, parameter_values


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _MemberChange(WithinMember):
    of: ClassVar[str]
    change: Any = 0.0

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the relative change."""
        return (Parameter("change", "-", self.change, 0.0, -0.8, 4.0, linear=True),)

    def _parts(self, model: Model) -> tuple[Contribution, ...]:
        (frame,) = model.of_kind(Frame)
        return member_contribution(nominal(frame), model, self.member)

    def rebased(self, model: Model) -> Self:
        """Return the change relative to the present modulus or density, which stays the same amount."""
        (frame,) = model.of_kind(Frame)
        key = f"{self.of}:{frame.members[self.member].material.name}"
        before, now = (parameter_values(f)[key] for f in (nominal(frame), frame))
        return self.with_values(change=self.change * before / now)

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """From half less to twice as much."""
        down, up = (-0.5, -0.25, -0.1, -0.03, -0.01), (0.01, 0.03, 0.1, 0.25, 0.6, 1.0)
        return tuple({"change": c} for c in (*down, *up))

    def relevant(self, sizes: Relevant, mass: float, scale: StiffnessAt) -> float | None:
        """Return a relevant decrease."""
        return -sizes.members

    @classmethod
    def propose(cls, model: Model) -> tuple[Self, ...]:
        """Each member, where there are at least two; with one member it is the material's parameter."""
        members = list(model.mesh.members)
        return tuple(cls(name=f"{cls.kind}:{m}", member=m) for m in members) if len(members) > 1 else ()


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MemberStiffness(_MemberChange):
    """A relative change of one member's stiffness E (and G with it).

    Attributes
    ----------
    member : str
    change : float
        Relative to the nominal value [-].
    affine : bool
        Whether K is affine in E: not where the member's ends are on springs.
    """

    kind: ClassVar[str] = "member_stiffness"
    role: ClassVar[Role] = Role.STIFFNESS
    marker: ClassVar[Marker | None] = Marker("square", "orange")
    statement: ClassVar[str] = "{where} is {stiffer} than in the model"
    entry: ClassVar[Entry | None] = Entry(
        quantities="`change` [-]",
        meaning="relative change of one member's Young's and shear modulus",
        places="each member of several",
    )
    of: ClassVar[str] = "E"
    affine: bool = True

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the relative change."""
        return tuple(replace(p, linear=self.affine) for p in super(MemberStiffness, self).parameters())

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return change · K and change · D of the member; of one on springs the change by another E."""
        if is_sprung(model, self.member):
            return self._on_springs(model)
        return tuple(
            Contribution(c.dofs, self.change * c.K, D=None if c.D is None else self.change * c.D)
            for c in self._parts(model)
            if c.K is not None
        )

    def _on_springs(self, model: Model) -> tuple[Contribution, ...]:
        """Return the changes of K, M and D of a member with its ends on springs, which stay as they are."""
        (frame,) = model.of_kind(Frame)
        material = frame.members[self.member].material
        key, rows = f"E:{material.name}", model.mesh.members[self.member]
        stiffer = frame.with_values(**{key: frame.values.get(key, material.E) + self.change * material.E})
        return changes_between(
            member_contribution(frame, model, self.member), stiffer.contribution_of(model, rows)
        )

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return Young's modulus of a member on springs."""
        return stiffness_of_sprung(model, self.member)

    @classmethod
    def propose(cls, model: Model) -> tuple[Self, ...]:
        """Each member, where there are at least two; with one member it is the material's parameter."""
        every = super(MemberStiffness, cls).propose(model)
        return tuple(replace(e, affine=not is_sprung(model, e.member)) for e in every)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MemberDensity(_MemberChange):
    """A relative change of one member's mass per length (and rotary inertia with it).

    Attributes
    ----------
    member : str
    change : float
        Relative to the nominal value [-].
    """

    kind: ClassVar[str] = "member_density"
    role: ClassVar[Role] = Role.MASS
    marker: ClassVar[Marker | None] = Marker("square", "green")
    statement: ClassVar[str] = "{where} is {heavier} than in the model"
    entry: ClassVar[Entry | None] = Entry(
        quantities="`change` [-]",
        meaning="relative change of one member's mass per length",
        places="each member of several",
    )
    of: ClassVar[str] = "rho"

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return change · M of the member."""
        return tuple(Contribution(c.dofs, M=self.change * c.M) for c in self._parts(model) if c.M is not None)
