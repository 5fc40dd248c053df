"""Members that are a little heavier, and bend and twist otherwise, than their sections say."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, ClassVar

import numpy as np

from fem.array_types import Floats
from fem.declarations import Entry, Role, Site
from fem.effects.places import frame_of, is_bar, sheared_frame
from fem.effects.with_frame import WithFrame
from fem.elements.frame import Frame
from fem.elements.lines import SectionChange
from fem.elements.stretches import STEP
from fem.model import Contribution, Effect, Model, Parameter
from fem.recent import Recent

_STEPPED = 1 + 1j * STEP
CHANGES = {
    "A": SectionChange(A=_STEPPED),
    "Iy": SectionChange(Iy=_STEPPED),
    "Iz": SectionChange(Iz=_STEPPED),
    "J": SectionChange(J=_STEPPED),
    "shear": SectionChange(shear=_STEPPED),
}
"""Changes by that step, in the order of the parameters."""
_MESHES = 4
"""Number of frames and meshes whose parts an effect keeps."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SectionForm(WithFrame):
    """Members of one section that are heavier, and bend and twist otherwise, than it says, alike.

    The changes are linear, also of members whose ends are on springs: there a change c of a section errs by
    c²/4 of the stiffness at most.

    Attributes
    ----------
    members : tuple of str
    A, Iy, Iz, J : float
        Relative changes of the area, with the mass, and of the stiffnesses of bending and torsion [-].
    shear : float
        Relative change of the shear flexibility, where it counts and is not uncertain already
        (:class:`~fem.effects.section_shear.SectionShear`). Formulas for it differ most of flats: that of one
        five times as wide as thick is by Hutchinson (2001) a seventh of Cowper's (1966) [-].
    sheared : bool
        Whether that may change.
    parts : Recent
        Derivatives of the members' matrices, by frame and mesh; effects with other values share them.
    """

    kind: ClassVar[str] = "section_form"
    is_form: ClassVar[bool] = True
    role: ClassVar[Role] = Role.STIFFNESS | Role.MASS
    entry: ClassVar[Entry | None] = Entry(
        quantities="`A` [-], `Iy` [-], `Iz` [-], `J` [-], `shear` [-]",
        meaning="mass per length, stiffness of bending and torsion and shear flexibility of one section, "
        "relative to the model's",
        places="all members of one section and length",
    )
    members: tuple[str, ...]
    A: Any = 0.0
    Iy: Any = 0.0
    Iz: Any = 0.0
    J: Any = 0.0
    shear: Any = 0.0
    sheared: bool = True
    parts: Recent = field(default_factory=lambda: Recent(_MESHES), repr=False)

    @property
    def where(self) -> Site:
        """The members."""
        return Site(f"section of member {', '.join(self.members)}")

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the changes."""
        # Shear governs short elements: K (1 - x). With x = 1/2 they give way twice as much, with 1 endlessly.
        bounds = {"shear": (-0.9, 0.5)}
        return tuple(
            Parameter(key, "-", getattr(self, key), 0.0, *bounds.get(key, (-0.5, 1.0)), linear=True)
            for key in self.keys
        )

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of the changes."""
        return tuple(key for key in CHANGES if self.sheared or key != "shear")

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return the contributions of the changes to K and M."""
        parts = self.parts_on(model)
        return tuple(_scaled(c, getattr(self, key)) for key in self.keys for c in parts[key])

    def alters(self, model: Model, member: str, line: int | None = None) -> bool:
        """Whether the member is of the section."""
        return member in self.members

    def parts_on(self, model: Model) -> dict[str, tuple[Contribution, ...]]:
        """Return the derivatives of the members' matrices by each of the changes."""
        parts: dict[str, tuple[Contribution, ...]] = self.parts.get(
            (self.frame, model.mesh), partial(self._parts, model)
        )
        return parts

    def _parts(self, model: Model) -> dict[str, tuple[Contribution, ...]]:
        rows = np.concatenate([model.mesh.members[m] for m in self.members])
        out = {}
        for key in self.keys:
            change = CHANGES[key]
            changed = self.frame.contribution_of(model, rows, change)
            slopes = [(c.dofs, _slope(c.M if key == "A" else c.K)) for c in changed]
            some = [(dofs, X) for dofs, X in slopes if X is not None]
            out[key] = tuple(Contribution(d, M=X) if key == "A" else Contribution(d, X) for d, X in some)
        return out

    def locations(self, model: Model) -> Floats:
        """Return the middles of the members, (n, 3) [m]."""
        mesh = model.mesh
        return np.array([mesh.point_at(mesh.locate(m, mesh.member_length(m) / 2)) for m in self.members])

    def rebased(self, model: Model) -> "SectionForm":
        """Return the same change of stiffness, relative to the sections with the model's present moduli."""
        bare = model.without_effect(*(e.name for e in model.effects if e.kind == self.kind))
        new = next((e for e in _sections(bare) if e.members == self.members), None)
        if new is None:
            return self
        before, now = self.parts_on(model), new.parts_on(model)
        values = {
            key: getattr(self, key) * _size(key, before[key]) / _size(key, now[key]) for key in self.keys
        }
        return replace(new, name=self.name, **values)

    @classmethod
    def propose(cls, model: Model) -> tuple[Effect, ...]:
        """Return the members of each section."""
        return tuple(_sections(model)) if model.of_kind(Frame) else ()


def _scaled(c: Contribution, factor: Any) -> Contribution:
    return replace(c, K=None if c.K is None else factor * c.K, M=None if c.M is None else factor * c.M)


def _size(key: str, parts: tuple[Contribution, ...]) -> float:
    """Return the inertia of displacements, or the stiffness against turns of elements' ends.

    Opposite turns bend and twist without shear, so that shear coefficients do not matter; alike ones shear.
    """
    none, one = np.zeros((3, 3)), np.eye(3)
    motions = {"A": [one, none, one, none], "shear": [none, one, none, one]}
    v = np.hstack(motions.get(key, [none, -one, none, one]))
    matrices = (X for c in parts for X in (c.K, c.M) if X is not None)
    return float(sum(np.einsum("ri,bij,rj->", v, X, v) for X in matrices))


def _sections(model: Model) -> Iterator[SectionForm]:
    frame = frame_of(model)
    groups: dict[tuple[float, ...], list[str]] = {}
    for m in model.mesh.members:
        s = frame.members[m].section
        if not is_bar(model, m):
            alike = np.round(np.log([s.A, s.Iy, s.Iz, s.J, model.mesh.member_length(m)]), 3)
            known = [model.tolerances.index(t) for t in model.tolerances_of(m)]
            groups.setdefault((*alike.tolist(), *known), []).append(m)
    for members in groups.values():
        name, p = f"section_form:{members[0]}", frame.members[members[0]]
        known = p.theory == "timoshenko" and max(p.section.ky, p.section.kz) > 0
        uncertain = known and not (p.section.estimated_k and p.section2 is None)
        yield SectionForm(name=name, members=tuple(members), frame=sheared_frame(model), sheared=uncertain)


def _slope(matrices: Any) -> Any:
    """Return the derivative (n, m, m) of matrices by a change, symmetric; None if there is none."""
    if matrices is None or not np.any(np.imag(matrices)):
        return None
    slope = np.imag(matrices) / STEP
    return (slope + np.swapaxes(slope, 1, 2)) / 2
