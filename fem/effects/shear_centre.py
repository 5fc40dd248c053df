"""Shear centres of open sections: members that twist about another axis than that of their centroids."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fem.declarations import Entry, Marker, Role, StiffnessAt
from fem.effects.on_member import WithinMember
from fem.effects.places import elements_of, sheared_frame
from fem.elements.frame import Frame
from fem.elements.layout import axes_and_arms, layout_of
from fem.elements.properties import MemberProperties
from fem.model import Contribution, Effect, Model, Parameter, ParameterRef


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ShearCentre(WithinMember):
    """Bending and torsion of a member coupled by the distance of its shear centre from its centroid.

    A member bends and twists about the line of its shear centres, and is stretched along that of its
    centroids. With v + θx ex × r, the displacement of the shear centre, in place of v at both ends of each
    element, ΔK = TᵀKT - K: V. Z. Vlasov, *Thin-Walled Elastic Beams*, 2nd ed. 1961, chapter I, without the
    warping. Where a member tapers, the line of its shear centres is inclined by r′: a rotation θx ex is
    θx (ex + r′) about that line, and -θx r′ across it, which bends. Mass stays at the centroid. Ends of
    members are joined at their centroids.

    Attributes
    ----------
    member : str
    share : float
        Part of the distance that the section has [-].
    """

    kind: ClassVar[str] = "shear_centre"
    role: ClassVar[Role] = Role.STIFFNESS
    marker: ClassVar[Marker | None] = Marker("cross", "vermilion")
    statement: ClassVar[str] = "{member} twists about its shear centre"
    entry: ClassVar[Entry | None] = Entry(
        quantities="`share` [-]",
        meaning="part of the distance of the section's shear centre from its centroid, about which it twists",
        places="each member whose section has its shear centre elsewhere",
    )
    share: Any = 1.0

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the share."""
        return (Parameter("share", "-", self.share, 0.0, 0.0, 1.5),)

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return ΔK of all elements, and its structural damping."""
        frame, rows = sheared_frame(model), model.mesh.members[self.member]
        layout = layout_of(frame.members, model.mesh)
        part = frame.contribution_of(model, rows)[0]
        R, arms, _, L = axes_and_arms(layout, model.mesh, rows)
        first, last = (np.asarray(s.shear_centre) for s in _ends(frame.members[self.member]))
        along = layout.along[rows]
        tilt = -np.einsum("b,k,bkx->bx", np.diff(along)[:, 0] / L, last - first, R[:, 1:])
        T = np.zeros((len(rows), 12, 12), dtype=np.result_type(type(self.share), float))
        for end in range(2):
            r = np.einsum("bk,bkx->bx", first + along[:, end, None] * (last - first), R[:, 1:])
            # the tilt must not move the end of the flexible part by its arm from the point
            moved = np.cross(R[:, 0], r) - np.cross(tilt, arms[:, end])
            both = np.hstack([moved, tilt])
            at = 6 * end
            T[:, at : at + 6, at + 3 : at + 6] = self.share * both[:, :, None] * R[:, None, 0]
        T += np.eye(12)
        changed = [None if X is None else np.swapaxes(T, 1, 2) @ X @ T - X for X in (part.K, part.D)]
        return (Contribution(part.dofs, changed[0], D=changed[1], lines=rows),)

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return the parameters on which the member's stiffness depends."""
        return elements_of(model, self.member, "E")

    def starts(self, scale: StiffnessAt) -> tuple[dict[str, float], ...]:
        """Return the section's distance."""
        return ({"share": 1.0},)

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Each member whose shear centre is not at its centroid."""
        return tuple(
            cls(name=f"shear_centre:{name}", member=name)
            for frame in model.of_kind(Frame)
            for name, p in frame.members.items()
            if name in model.mesh.members and is_eccentric(p)
        )


def is_eccentric(p: MemberProperties) -> bool:
    """Whether a member has its shear centre elsewhere than its centroid; bars neither bend nor twist."""
    away = max(np.hypot(*s.shear_centre) / np.sqrt(s.A) for s in _ends(p))
    # Distance from the centroid, relative to √A, up to which a shear centre counts as being there [-]
    return bool(p.theory != "bar" and away > 0.01)


def _ends(p: MemberProperties) -> tuple[Any, Any]:
    return p.section, p.section if p.section2 is None else p.section2
