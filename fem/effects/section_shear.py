"""Shear coefficients of sections other than the model has them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, ClassVar, Self

import numpy as np

from fem.array_types import Floats
from fem.declarations import Role, Site
from fem.elements.frame import Frame
from fem.model import Contribution, Effect, Model, Parameter, ParameterRef
from fem.recent import Recent

_FRAMES = 8
"""Number of frames that an effect keeps."""
_PARTS = 64
"""Number of contributions of groups that an effect and those with other values keep."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SectionShear(Effect):
    """Shear coefficients of sections with walls, which are known only roughly.

    Formulas for them differ: of a box that is 0.6 times as wide as high, along its width, by Cowper (1966)
    0.28, as the share of the walls that lie along the force 0.36, as one number for all boxes 0.44. No
    candidate: the coefficients are uncertain parameters, as moduli are.

    Attributes
    ----------
    groups : mapping of str to tuple of str
        Members that have one section, by the name of the first.
    directions : mapping of str to tuple of str
        For each of them the parameters: ``"ky"`` and ``"kz"``, or ``"k"`` for both.
    values : mapping of str to number
        Factors ``"ky:<first member>"`` of the coefficients of the model's sections [-].
    frames : Recent
        Frames with these coefficients, by the frames that they are made of; effects on members share them.
    parts : Recent
        Contributions of single groups by their factors; effects with other values share them.
    """

    kind: ClassVar[str] = "section_shear"
    role: ClassVar[Role] = Role.STIFFNESS
    separable: ClassVar[bool] = True
    is_marked: ClassVar[bool] = False
    name: str = "section_shear"
    groups: Mapping[str, tuple[str, ...]]
    directions: Mapping[str, tuple[str, ...]]
    values: Mapping[str, Any] = field(default_factory=dict)
    frames: Recent = field(default_factory=lambda: Recent(_FRAMES), init=False, repr=False)
    parts: Recent = field(default_factory=lambda: Recent(_PARTS), repr=False, compare=False)

    @classmethod
    def of(cls, model: Model) -> "SectionShear | None":
        """Return the effect for a model's Timoshenko members whose coefficients are estimated, if any."""
        groups: dict[int, list[str]] = {}
        members = model.of_kind(Frame)[0].members if model.of_kind(Frame) else {}
        sections = {}
        for m, p in members.items():
            if p.theory == "timoshenko" and p.section.estimated_k and p.section2 is None:
                sections[m] = p.section
                known = (g for g, (first, *_) in groups.items() if _same(sections[first], p.section))
                groups.setdefault(next(known, len(groups)), []).append(m)
        if not groups:
            return None
        named = {first: (first, *others) for first, *others in groups.values()}
        return cls(groups=named, directions={first: _directions(sections[first]) for first in named})

    @property
    def where(self) -> Site:
        """The number of members with walls."""
        n = sum(map(len, self.groups.values()))
        return Site(f"{n} members with walls" if n > 1 else "the member with walls")

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the factors, one or two of each section."""
        return tuple(
            Parameter(key, "-", self.values.get(key, 1.0), 1.0, 0.2, 5.0, log=True)
            for first, keys in self.directions.items()
            for key in (f"{k}:{first}" for k in keys)
        )

    def with_values(self, **values: Any) -> Self:
        """Return the effect with other factors."""
        return replace(self, values={**self.values, **values})

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return the changes of the members' K, M and D by the coefficients."""
        (frame,), out = model.of_kind(Frame), []
        for first in self.groups:
            key = (frame, model.mesh, first, self._factors(first))
            out += self.parts.get(key, partial(self._group, model, frame, first))
        return tuple(out)

    def _group(self, model: Model, frame: Frame, first: str) -> tuple[Contribution, ...]:
        """Return the changes of the members of one section."""
        rows = np.concatenate([model.mesh.members[m] for m in self.groups[first]])
        new = self.applied_to(frame).contribution_of(model, rows)
        old = self.parts.get((frame, model.mesh, first), lambda: frame.contribution_of(model, rows))
        out = []
        for c, o in zip(new, old, strict=True):
            parts = ((getattr(c, X), getattr(o, X)) for X in ("K", "M", "D"))
            K, M, D = (None if a is None or b is None else a - b for a, b in parts)
            out.append(Contribution(c.dofs, K, M, D=D, lines=c.lines))
        return tuple(out)

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return Young's moduli and densities of the members."""
        (frame,) = model.of_kind(Frame)
        materials = dict.fromkeys(
            frame.members[m].material.name for group in self.groups.values() for m in group
        )
        return tuple((frame.name, f"{key}:{name}") for name in materials for key in ("E", "rho"))

    def of_member(self, member: str) -> tuple[ParameterRef, ...]:
        """Return the factors that concern a member."""
        groups = (first for first, members in self.groups.items() if member in members)
        return tuple((self.name, f"{k}:{first}") for first in groups for k in self.directions[first])

    def applied_to(self, frame: Frame) -> Frame:
        """Return a frame whose members have these coefficients, for effects on parts of members."""
        return self.frames.get(frame, lambda: replace(frame, shear=self._shear()))

    def _shear(self) -> dict[str, tuple[Any, Any]]:
        """Return the factors of the shear flexibility of each member."""
        return {m: self._factors(first) for first, members in self.groups.items() for m in members}

    def _factors(self, first: str) -> tuple[Any, Any]:
        """Return the factors of the shear flexibility along y and z."""
        both, y, z = (1 / self.values.get(f"{k}:{first}", 1.0) for k in ("k", "ky", "kz"))
        return both * y, both * z

    def locations(self, model: Model) -> Floats:
        """Return the middles of the members."""
        mesh, members = model.mesh, [m for group in self.groups.values() for m in group]
        return np.array([mesh.point_at(mesh.locate(m, mesh.member_length(m) / 2)) for m in members])


def _same(a: Any, b: Any) -> bool:
    keys = ("A", "Iy", "Iz", "J", "ky", "kz")
    return a is b or all(getattr(a, key) == getattr(b, key) for key in keys)


def _directions(section: Any) -> tuple[str, ...]:
    """Return which coefficients a section has: one for both directions where they are alike."""
    # Relative difference up to which the coefficients along y and z are one
    y, z, alike = section.ky, section.kz, abs(section.ky - section.kz) < 1e-6 * section.kz
    return ("k",) if alike and y > 0 else tuple(k for k, value in (("ky", y), ("kz", z)) if value > 0)
