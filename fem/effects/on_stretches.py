"""Effects that make stretches of members at one place stiffer or softer."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from fem.array_types import Complexes, Floats, Ints
from fem.declarations import Site
from fem.effects.places import reaches, sheared_frame
from fem.effects.section_form import CHANGES, SectionForm
from fem.effects.with_frame import WithFrame
from fem.elements.stretches import STEP, Stretches
from fem.model import Contribution, Effect, Model, ParameterRef, parameter_values
from fem.recent import Unsent
from fem.tabulated import TabulatedEffect

KEYS = tuple(key for key in CHANGES if key != "A")
"""Changes of sections that stiffness follows."""
_MESHES = 4
"""Number of frames and meshes, and of models, whose tables an effect keeps."""
_GAINS = 8
"""Number of parts of flexibility for which an effect keeps what its stretches gain."""
ITERATIONS = 6
"""Steps of Gauss and Newton: each takes about the square of the relative change of the moduli off."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class OnStretches(WithFrame):
    """A change of stretches of members at one place.

    Attributes
    ----------
    zones : tuple of (str, float, float, int)
        Member, arc length at which a stretch begins, its length [m], and 1 or -1 for up or down the member.
    place : str
        In words.
    around : str
        Name of the joint or support there; empty for a corner.
    tables, stretches, gains : Unsent
        Tables of its matrices and the flexibility of its stretches, by frame and mesh, and what these gain;
        effects with other values share them.
    """

    gives_way: ClassVar[bool] = True
    zones: tuple[tuple[str, float, float, int], ...]
    place: str
    around: str = ""
    tables: Unsent = field(default_factory=lambda: Unsent(_MESHES), repr=False)
    stretches: Unsent = field(default_factory=lambda: Unsent(_MESHES), repr=False)
    gains: Unsent = field(default_factory=lambda: Unsent(_GAINS), repr=False)

    @property
    def where(self) -> Site:
        """The place."""
        return Site(self.place)

    def alters(self, model: Model, member: str, line: int | None = None) -> bool:
        """Whether a stretch is on the line."""
        return any(
            m == member and reaches(model, member, line, s, towards * length)
            for m, s, length, towards in self.zones
        )

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return the changes of the members' sections: stretches are stiffer than members with these."""
        return tuple(ref for ref, *_ in self.section_changes(model))

    def section_changes(self, model: Model) -> list[tuple[ParameterRef, Ints, int]]:
        """Return changes of the members' sections, the elements that have them, and numbers of ``KEYS``."""

        def made() -> list[tuple[ParameterRef, Ints, int]]:
            forms = [e for e in model.of_kind(SectionForm) if any(m in e.members for m, *_ in self.zones)]
            members = self.stretches_on(model).members if forms else ()
            return [
                ((e.name, key), np.flatnonzero(np.isin(members, e.members)), KEYS.index(key))
                for e in forms
                for key in e.keys
                if key in KEYS
            ]

        out: list[tuple[ParameterRef, Ints, int]] = self.stretches.get((self.frame, model), made)
        return out

    def stretches_on(self, model: Model) -> Stretches:
        """Return the stretches, and what changes of sections do to them."""

        def made() -> Stretches:
            return Stretches.of(self.frame, model, self.zones, [CHANGES[key] for key in KEYS])

        out: Stretches = self.stretches.get((self.frame, model.mesh), made)
        return out

    def stiffer(self, model: Model, kept: ArrayLike) -> Contribution:
        """Return what the elements gain of stretches that keep a part of their flexibility."""
        stretches, parts = self.stretches_on(model), np.asarray(kept)
        # steps of many parameters leave the parts as they are
        at = self.frame, model.mesh, parts.dtype, parts.tobytes()
        K = self.gains.get((*at, "gain"), lambda: stretches.gain(parts))
        changes = [
            (lines, k, value)
            for (name, key), lines, k in self.section_changes(model)
            if (value := getattr(model.effect(name), key)) != 0
        ]
        if changes:
            slopes = self.gains.get((*at, "slopes"), lambda: stretches.gain_slopes(parts))
            K = K.astype(np.result_type(K, slopes, *(value for *_, value in changes)))
            for lines, k, value in changes:
                K[lines] += value * slopes[k][lines]
        return stretches.contribution(K)

    def tabulated_on(
        self,
        model: Model,
        kept: Callable[[float, float], ArrayLike],
        low: float,
        high: float,
        *,
        planar: bool,
        masses: Mapping[str, Contribution] | None = None,
    ) -> TabulatedEffect | None:
        """Return tables of the stiffness for u, and the change of it in a plane, between two values."""
        stretches = self.stretches_on(model)

        def gains(u: float, plane: float) -> Floats:
            here = kept(u, plane)
            return np.concatenate([stretches.gain(here)[None], stretches.gain_slopes(here)])

        def made() -> TabulatedEffect | None:
            g = stretches.lines
            return TabulatedEffect.of(g.dofs, g.eta, gains, masses or {}, low, high, planar=planar)

        def followed() -> TabulatedEffect | None:
            table = self.tables.get((self.frame, model.mesh), made)
            return None if table is None else replace(table, follows=tuple(self.section_changes(model)))

        out: TabulatedEffect | None = self.tables.get((self.frame, model), followed)
        return out

    def rebased(self, model: Model) -> Self:
        """Return the effect that adds the same matrices, on a frame with the model's present moduli."""
        return replace(self, frame=sheared_frame(model))._as_before(self, model)

    def locations(self, model: Model) -> Floats:
        """Return where the stretches begin, (n, 3) [m]."""
        mesh = model.mesh
        return np.array([mesh.point_at(mesh.locate(m, s)) for m, s, _, _ in self.zones])

    def _as_before(self, before: Effect, model: Model) -> Self:
        """Return it with the values at which it adds most nearly the matrices of another one at its place."""
        wanted, names = _added(before, model), [p.name for p in self.parameters()]
        values = parameter_values(before)
        for _ in range(ITERATIONS):
            now = self.with_values(**values)
            stepped = [self.with_values(**values | {n: values[n] + 1j * STEP}) for n in names]
            slopes = [np.imag(_added(each, model)) / STEP for each in stepped]
            A, r = np.stack(slopes, axis=1), wanted - _added(now, model)
            size = np.linalg.norm(A, axis=0)
            size[size == 0] = 1.0
            steps = np.linalg.lstsq(A / size, r)[0] / size
            for p, step in zip(now.parameters(), steps, strict=True):
                values[p.name] = float(np.clip(values[p.name] + step, p.lower, p.upper))
        return self.with_values(**values)


def _added(effect: Effect, model: Model) -> Complexes | Floats:
    """Return the entries of K and M that an effect adds."""
    parts = effect.contribute(model)
    return np.concatenate([X.ravel() for c in parts for X in (c.K, c.M) if X is not None])
