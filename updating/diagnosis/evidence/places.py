"""Places of a model: where something may be missing, and how motions and forces there reach the sensors."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fem.array_types import Complexes, Floats, Ints
from fem.lengths import length_text
from fem.model import Contribution, Effect, Model
from fem.reduction.local_changes import LocalChanges
from updating.inference.problem import Problem

MOST_DOFS = 36
"""Effects on more DOFs act on a member or more as a whole: what they do is one shape at each line."""
MOST_SHAPES = 3
"""Number of shapes, the largest ones, that represent effects on full members."""
ALONG = 11
"""Points along each member that are places of their own."""
SAME_MOTION = 1e-3
"""Motions whose responses at the sensors differ by less are one [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A connection, a member, a point along a member, an instrument, or a group of such.

    Attributes
    ----------
    kind : str
        joint, support, end, point, member, instrument or structure.
    name : str
        Unique, such as ``"joint J"`` or ``"member U at 0.60 m"``.
    parent : str
        Name of what holds it: the member of a point along it, or itself.
    effects : tuple of Effect
        Candidates that act there, those with a position at it.
    """

    kind: str
    name: str
    parent: str
    effects: tuple[Effect, ...]


def place_of(effect: Effect) -> tuple[str, str]:
    """Return kind and name of the place that an effect names by its fields, but for its position."""

    def field(name: str) -> Any:
        return getattr(effect, name, None)

    for kind in ("joint", "support"):
        many, one = field(kind + "s"), field(kind)
        if isinstance(many, tuple) and all(isinstance(x, str) for x in many):
            return kind, f"{kind}{'s' if len(many) > 1 else ''} {', '.join(many)}"
        if isinstance(one, str):
            return kind, f"{kind} {one}"
    ends = field("ends")
    if isinstance(ends, tuple) and len(ends) == 1:
        return "end", f"end {ends[0][1]} of member {ends[0][0]}"
    if isinstance(field("member"), str):
        if field("end") in (1, 2):
            return "end", f"end {field('end')} of member {field('member')}"
        return "member", f"member {field('member')}"
    if field("point") is not None:
        at = str(field("place") or f"point {field('point')}")
        return "point", f"{at.split(',')[0]} (as a point)"
    return "structure", effect.where


def places_of(problem: Problem[Any], candidates: Iterable[Effect]) -> tuple[Place, ...]:
    """Return all places at which candidates act, each with its candidates.

    Those with a position are at ``ALONG`` points of their member.
    """
    found: dict[str, tuple[str, str, list[Effect]]] = {}
    mesh = problem.reduced.model.mesh
    for effect in candidates:
        kind, name = place_of(effect)
        span = next((p for p in effect.parameters() if p.position), None)
        member = getattr(effect, "member", None)
        if span is None or member is None:
            found.setdefault(name, (kind, name, []))[2].append(effect)
            continue
        for s in (np.arange(ALONG) + 0.5) / ALONG * mesh.member_length(member):
            at = f"{name} at {length_text(s)}"
            inside = float(np.clip(s, span.lower, span.upper))
            found.setdefault(at, ("point", name, []))[2].append(effect.with_values(**{span.name: inside}))
    return tuple(Place(kind, at, name, tuple(effects)) for at, (kind, name, effects) in found.items())


@dataclass(frozen=True, slots=True, eq=False)
class Reach:
    """How motions anywhere reach the sensors, at some lines.

    Attributes
    ----------
    model : Model
    changes : LocalChanges
    """

    model: Model
    changes: LocalChanges

    def of(self, places: Sequence[Place], say: Callable[[str], None] = lambda text: None) -> list[Complexes]:
        """Return the shapes (n_freq, n_in or 1, n_out, k) that each place can give the receptances."""
        fields = self.changes.fields()
        keys, violations = self.changes.violations()
        out = []
        for place in places:
            local: list[Complexes] = []
            each: list[Complexes] = []
            forces: list[tuple[Ints, Floats]] = []
            released = {key for effect in place.effects for key in effect.released()}
            if rows := [n for n, key in enumerate(keys) if key in released]:
                local.append(violations[rows].transpose(2, 1, 0))
            for effect in place.effects:
                if effect.released():
                    continue
                contributions = self.model.parts_of(acting(effect))
                dofs, S = motions_of(contributions)
                if len(dofs) > MOST_DOFS or any(c.law is not None for c in contributions):
                    each.append(fields.slope(contributions, effect.connection).transpose(0, 2, 1)[..., None])
                elif S.shape[1]:
                    forces.append((dofs, S))
            if forces:
                dofs, S = _together(forces)
                moved = fields.outputs[dofs]
                flat = (S.T @ moved.reshape(len(dofs), -1)).reshape(S.shape[1], *moved.shape[1:])
                local.append(flat.transpose(2, 1, 0))
            shapes = [self._at_inputs(_independent(np.concatenate(local, axis=2)))] if local else []
            shapes += [_strongest(np.concatenate(each, axis=3))] if each else []
            out.append(np.concatenate(shapes, axis=3) if shapes else np.zeros((0,) * 4))
        return out

    def _at_inputs(self, shapes: Complexes) -> Complexes:
        """Return what shapes (n_freq, n_all, k) of all outputs do to readings, (n_freq, n_in, n_out, k)."""
        slopes = shapes.transpose(2, 0, 1)[..., None]
        n_in = self.changes.every.shape[2]
        slopes = np.broadcast_to(slopes, (*slopes.shape[:3], n_in))
        return self.changes.slopes_read(slopes).transpose(1, 3, 2, 0)


def acting(effect: Effect) -> Effect:
    """Return an effect at a value at which it is there: the weakest but one of its grid."""
    p = effect.parameters()[0]
    if p.value != p.absent and np.isfinite(p.value):
        return effect
    grid = effect.starts(lambda key: 1.0)
    values = [g[p.name] for g in grid if g.get(p.name, p.absent) != p.absent]
    if not values:
        return effect
    size = [
        abs(np.log(v / p.absent)) if p.log and 0 < p.absent < np.inf else abs(v - p.absent) for v in values
    ]
    return effect.with_values(**{p.name: values[int(np.argmin(size))]})


def motions_of(contributions: Sequence[Contribution]) -> tuple[Ints, Floats]:
    """Return the DOFs (m,) that matrices act on, and a basis (m, k) of the forces that they exert."""
    dofs = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *(c.dofs.ravel() for c in contributions)]))
    if len(dofs) > MOST_DOFS:
        return dofs, np.zeros((len(dofs), 0))
    columns = []
    for c in contributions:
        for X in (c.K, c.M, c.C, c.D):
            if X is None or not np.any(X):
                continue
            total = np.zeros((len(dofs), len(dofs)))
            at = np.searchsorted(dofs, c.dofs)
            np.add.at(total, (at[:, :, None], at[:, None, :]), np.real(X))
            scale = np.sqrt(np.maximum(np.abs(np.diag(total)), 1e-300 + 1e-12 * np.abs(total).max()))
            lam, V = np.linalg.eigh(total / np.outer(scale, scale))
            columns.append(scale[:, None] * V[:, np.abs(lam) > 1e-9 * np.abs(lam).max()])
    return dofs, np.hstack([np.zeros((len(dofs), 0)), *columns])


def _together(forces: Sequence[tuple[Ints, Floats]]) -> tuple[Ints, Floats]:
    """Return independent forces that span those of several effects, on the DOFs of all of them."""
    dofs = np.unique(np.concatenate([d for d, _ in forces]))
    columns = np.hstack([np.zeros((len(dofs), 0))])
    for effect_dofs, S in forces:
        block = np.zeros((len(dofs), S.shape[1]))
        block[np.searchsorted(dofs, effect_dofs)] = S / np.linalg.norm(S, axis=0)
        columns = np.hstack([columns, block])
    scale = np.maximum(np.abs(columns).max(axis=1), 1e-300)[:, None]
    U, s, _ = np.linalg.svd(columns / scale, full_matrices=False)
    return dofs, scale * U[:, s > SAME_MOTION * s[0]]


def _independent(A: Complexes) -> Complexes:
    """Return the independent ones of the shapes (n_freq, n_out, k), those of the greatest size."""
    size = np.sqrt((np.abs(A) ** 2).sum(axis=(0, 1)))
    A = A[:, :, size > 0] / size[size > 0]
    if A.shape[2] <= 1:
        return A
    flat = A.reshape(-1, A.shape[2])
    _, s, Vh = np.linalg.svd(np.real(flat.conj().T @ flat))
    # Largest number of independent motions of a place: those that reach the sensors most
    kept = np.flatnonzero(s > SAME_MOTION**2 * s[0])[:6]
    return A @ Vh[kept].T


def _strongest(A: Complexes) -> Complexes:
    """Return the few shapes at each line (n_freq, n_in, n_out, k) that most of the given ones are made of."""
    size = np.sqrt((np.abs(A) ** 2).sum(axis=2, keepdims=True))
    if A.shape[3] <= MOST_SHAPES:
        return A
    return np.linalg.svd(A / np.maximum(size, 1e-300), full_matrices=False)[0][..., :MOST_SHAPES]
