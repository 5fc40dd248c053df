"""Places where a member gives way: a crack anywhere along it, a soft connection at its end."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fem.array_types import Floats
from fem.declarations import Entry, Marker, Relevant, Role, Site, StiffnessAt
from fem.effects.giving_way import GivesWay
from fem.effects.on_member import place_on, position_between
from fem.effects.places import bending_members, bending_stiffness, frame_of, section_extent, welded_ends
from fem.elements.frame import Frame
from fem.model import DIRECTIONS, Effect, Model, Parameter

_WORDS = {"rx": "torsion", "ry": "bending about local y", "rz": "bending about local z"}


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Crack(GivesWay):
    """A rotational flexibility at one place of a member, for bending in one plane (:meth:`Frame.cut`).

    An open crack; for one that opens and closes the response depends on amplitude. Its twin is a
    ``stiffness_loss`` of a stretch around it, if the shortest wave is much longer than the stretch.

    Attributes
    ----------
    member : str
    position : float
        Arc length from the member's first end [m].
    compliance : float
        [rad/(N·m)].
    direction : str
        ry or rz: bending about local y or z.
    length : float
        Length of the member [m].
    reference : float
        Length / (E I), which sets the scale [rad/(N·m)].
    depth : float
        Of the section, across the axis of bending [m].
    nearest : float
        Least distance from the member's ends [m]. Within half its depth from an end a member does not bend
        as a beam, and the flexibility there belongs to its connection.
    """

    kind: ClassVar[str] = "crack"
    role: ClassVar[Role] = Role.STIFFNESS
    marker: ClassVar[Marker | None] = Marker("cross", "orange")
    entry: ClassVar[Entry | None] = Entry(
        quantities="`compliance` [rad/(N·m)], `position` [m]",
        meaning=(
            "a rotational flexibility at a place of a member, half its depth from its ends at least, "
            "for bending in one plane"
        ),
        places="along each member, in both planes",
    )
    position: Any
    length: float
    reference: float
    nearest: float = 0.0
    depth: float = 0.0

    @property
    def where(self) -> Site:
        """Member, position and plane."""
        return Site(f"member {self.member}", self.position, _WORDS[self.direction])

    def parameters(self) -> tuple[Parameter, ...]:
        """Return compliance and position."""
        c = self.compliance, 0.0, 0.0, 5 * self.reference
        return (
            Parameter("compliance", "rad/(N·m)", *c, in_words=self.depth_in_words),
            position_between(self.position, self.nearest, self.length - self.nearest),
        )

    def place(self, model: Model) -> Any:
        """Return the position."""
        return self.position

    def series_line(self, model: Model) -> int | None:
        """Return None: it may move along the member."""
        return None

    def compliance_of(self, share: float) -> float:
        """Return the compliance of an open crack across the section, by its share of the depth [rad/(N·m)].

        Of one side of a rectangle (Ostachowicz and Krawczuk, J. Sound Vib. 150, 1991, 191-201).
        """
        powers = (0.6384, -1.035, 3.7201, -5.1773, 7.553, -7.332, 2.4909)
        f = sum(c * share**k for k, c in enumerate(powers, 2))
        return float(6 * np.pi * self.depth * self.reference / self.length * f)

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """As soft as 1 to 100 % of the member's length, at eleven places along it."""
        first = max(0.03 * self.length, self.nearest)
        return tuple(
            {"compliance": f * self.reference, "position": float(x)}
            for x in np.linspace(first, self.length - first, 11)
            for f in (0.01, 0.05, 0.2, 1.0)
        )

    def depth_in_words(self, compliance: float) -> str:
        """Return the depth of an open crack of some compliance [rad/(N·m)]."""
        shares = np.linspace(0.0, 0.6, 601)
        deep = np.interp(float(np.real(compliance)), [self.compliance_of(s) for s in shares], shares)
        return (
            f"a cut of {100 * deep:.0f} % of the depth"
            if deep < 0.6
            else "a cut of more than 60 % of the depth"
        )

    def relevant(self, sizes: Relevant, mass: float, scale: StiffnessAt) -> float | None:
        """Return the compliance of a crack of a relevant depth."""
        return self.compliance_of(sizes.cracks)

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Both planes of each member but bars."""
        out: list[Effect] = []
        for m in bending_members(model):
            for d, depth in (("ry", 2), ("rz", 1)):
                length = model.mesh.member_length(m)
                reference = length / bending_stiffness(model, m, d)
                half = section_extent(model, m, np.eye(3), np.eye(3)[depth])
                out.append(
                    cls(
                        name=f"crack:{m}.{d}",
                        member=m,
                        position=length / 2,
                        compliance=0.0,
                        direction=d,
                        length=length,
                        reference=reference,
                        nearest=min(half, 0.1 * length),
                        depth=2 * half,
                    )
                )
        return tuple(out)

    def locations(self, model: Model) -> Floats:
        """Return the place on the member."""
        return place_on(model, self.member, self.position)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class EndRelease(GivesWay):
    """A rotational flexibility where a member's end is welded to others in the model: a soft weld, a hinge.

    The same as a spring of 1/compliance at the member's end (``spring1``, ``spring2`` in
    :class:`~fem.elements.properties.MemberProperties`). A ``crack`` near the member's end is its twin.

    Attributes
    ----------
    member : str
    end : int
        1 or 2.
    direction : str
        rx, ry or rz, local.
    compliance : float
        [rad/(N·m)].
    reference : float
        Length / (E I) or length / (G J), which sets the scale [rad/(N·m)].
    """

    kind: ClassVar[str] = "end_release"
    role: ClassVar[Role] = Role.STIFFNESS
    marker: ClassVar[Marker | None] = Marker("thin_diamond", "orange")
    entry: ClassVar[Entry | None] = Entry(
        quantities="`compliance` [rad/(N·m)]",
        meaning="a rotational flexibility where a member's end is welded in the model",
        places="each welded end of a member",
    )
    end: int
    reference: float

    @property
    def where(self) -> Site:
        """Member, end and plane."""
        return Site(f"end {self.end} of member {self.member}", detail=_WORDS[self.direction])

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the compliance."""
        return (Parameter("compliance", "rad/(N·m)", self.compliance, 0.0, 0.0, 1e3 * self.reference),)

    def place(self, model: Model) -> Any:
        """Return the end's arc length."""
        return 0.0 if self.end == 1 else model.mesh.member_length(self.member)

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """As soft as 0.3 % of the member's length to nearly a hinge."""
        return tuple(
            {"compliance": f * self.reference}
            for f in (0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)
        )

    def relevant(self, sizes: Relevant, mass: float, scale: StiffnessAt) -> float | None:
        """Return the compliance that is a relevant share of all that the end turns by under a moment."""
        return self.reference / 3 * sizes.connections / (1 - sizes.connections)

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Torsion and bending at each welded end of a member that is stiff there in the model."""
        if not model.of_kind(Frame):
            return ()
        out: list[Effect] = []
        for m, end, axes in welded_ends(model):
            ends = frame_of(model).members[m].end_stiffness
            for d in (d for d in axes if np.isinf(ends[6 * end - 6 + DIRECTIONS.index(d)])):
                reference = model.mesh.member_length(m) / bending_stiffness(model, m, d)
                name = f"end_release:{m}.{end}.{d}"
                out.append(
                    cls(name=name, member=m, end=end, direction=d, compliance=0.0, reference=reference)
                )
        return tuple(out)

    def locations(self, model: Model) -> Floats:
        """Return the end."""
        points = model.mesh.member_points(self.member)
        return model.mesh.points[[points[0 if self.end == 1 else -1]]]
