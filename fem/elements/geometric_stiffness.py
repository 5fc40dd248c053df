"""The geometric stiffness of beams under all six section forces.

With the axis at r(x), sections turned by the rotation vector θ = (a, b, c), R = exp(θ×), and the strains
Γ = Rᵀr' - e₁ and κ = axial(RᵀR') of the geometrically exact beam (Reissner, J. Appl. Math. Phys. 23, 1972,
795-804; Simo, Comput. Methods Appl. Mech. Eng. 49, 1985, 55-70) the terms of second order are

    Γ₂ = -θ × u' + θ × (θ × e₁) / 2,    κ₂ = -θ × θ' / 2,

and the forces n = (N, Vy, Vz) and moments m = (T, My, Mz) of the static state do on them the work
n·Γ₂ + m·κ₂ per length. As sections and nodes have rotation vectors, moments are semitangential: members that
meet at an angle agree on the moment that they pass on (Argyris, Hilpert, Malejannakis and Scharpf, Comput.
Methods Appl. Mech. Eng. 20, 1979, 105-131; Yang and Kuo, *Theory and Analysis of Nonlinear Framed
Structures*, 1994, ch. 6).
See docs/theory-fem.md for the derivation.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fem.array_types import Floats, Ints
from fem.elements.interpolation import XY_DOFS, XZ_DOFS, XZ_SIGNS, gauss_points, prismatic_bending
from fem.elements.levers import lever_stiffness
from fem.elements.lines import Lines, flexible_fraction, some_lines
from fem.elements.matrices import to_global
from fem.model import Array

FORCE_NODES, _WEIGHTS = gauss_points(4)
"""Fractions of a stretch at which section forces are given: a cubic through them has the moments of a load
that is linear along the stretch, and products with the squares of slopes are integrated exactly."""

_OTHERS = np.array([np.delete(FORCE_NODES, j) for j in range(4)])


@dataclass(frozen=True, slots=True, eq=False)
class SectionForces:
    """Section forces along a member, cubic within each of some stretches.

    Attributes
    ----------
    start, stop : ndarray (p,)
        Arc lengths from the member's first end at which the stretches begin and end, one after the other [m].
    values : ndarray (p, 4, 6)
        N, Vy, Vz, T, My and Mz at the fractions `FORCE_NODES` of each stretch [N, N·m].
    """

    start: Floats
    stop: Floats
    values: Floats

    @classmethod
    def axial(cls, s: Floats, N: Floats) -> "SectionForces":
        """Return axial forces that are linear between places; one that is given twice is a jump."""
        s, N = np.asarray(s, dtype=float), np.asarray(N, dtype=float)
        if s.size == 1:
            s, N = np.repeat(s, 2), np.repeat(N, 2)
        k = np.flatnonzero((np.diff(s) > 0) | (s[-1] == s[0]))
        values = np.zeros((k.size, 4, 6))
        values[:, :, 0] = N[k, None] + FORCE_NODES * (N[k + 1] - N[k])[:, None]
        return cls(s[k], s[k + 1], values)


@dataclass(frozen=True, slots=True, eq=False)
class Courses:
    """Section forces along several members, cubic within each of some stretches.

    Attributes
    ----------
    member : ndarray of int (p,)
        Number of the member of each stretch, rising.
    start, stop, values : ndarray (p,), (p,), (p, 4, 6)
        As of `SectionForces`.
    """

    member: Ints
    start: Floats
    stop: Floats
    values: Floats

    @classmethod
    def of(cls, forces: Mapping[int, SectionForces]) -> "Courses":
        """Return those of members by number, which rise."""
        count = [f.start.size for f in forces.values()]
        member = np.repeat(np.fromiter(forces, dtype=np.int64, count=len(count)), count)
        start, stop, values = (
            np.concatenate([getattr(f, key) for f in forces.values()]) for key in ("start", "stop", "values")
        )
        return cls(member, start, stop, values)

    def at(self, member: Ints, places: Floats, inside: Floats) -> Floats:
        """Return the forces at places of the stretches that other places lie in, shape (n, 6).

        Beyond the first and last stretch of a member they are those at its end.
        """
        first, last = (np.searchsorted(self.member, member, side=side) for side in ("left", "right"))
        k = np.clip(_last_before(self.member, self.start, member, inside), first, last - 1)
        length = self.stop[k] - self.start[k]
        x = np.clip(places, self.start[k], self.stop[k]) - self.start[k]
        t = np.divide(x, length, out=np.full_like(x, 0.5), where=length > 0)
        return (_lagrange(t)[:, None] @ self.values[k])[:, 0]


def _last_before(member: Ints, starts: Floats, at_member: Ints, at: Floats) -> Ints:
    """Return the index of the last start at or before each place; those of each member rise."""
    is_place = np.repeat([False, True], [starts.size, at.size])
    order = np.lexsort((is_place, np.concatenate([starts, at]), np.concatenate([member, at_member])))
    out = np.empty(order.size, dtype=np.int64)
    out[order] = np.cumsum(~is_place[order]) - 1
    return out[starts.size :]


def _lagrange(t: Floats) -> Floats:
    """Return the cubics that are 1 at one of `FORCE_NODES` and 0 at the others, shape (n, 4)."""
    return np.prod((t[:, None, None] - _OTHERS) / (FORCE_NODES[:, None] - _OTHERS), axis=2)


@dataclass(frozen=True, slots=True, eq=False)
class ForceSamples:
    """Section forces at points of quadrature along the axes of some lines.

    Attributes
    ----------
    line : ndarray of int (m,)
        Which of the lines each is on.
    xi : ndarray (m,)
        Fraction of the axis, rigid zones included.
    weight : ndarray (m,)
        Length that it stands for [m].
    forces : ndarray (m, 6)
        N, Vy, Vz, T, My and Mz [N, N·m].
    ends : ndarray (b, 2, 6)
        The forces at both ends of the b lines.
    """

    line: Ints
    xi: Floats
    weight: Floats
    forces: Floats
    ends: Floats

    @classmethod
    def joined(cls, parts: Sequence["ForceSamples"]) -> "ForceSamples":
        """Return the samples of several courses on the same lines, whose forces add up."""
        line, xi, weight, forces = (
            np.concatenate([getattr(p, key) for p in parts]) for key in ("line", "xi", "weight", "forces")
        )
        return cls(line, xi, weight, forces, np.sum([p.ends for p in parts], axis=0))


def sample(g: Lines, s: Floats, member: Ints, courses: Courses) -> ForceSamples:
    """Return the section forces of lines at points of quadrature; members without a course have none.

    Parameters
    ----------
    g : Lines
        All lines of some members, one after the other.
    s : ndarray (b, 2)
        Arc lengths of their ends along their member [m].
    member : ndarray of int (b,)
        Number of the member of each, rising.
    courses : Courses
    """
    some = np.flatnonzero(np.isin(member, courses.member))
    ends, of = s[some], member[some]
    span, axis = ends[:, 1] - ends[:, 0], g.span[some]
    zone = g.zone[some] * (span / axis)[:, None]  # offsets that change along a member lengthen its axis
    member_length = ends[np.searchsorted(of, of, side="right") - 1, 1]
    at = np.searchsorted(of, courses.member)
    breaks = [ends[:, 0], ends[:, 1], ends[:, 0] + zone[:, 0], ends[:, 1] - zone[:, 1]]
    owners = [of] * 4
    for x in (courses.start, courses.stop):
        inside = (x > 0) & (x < member_length[at])
        breaks.append(x[inside])
        owners.append(courses.member[inside])
    owner = np.concatenate(owners)
    place = np.concatenate(breaks)
    order = np.lexsort((place, owner))
    place, owner = place[order], owner[order]
    least = 1e-12 * member_length[np.searchsorted(of, owner)]
    new = np.concatenate([[True], (np.diff(place) > least[1:]) | (np.diff(owner) > 0)])
    place, owner = place[new], owner[new]
    k = np.flatnonzero(owner[1:] == owner[:-1])
    middle, length, owner = (place[k] + place[k + 1]) / 2, place[k + 1] - place[k], owner[k]
    line = _last_before(of, ends[:, 0], owner, middle)
    places = (place[k, None] + length[:, None] * FORCE_NODES).ravel()
    each, between = np.repeat(line, 4), (ends[:, 0] + ends[:, 1]) / 2
    found = courses.at(
        np.concatenate([np.repeat(owner, 4), of, of]),
        np.concatenate([places, ends[:, 0], ends[:, 1]]),
        np.concatenate([np.repeat(middle, 4), between, between]),
    )
    inner, left, right = np.split(found, [len(places), len(places) + len(between)])
    at_ends = np.zeros((len(g.L), 2, 6))
    at_ends[some, 0], at_ends[some, 1] = left, right
    return ForceSamples(
        some[each],
        (places - ends[each, 0]) / span[each],
        (length[:, None] * _WEIGHTS).ravel() * (axis / span)[each],
        inner,
        at_ends,
    )


def stress_stiffness(g: Lines, samples: ForceSamples) -> Array:
    """Return the geometric stiffness of lines under section forces, global, shape (b, 12, 12).

    The second derivative of ∫ (n·Γ₂ + m·κ₂) dx. In it N (v'² + w'²)/2 has the axis' full slope, shear
    included (Engesser, Zentralbl. Bauverwaltung 11, 1891, 483-486); N (Iy + Iz)/A a'²/2 is the work of
    fibres that a twist inclines (Wagner, 1929; McGuire, Gallagher and Ziemian, *Matrix Structural
    Analysis*, 2nd ed. 2000, ch. 9). Rigid zones turn with their nodes; an offset is a rigid arm that n acts
    on. Bars have N alone.
    """
    each = samples.line
    parts = some_lines(replace(g, T=np.zeros((len(g.L), 0, 0))), each)  # copies of maps take the most time
    along = samples.xi * parts.span
    rigid = (along < parts.zone[:, 0]) | (along > parts.span - parts.zone[:, 1])
    forces = np.where(g.bar[each, None] != 0, samples.forces * [1, 0, 0, 0, 0, 0], samples.forces)
    radius = (1 - g.bar) * (g.Iy + g.Iz) / g.A
    S = _work(forces, radius[each]) * samples.weight[:, None, None]
    B = _gradients(parts, flexible_fraction(parts, samples.xi))
    B[rigid] = 0.0
    out = to_global(_sum(B, S, each, len(g.L)), g.T)
    if rigid.any():
        B = _rigid_gradients(np.where(samples.xi[rigid] < 0.5, 0, 6))
        out = out + to_global(_sum(B, S[rigid], each[rigid], len(g.L)), g.T_nodes)
    for k, sign in ((0, -1.0), (1, 1.0)):
        offset = g.end[:, k] + (sign * g.zone[:, k])[:, None] * g.R[:, 0]
        on_arm = sign * np.einsum("bij,bi->bj", g.R, samples.ends[:, k, :3])
        turn = slice(3 + 6 * k, 6 + 6 * k)
        out[:, turn, turn] += lever_stiffness(offset, on_arm)
    return out


def _sum(B: Array, S: Floats, line: Ints, n: int) -> Array:
    """Return the sums of Bᵀ S B over the samples on each of n lines, shape (n, 12, 12)."""
    if (np.diff(line) < 0).any():
        order = np.argsort(line, kind="stable")
        B, S, line = B[order], S[order], line[order]
    SB = S @ B
    out = np.zeros((n, 12, 12), dtype=SB.dtype)
    count = np.bincount(line, minlength=n)
    first = np.cumsum(count) - count
    for k in np.unique(count[count > 0]):  # one product for each line, lines of equally many together
        rows = np.flatnonzero(count == k)
        at = slice(None) if len(line) == k * rows.size else first[rows][:, None] + np.arange(k)
        left, right = (X[at].reshape(-1, 9 * k, 12) for X in (B, SB))
        out[rows] = np.swapaxes(left, 1, 2) @ right
    return out


def _work(forces: Floats, radius: Floats) -> Floats:
    """Return S (m, 9, 9) with the work of the section forces xᵀSx/2 on x = (u' v' w' a b c a' b' c').

    ``radius`` is the square of the polar radius of gyration (m,).
    """
    N, Vy, Vz, T, My, Mz = forces.T
    S = np.zeros((len(forces), 9, 9))
    for i, j, value in (
        (1, 1, N),
        (2, 2, N),
        (6, 6, N * radius),
        (2, 3, Vy),
        (0, 5, -Vy),
        (3, 4, Vy / 2),
        (0, 4, Vz),
        (1, 3, -Vz),
        (3, 5, Vz / 2),
        (4, 8, -T / 2),
        (5, 7, T / 2),
        (5, 6, -My / 2),
        (3, 8, My / 2),
        (3, 7, -Mz / 2),
        (4, 6, Mz / 2),
    ):
        S[:, i, j] = S[:, j, i] = value
    return S


def _gradients(g: Lines, xi: Array) -> Array:
    """Return (u' v' w' a b c a' b' c') at one place of each line's flexible part from its ends' motion."""
    ry, cy, sy = prismatic_bending(xi, g.L, g.phi_y, "rcs")
    rz, cz, sz = prismatic_bending(xi, g.L, g.phi_z, "rcs")
    B = np.zeros((len(xi), 9, 12), dtype=np.result_type(sy, sz))
    B[:, 0, 0] = B[:, 6, 3] = -1 / g.L
    B[:, 0, 6] = B[:, 6, 9] = 1 / g.L
    B[:, 3, 3], B[:, 3, 9] = 1 - xi, xi
    B[:, 1, XY_DOFS], B[:, 5, XY_DOFS], B[:, 8, XY_DOFS] = sy, ry, cy
    B[:, 2, XZ_DOFS], B[:, 4, XZ_DOFS], B[:, 7, XZ_DOFS] = sz * XZ_SIGNS, -rz * XZ_SIGNS, -cz * XZ_SIGNS
    bar = g.bar != 0
    if bar.any():
        B[bar] = 0.0
        for row in range(3):
            B[bar, row, row], B[bar, row, 6 + row] = -1 / g.L[bar], 1 / g.L[bar]
    return B


def _rigid_gradients(first: Ints) -> Floats:
    """Return the same where a body turns with the end whose DOFs begin at ``first`` (m,)."""
    B, n = np.zeros((len(first), 9, 12)), np.arange(len(first))
    for row, d, sign in ((1, 5, 1.0), (2, 4, -1.0), (3, 3, 1.0), (4, 4, 1.0), (5, 5, 1.0)):
        B[n, row, first + d] = sign
    return B
