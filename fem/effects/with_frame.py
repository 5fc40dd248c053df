"""Effects that contain a frame: changes of its members with the moduli of the model that proposed them."""

from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from fem.declarations import Site
from fem.effects.places import reaches, sheared_frame
from fem.elements.frame import Frame
from fem.model import Effect, Model, ParameterRef, parameter_values
from fem.recent import Recent

STEP = 1e-30
"""Step of derivatives, imaginary."""
_MESHES = 2
"""Number of frames and meshes whose tables an effect keeps."""
ITERATIONS = 6
"""Steps of Gauss and Newton: each takes about the square of the relative change of the moduli off."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class WithFrame(Effect):
    """A change of members, formed by the frame that it contains.

    Attributes
    ----------
    frame : Frame
        Of the model that it was proposed for: moduli that are a little otherwise hardly matter here.
    """

    frame: Frame

    def refers_to(self, model: Model) -> tuple[ParameterRef, ...]:
        """Return nothing: the moduli are those of the frame that it contains."""
        return ()

    def with_mass_of_higher_order(self) -> Self:
        """Return it with a frame whose consistent mass is of higher order."""
        return replace(self, frame=self.frame.with_mass_of_higher_order())


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
    tables : Recent
        Tables of its matrices by frame and mesh; effects with other values share them.
    """

    zones: tuple[tuple[str, float, float, int], ...]
    place: str
    around: str = ""
    tables: Recent = field(default_factory=lambda: Recent(_MESHES), repr=False)

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

    def rebased(self, model: Model) -> Self:
        """Return the effect that adds the same matrices, on a frame with the model's present moduli."""
        return replace(self, frame=sheared_frame(model))._as_before(self, model)

    def locations(self, model: Model) -> NDArray[np.float64]:
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


def _added(effect: Effect, model: Model) -> NDArray[np.complex128] | NDArray[np.float64]:
    """Return the entries of K and M that an effect adds."""
    parts = effect.contribute(model)
    return np.concatenate([X.ravel() for c in parts for X in (c.K, c.M) if X is not None])
