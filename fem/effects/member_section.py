"""A member whose section is thicker or thinner than the model has it."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fem.array_types import Ints
from fem.declarations import Entry, Marker, Relevant, Role, Site, StiffnessAt
from fem.effects.on_member import OnMember
from fem.effects.places import bending_members, elements_of, frame_of, material_of, sheared_frame
from fem.elements.frame import changes_between, member_contribution
from fem.elements.lines import SectionChange
from fem.model import Contribution, Effect, Model, Parameter, ParameterRef, dofs_of
from fem.sections.section import Section


def changed_member(
    model: Model, member: str, change: SectionChange, instead_of: SectionChange | None = None
) -> tuple[Contribution, ...]:
    """Return the changes of a member's K, M and D by other sections.

    ``instead_of`` gives the sections that the model has; those of its frame unless given. Of elements that
    are alike one is formed, and stands for all.
    """
    frame, mesh = sheared_frame(model), model.mesh
    rows = mesh.members[member]
    alike = frame.alike(mesh, member)
    some = rows[:1] if alike else rows
    new = frame.contribution_of(model, some, change)
    old = (
        member_contribution(frame, model, member)
        if instead_of is None and not alike
        else frame.contribution_of(model, some, instead_of or SectionChange())
    )
    changes = changes_between(old, new)
    if not alike:
        return changes
    dofs = dofs_of(mesh.lines[rows]).reshape(len(rows), 12)
    return tuple(_of_all(c, dofs) for c in changes)


def _of_all(one: Contribution, dofs: Ints) -> Contribution:
    """Return the contribution of elements that all have the matrices of one."""
    K, M, D = (
        None if X is None else np.broadcast_to(X, (len(dofs), *X.shape[1:])) for X in (one.K, one.M, one.D)
    )
    return Contribution(dofs, K, M, D=D)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MemberSection(OnMember):
    """A section that is stretched along one of its axes: another thickness, another width.

    With f = 1 + change along local z: A → f A, Iy → f³ Iy, Iz → f Iz, along y the other way round, mass
    with A, and the shear coefficients stay. J, which the other constants do not give, goes with
    A⁴/(Iy + Iz): exact for ellipses, and within 1 % for solid rectangles changed by a tenth. For open thin
    walls it is rough.

    In bending along one axis alone it does the same as ``member_stiffness`` and ``member_density`` together.

    Attributes
    ----------
    member : str
    direction : str
        y or z, local.
    change : float
        Relative change of the size along it [-].
    """

    kind: ClassVar[str] = "member_section"
    role: ClassVar[Role] = Role.GEOMETRY
    marker: ClassVar[Marker | None] = Marker("square", "sky")
    entry: ClassVar[Entry | None] = Entry(
        quantities="`change` [-]",
        meaning="relative change of a section's size along a local axis, with A, I, J and mass",
        places="both axes of each member",
    )
    direction: str
    change: Any = 0.0

    @property
    def where(self) -> Site:
        """Member and direction."""
        return Site(f"member {self.member}", detail=f"along local {self.direction}")

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the change."""
        return (Parameter("change", "-", self.change, 0.0, -0.6, 1.5),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return the member's matrices with the stretched section, less the model's."""
        section = frame_of(model).members[self.member].section
        return changed_member(model, self.member, SectionChange(**self.factors(section)))

    def factors(self, section: Section) -> dict[str, Any]:
        """Return the factors of the constants of the member's section."""
        f = 1 + self.change
        cube, one = (f**3, f) if self.direction == "z" else (f, f**3)
        polar = (cube * section.Iy + one * section.Iz) / (section.Iy + section.Iz)
        return {"A": f, "Iy": cube, "Iz": one, "Ip": polar, "J": f**4 / polar}

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return the parameters on which the member's elements depend."""
        return elements_of(model, self.member, "E", "rho")

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """From 30 % thinner to 40 % thicker."""
        return tuple({"change": c} for c in (-0.3, -0.1, -0.03, -0.01, -0.003, 0.003, 0.01, 0.03, 0.1, 0.4))

    def relevant(self, sizes: Relevant, mass: float, scale: StiffnessAt) -> float | None:
        """Return a relevant decrease."""
        return -sizes.members

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Both axes of each member."""
        return tuple(
            cls(name=f"member_section:{m}.{d}", member=m, direction=d)
            for m in bending_members(model)
            for d in ("y", "z")
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MemberTorsion(OnMember):
    """A relative change of one member's torsion constant J.

    Open sections are stiffer than St Venant's J where they cannot warp; welds and slits change it much.

    Attributes
    ----------
    member : str
    change : float
        Relative to the nominal value [-].
    affine : bool
        Whether K is affine in J: not where the member's ends are on springs.
    """

    kind: ClassVar[str] = "member_torsion"
    role: ClassVar[Role] = Role.STIFFNESS
    entry: ClassVar[Entry | None] = Entry(
        quantities="`change` [-]",
        meaning="relative change of one member's torsion constant",
        places="each member",
    )
    change: Any = 0.0
    affine: bool = True

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the change."""
        return (Parameter("change", "-", self.change, 0.0, -0.95, 20.0, linear=self.affine),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return the change of the member's K and D."""
        parts = changed_member(model, self.member, SectionChange(J=1 + self.change))
        return tuple(Contribution(c.dofs, c.K, D=c.D) for c in parts if c.K is not None)

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return Young's modulus of the member."""
        return material_of(model, self.member, "E")

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """From a quarter of J to five times as much."""
        return tuple({"change": c} for c in (-0.75, -0.5, -0.2, -0.06, -0.015, 0.015, 0.06, 0.25, 1.0, 4.0))

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Each member but bars."""
        return tuple(
            cls(name=f"member_torsion:{m}", member=m, affine=bool(np.isinf(stiffness).all()))
            for m in bending_members(model)
            for stiffness in [frame_of(model).members[m].end_stiffness]
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MemberShear(OnMember):
    """Shear flexibility of a member in multiples of its section's by Timoshenko's theory.

    A member of the Euler-Bernoulli theory has none, and gets rotary inertia in the same measure: share 1
    makes it a Timoshenko beam. One of the Timoshenko theory has share 1 already: sandwiches, lattices and
    layers have more.

    Attributes
    ----------
    member : str
    euler : bool
        Whether the model's member is of the Euler-Bernoulli theory.
    share : float
        Of the section's 1/(k G A), and of its rotary inertia where the model has none [-].
    """

    kind: ClassVar[str] = "member_shear"
    role: ClassVar[Role] = Role.STIFFNESS | Role.MASS
    entry: ClassVar[Entry | None] = Entry(
        quantities="`share` [-]",
        meaning="shear flexibility of a member in multiples of its section's by Timoshenko's theory",
        places="each member whose section has shear coefficients",
    )
    euler: bool
    share: Any

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the share."""
        return (Parameter("share", "-", self.share, 0.0 if self.euler else 1.0, 0.0, 30.0),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return the member's matrices with the share, less the model's."""
        here, there = (
            SectionChange(shear=s, rotary=s if self.euler else 1.0, timoshenko=True)
            for s in (self.share, 0.0 if self.euler else 1.0)
        )
        return changed_member(model, self.member, here, there)

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return the parameters on which the member's elements depend."""
        return elements_of(model, self.member, "E", "rho")

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """From a tenth of the theory's, or near the model's, to twenty times as much."""
        near = (0.2, 0.6, 0.9, 1.15, 1.6, 3.0, 6.0, 20.0)
        shares = (0.1, 0.5, 1.0, 2.0, 5.0, 20.0) if self.euler else near
        return tuple({"share": s} for s in shares)

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Each member whose section has shear coefficients."""
        out: list[Effect] = []
        for m in bending_members(model):
            p = frame_of(model).members[m]
            if p.section.ky > 0 or p.section.kz > 0:
                euler = p.theory != "timoshenko"
                name = f"member_shear:{m}"
                out.append(cls(name=name, member=m, euler=euler, share=0.0 if euler else 1.0))
        return tuple(out)
