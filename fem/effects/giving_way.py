"""Effects by which members give way at a place, in series with all that alters the element there."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, ClassVar

import numpy as np

from fem.array_types import Floats
from fem.effects.on_member import OnMember
from fem.effects.places import elements_of, frame_of, parameters_of, sheared_frame
from fem.effects.section_shear import SectionShear
from fem.elements.cut import Cut, cut
from fem.elements.frame import Frame
from fem.elements.inner_place import InnerPlace, inner_place
from fem.model import (
    DIRECTIONS,
    Contribution,
    Effect,
    FollowsOthers,
    Model,
    ParameterRef,
    dofs_of,
    parameter_values,
)
from fem.recent import Unsent

_CHANGES = 64
"""Number of changes of elements that an effect keeps."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class GivesWay(OnMember, FollowsOthers):
    """A flexibility c at one place of a member, in one direction.

    Its element is that of the frame with all that other effects of the model change of it, K: stiffnesses of
    an element add, but not to what a flexibility takes away, c K m mᵀ K / (1 + c mᵀ K m)
    (`fem.elements.cut`). Where members give way in several ways, each is in series with those before it.

    Attributes
    ----------
    direction : str
        rx, ry or rz, local.
    compliance : float
        [rad/(N·m)].
    elements : Unsent
        Its last contributions, and changes of the element by other effects; effects with other values share
        them.
    """

    gives_way: ClassVar[bool] = True
    direction: str
    compliance: Any
    elements: Unsent = field(default_factory=lambda: Unsent(_CHANGES), repr=False)

    def place(self, model: Model) -> Any:
        """Return the arc length of the place [m]."""
        raise NotImplementedError

    def line(self, model: Model) -> int:
        """Return the line of the mesh that gives way."""
        return model.mesh.locate(self.member, float(np.real(self.place(model)))).line

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return the stiffness that one element loses, and its mass that follows the kink.

        Those in series with it ask for it as well.
        """
        return (self._cut(model)[1],)

    def steps_by_others(
        self, model: Model, stepped: Mapping[ParameterRef, Model]
    ) -> list[tuple[Contribution, ...]]:
        """Return complex steps of its contributions by parameters of others, by those of its element."""
        steps: dict[ParameterRef, Contribution] = self.elements.get(("steps", self, model), dict)
        new = [ref for ref in stepped if ref not in steps]
        if new:
            line, frame_refs = self.line(model), elements_of(model, self.member, "E", "rho")
            others = list(self._altering_effects(model, line))
            follow = {e.name: {*parameters_of(e), *e.refers_to(model)} for e in others}
            changes: list[tuple[Frame | None, list[Contribution]]] = []
            for ref in new:
                there = stepped[ref]
                moved = [e for e in others if ref in follow[e.name]]
                parts = [c for e in moved for c in self._step_on_line(e, model, line, ref, there)]
                changes.append((sheared_frame(there) if ref in frame_refs else None, parts))
            steps.update(zip(new, self._cut(model)[0].steps(model.mesh, changes), strict=True))
        return [(steps[ref],) for ref in stepped]

    def _step_on_line(
        self, effect: Effect, model: Model, line: int, ref: ParameterRef, stepped: Model
    ) -> tuple[Contribution, ...]:
        """Return what another effect changes of the element, with a complex step of a parameter."""
        if isinstance(effect, GivesWay) and ref[0] != effect.name:
            return effect.steps_by_others(model, {ref: stepped})[0]
        return self._on_line(stepped.effect(effect.name), stepped, line)

    def _cut(self, model: Model) -> tuple[Cut, Contribution]:
        """Return its element, and what that adds to the model."""

        def made() -> tuple[Cut, Contribution]:
            new = self._cut_anew(model)
            return new, new.contribution

        out: tuple[Cut, Contribution] = self.elements.get((self, model), made)
        return out

    def _cut_anew(self, model: Model) -> Cut:
        line, frame = self.line(model), sheared_frame(model)
        changes = [c for e in self._altering_effects(model, line) for c in self._on_line(e, model, line)]
        if pull := frame.members[self.member].pretension:
            row = int(np.flatnonzero(model.mesh.members[self.member] == line)[0])
            changes.append(frame.geometric_stiffness(model, self.member, pull).element(row))
        return cut(frame, model, self.member, self.place(model), self.direction, self.compliance, changes)

    def _on_line(self, effect: Effect, model: Model, line: int) -> tuple[Contribution, ...]:
        """Return what another effect changes of the element."""
        changes = partial(_elements_of, effect, model, line)
        if isinstance(effect, GivesWay):  # depends on further effects
            return changes()
        refs = effect.refers_to(model)
        frame = sheared_frame(model) if refs else None
        values = (parameter_values(model.effect(n))[p] for n, p in refs if frame and n != frame.name)
        key = effect, frame, tuple(values), model.mesh, line
        out: tuple[Contribution, ...] = self.elements.get(key, changes)
        return out

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return the parameters on which the member's elements depend, those of other effects included."""
        refs = list(elements_of(model, self.member, "E", "rho"))
        for effect in self._altering_effects(model, self.series_line(model)):
            refs += [*parameters_of(effect), *effect.refers_to(model)]
        return tuple(dict.fromkeys(refs))

    def series_line(self, model: Model) -> int | None:
        """Return the line with which it is in series wherever it may move; None if that may be another."""
        return self.line(model)

    def alters(self, model: Model, member: str, line: int | None = None) -> bool:
        """Whether it is on the line."""
        return member == self.member and line in (None, self.line(model))

    def _altering_effects(self, model: Model, line: int | None) -> Iterator[Effect]:
        """Yield the effects that alter the element: all, but of those that give way the ones before it."""
        first = True
        for effect in model.effects:
            first = first and effect.name != self.name
            if effect.name == self.name or isinstance(effect, SectionShear):
                continue  # the frame's elements have these shear coefficients already
            if (first or not isinstance(effect, GivesWay)) and effect.alters(model, self.member, line):
                yield effect


def _elements_of(effect: Effect, model: Model, line: int) -> tuple[Contribution, ...]:
    """Return the elements of an effect on one line, each alone."""
    dofs = dofs_of(model.mesh.lines[line]).ravel()
    return tuple(one for c in effect.contribute(model) for one in c.elements_at(dofs))


def cuts_of(model: Model, member: str, position: Any) -> tuple[GivesWay, ...]:
    """Return what gives way in the element at an arc length of a member."""
    every = [e for e in model.effects if isinstance(e, GivesWay) and e.member == member]
    if not every:
        return ()
    line = model.mesh.locate(member, float(np.real(position))).line
    return tuple(e for e in every if e.line(model) == line)


def place_at(model: Model, member: str, position: Any) -> InnerPlace:
    """Return the place at an arc length of a member, within an element that may give way."""
    cuts = [(member, e.place(model), e.direction, e.compliance) for e in cuts_of(model, member, position)]
    return inner_place(sheared_frame(model), model.mesh, member, position, cuts)


def cut_parameters(model: Model, member: str) -> tuple[ParameterRef, ...]:
    """Return the parameters of all that gives way in a member."""
    every = (e for e in model.effects if isinstance(e, GivesWay) and e.member == member)
    return tuple(ref for e in every for ref in (*parameters_of(e), *e.refers_to(model)))


def turning_axis(effect: Effect, model: Model) -> Floats | None:
    """Return the global unit vector (3,) about which a member gives way; None of other effects."""
    if not isinstance(effect, GivesWay):
        return None
    axes = frame_of(model).rotations(model.mesh, [effect.line(model)])[0]
    return axes[DIRECTIONS.index(effect.direction) - 3]
