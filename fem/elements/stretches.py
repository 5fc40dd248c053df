"""Parts of members between two arc lengths: their strain energy, layers of mass on them, stiffer stretches.

Ends may lie within elements, and may be complex for derivatives with respect to them (complex step).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.array_types import Ints
from fem.elements import tapered
from fem.elements.connections import line_slips, with_connections, with_rigid_ends
from fem.elements.frame import Frame
from fem.elements.interpolation import gauss_points, shape_matrix, strain_matrix
from fem.elements.lines import (
    COLUMNS,
    NO_CHANGE,
    Lines,
    SectionChange,
    flexible_fraction,
    n_gauss,
    rigidities,
    some_lines,
)
from fem.elements.matrices import local_stiffness, to_global
from fem.elements.rigid_zones import masses_in_rigid_zones
from fem.mesh import Mesh
from fem.model import Array, Contribution, Model

STEP = 1e-30
"""Step of derivatives by sections, imaginary."""


def stiffness_of_stretch(
    frame: Frame,
    model: Model,
    member: str,
    start: Array,
    stop: Array,
    factors: ArrayLike = (1, 1, 1, 1, 1, 1),
) -> Contribution:
    """Return stiffness and structural damping of the part of a member between two arc lengths.

    Parameters
    ----------
    frame : Frame
    model : Model
    member : str
    start, stop : float
        Arc lengths [m]; cut to the member.
    factors : array_like (6,)
        Weights of the axial, shear y, shear z, torsion, bending y and bending z parts [-].
    """
    g, part = _local_part(frame, model, member, start, stop, np.asarray(factors))
    return _damped(g, to_global(part, g.T))


def _damped(g: Lines, K: Array) -> Contribution:
    """Return stiffnesses of lines with their structural damping."""
    return Contribution(g.dofs, K, D=g.eta[:, None, None] * K if np.any(g.eta != 0) else None)


def _local_part(
    frame: Frame, model: Model, member: str, start: Any, stop: Any, factors: NDArray[Any]
) -> tuple[Lines, Array]:
    """Return the lines of a member between two arc lengths, and the local stiffness there (b, 12, 12)."""
    lines, first, last = _fractions(model.mesh, member, start, stop)
    g = frame.lines(model.mesh, lines)
    lo, hi = flexible_fraction(g, first), flexible_fraction(g, last)
    x, weight = (each[:, None] for each in gauss_points(n_gauss(g, 3)))
    at = lo + x * (hi - lo)
    B = strain_matrix(g, at)
    scale = (weight * (hi - lo) * g.L)[..., None] * rigidities(g, at) * factors
    return g, (np.swapaxes(B, -1, -2) @ (scale[..., None] * B)).sum(axis=0)


def loss_of_stretch(
    frame: Frame, model: Model, member: str, start: Any, stop: Any, loss: Any
) -> Contribution:
    """Return the change of K and D where a part of a member between two arc lengths loses stiffness.

    Parts of :func:`stiffness_of_stretch` are taken away. Elements whose ends slip in springs lose them behind
    these, which stay as they are.

    Parameters
    ----------
    frame : Frame
    model : Model
    member : str
    start, stop : float
        Arc lengths [m]; cut to the member.
    loss : float
        Lost fraction of the stiffness [-].
    """
    g, part = _local_part(frame, model, member, start, stop, np.ones(6))
    if g.soft.size:
        full = local_stiffness(with_rigid_ends(g))
        change = with_connections(g, full - loss * part) - with_connections(g, full)
        K = to_global(change, g.T_nodes)
    else:
        K = -loss * to_global(part, g.T)
    return _damped(g, K)


def mass_of_stretch(
    frame: Frame, model: Model, member: str, start: Any, stop: Any, weights: ArrayLike
) -> Contribution:
    """Return the mass of a layer on a member between two arc lengths.

    M = ∫ Nᵀ diag(weights) N dx with the motion N of the member's axis in local axes; of elements with lumped
    mass, the layer is lumped at their ends by lever. Rigid zones move with their nodes.

    Parameters
    ----------
    frame : Frame
    model : Model
    member : str
    start, stop : float
        Arc lengths [m]; cut to the member. Complex ones give derivatives (complex step).
    weights : array_like (6,)
        Mass and rotary inertia per length in local x y z rx ry rz [kg/m, kg·m].
    """
    return mass_of_stretches(frame, model, [(member, start, stop, 1.0)], weights)


def mass_of_stretches(
    frame: Frame, model: Model, stretches: Sequence[tuple[str, Any, Any, Any]], weights: ArrayLike
) -> Contribution:
    """Return :func:`mass_of_stretch` of several stretches: member, both arc lengths, and a factor of each."""
    lines, first, last, which = _fractions_of(model.mesh, [s[:3] for s in stretches])
    factor = np.array([s[3] for s in stretches])[which]
    g, per_length = frame.lines(model.mesh, lines), np.asarray(weights, dtype=float)
    a, b = flexible_fraction(g, first), flexible_fraction(g, last)
    x, weight = (each[:, None] for each in gauss_points(n_gauss(g, 4)))
    N = shape_matrix(g, a + x * (b - a))
    scale = (weight * (b - a) * g.L)[..., None] * per_length
    M = to_global((np.swapaxes(N, -1, -2) @ (scale[..., None] * N)).sum(axis=0), g.T)
    lumped = g.lumped != 0
    if lumped.any():
        x = (a + x * (b - a))[:, lumped, None]
        lumps = np.concatenate([(share * scale[:, lumped]).sum(axis=0) for share in (1 - x, x)], axis=1)
        T = g.T_nodes[lumped]
        M = M.astype(np.result_type(M, lumps))
        M[lumped] = np.swapaxes(T, 1, 2) @ (lumps[:, :, None] * T)
    if g.zone.any():
        for k, part in enumerate(masses_in_rigid_zones(g, first * g.span, last * g.span, per_length)):
            M[:, 6 * k : 6 * k + 6, 6 * k : 6 * k + 6] += part
    return Contribution(g.dofs, M=factor[:, None, None] * M)


@dataclass(frozen=True, slots=True, eq=False)
class Stretches:
    """Stretches of members that may be stiffer than these, and the elements (b) that they touch.

    Of the elements' flexibility F = ∫ bᵀ f b dx, b the section forces of unit forces at the second end, the
    stretches keep a part: exact for any length, also within an element. M stays.

    Attributes
    ----------
    lines : Lines
    members : ndarray of str (b,)
    which, touched : ndarray of int (n,)
        Stretch and element of each of n parts.
    cut : ndarray (n_zones,)
        Length of each stretch over the one that its part of F is for [-].
    flexibility, parts : ndarray (b, 6, 6), (n, 6, 6)
        F of the elements and of the parts.
    slopes : tuple of (ndarray, ndarray)
        Derivatives of both by changes of the sections.
    """

    lines: Lines
    members: NDArray[np.str_]
    which: Ints
    touched: Ints
    cut: Array
    flexibility: Array
    parts: Array
    slopes: tuple[tuple[Array, Array], ...] = ()

    @classmethod
    def of(
        cls,
        frame: Frame,
        model: Model,
        zones: Sequence[tuple[str, float, Any, int]],
        changes: Sequence[SectionChange] = (),
    ) -> "Stretches":
        """Return the stretches of some members.

        Parameters
        ----------
        frame : Frame
        model : Model
        zones : sequence of (str, float, float, int)
            Member, arc length at which the stretch begins, its length [m], and 1 or -1 for up or down the
            member. A length may be complex, for derivatives. Stretches must not overlap.
        changes : sequence of SectionChange
            Imaginary steps of ``STEP``, for ``slopes``.
        """
        stretches, cut = [], []
        for member, start, length, towards in zones:
            reach = at_least(length, 1e-9 * model.mesh.member_length(member))
            stretches.append((member, *((start, start + reach) if towards > 0 else (start - reach, start))))
            cut.append(length / reach)
        rows, lo, hi, which = _fractions_of(model.mesh, stretches)
        every, touched = np.unique(rows, return_inverse=True)
        of_line = dict(zip(rows.tolist(), (zones[k][0] for k in which), strict=True))

        def both(change: SectionChange) -> tuple[Lines, Array, Array]:
            g = frame.lines(model.mesh, every, change=change)
            some = some_lines(g, touched)
            full = end_flexibility(g, np.zeros(len(g.L)), np.ones(len(g.L)))
            return g, full, end_flexibility(some, flexible_fraction(some, lo), flexible_fraction(some, hi))

        g, full, parts = both(NO_CHANGE)
        slopes = tuple((np.imag(F) / STEP, np.imag(p) / STEP) for _, F, p in map(both, changes))
        members = np.array([of_line[row] for row in every.tolist()])
        return cls(g, members, which, touched, np.array(cut), full, parts, slopes)

    def gain(self, kept: ArrayLike) -> Array:
        """Return the stiffness that the elements gain, (b, 12, 12) in global axes.

        Parameters
        ----------
        kept : array_like () or (n_zones, 6)
            Parts of its flexibility that a stretch keeps, to forces along its local axes and moments about
            them [-].
        """
        g, F = self.lines, self.flexibility
        now, before = (_stiffness_from_flexibility(g, X) for X in (self._left(F, self.parts, kept), F))
        return to_global(with_connections(g, now) - with_connections(g, before), g.T_nodes)

    def gain_slopes(self, kept: ArrayLike) -> Array:
        """Return the derivatives of the gain by changes of the sections, (n_changes, b, 12, 12).

        As linear in these as the members' own matrices: an element of flexibility F that changes by c dF has
        the stiffness F⁻¹ (F - c dF) F⁻¹, which is positive as long as F - c dF is.
        """
        g, F = self.lines, self.flexibility
        left = self._left(F, self.parts, kept)
        out = []
        for dF, dp in self.slopes:
            now, before = (_slope_of(g, X, dX) for X, dX in ((left, self._left(dF, dp, kept)), (F, dF)))
            out.append(to_global(now - before, g.T_nodes))
        return np.array(out).reshape(-1, *F.shape[:1], 12, 12)

    def contribution(self, K: Array) -> Contribution:
        """Return stiffnesses of the elements with their structural damping."""
        return _damped(self.lines, K)

    def _left(self, F: Array, parts: Array, kept: ArrayLike) -> Array:
        """Return flexibilities of the elements, of which the stretches keep a part."""
        lost = (1 - np.broadcast_to(kept, (len(self.cut), 6))) * self.cut[:, None]
        share = lost[self.which]
        less = 0.5 * (share[:, :, None] + share[:, None, :]) * parts
        out = F.astype(np.result_type(F, less))
        np.subtract.at(out, self.touched, less)
        return out


def stiffening(
    frame: Frame, model: Model, zones: Sequence[tuple[str, float, Any, int]], flexibility: ArrayLike
) -> Contribution:
    """Return the increase of K and D where stretches of members are stiffer, as of :class:`Stretches`."""
    stretches = Stretches.of(frame, model, zones)
    return stretches.contribution(stretches.gain(flexibility))


def at_least(length: Any, least: float) -> Any:
    """Return a length, or a least one with the length's imaginary part.

    A stretch of length 0 has a derivative with respect to its length: that of the stretch that begins.
    """
    if np.real(length) > least:
        return length
    return least + 1j * length.imag if np.iscomplexobj(length) else least


def _fractions_of(mesh: Mesh, stretches: Sequence[tuple[str, Any, Any]]) -> tuple[Ints, Array, Array, Ints]:
    """Return :func:`_fractions` of several stretches, one after the other, and each line's stretch."""
    lines, lo, hi = zip(*(_fractions(mesh, *each) for each in stretches), strict=True)
    which = np.repeat(np.arange(len(stretches)), [len(part) for part in lines])
    return np.concatenate(lines), np.concatenate(lo), np.concatenate(hi), which


def _fractions(mesh: Mesh, member: str, start: Any, stop: Any) -> tuple[Ints, Array, Array]:
    """Return the lines of a member between two arc lengths, and the fractions of the lines between them."""
    s = mesh.member_positions(member)
    first: Any = start if np.real(start) > 0 else 0.0
    last: Any = stop if np.real(stop) < s[-1] else float(s[-1])
    touched = np.flatnonzero((s[1:] > np.real(first)) & (s[:-1] < np.real(last)))
    h = s[touched + 1] - s[touched]
    lo = np.array([(first - s[k]) if np.real(first) >= s[k] else 0.0 for k in touched]) / h
    hi = np.array([(last - s[k]) if np.real(last) <= s[k + 1] else h[i] for i, k in enumerate(touched)]) / h
    return mesh.members[member][touched], lo, hi


def end_flexibility(g: Lines, lo: Array, hi: Array) -> Array:
    """Return the motion of the second ends by unit forces there, from the flexibility between two places.

    Local, with the first ends fixed; places are fractions of the flexible parts. Shape (b, 6, 6).
    """
    arm1, arm2 = g.L * (1 - lo), g.L * (1 - hi)
    one, first, second = arm1 - arm2, (arm1**2 - arm2**2) / 2, (arm1**3 - arm2**3) / 3
    F: Array = np.zeros((len(g.L), 6, 6), dtype=np.result_type(one, g.E, g.A, g.J, g.phi_y, g.phi_z))
    F[:, 0, 0] = one / (g.E * g.A)
    F[:, 3, 3] = one * 2 * (1 + g.nu) / (g.E * g.J)
    for v, r, I, phi, sign in ((1, 5, g.Iz, g.phi_y, 1.0), (2, 4, g.Iy, g.phi_z, -1.0)):
        EI = g.E * I
        F[:, v, v] = (second + phi * g.L**2 / 12 * one) / EI
        F[:, v, r] = F[:, r, v] = sign * first / EI
        F[:, r, r] = one / EI
    t = np.flatnonzero(g.tapered)
    if not t.size:
        return F
    lo, hi, some = lo[t], hi[t], some_lines(g, t)
    of = {key: some.stations[..., k] for key, k in COLUMNS.items()}
    ds = (tapered.weights_at(hi, 1) - tapered.weights_at(lo, 1)) * some.L[:, None]
    F_tapers = np.zeros((t.size, 6, 6), dtype=np.result_type(F, ds, of["A"]))
    F_tapers[:, 0, 0] = (ds / of["A"]).sum(axis=1)
    F_tapers[:, 3, 3] = 2 * (1 + some.nu) * (ds / of["J"]).sum(axis=1)
    for v, r, I, shear, sign in ((1, 5, "Iz", "sy", 1.0), (2, 4, "Iy", "sz", -1.0)):
        bent = tapered.end_flexibility(some.L, of[I], of[shear], lo, hi)
        F_tapers[:, v, v], F_tapers[:, r, r] = bent[:, 0, 0], bent[:, 1, 1]
        F_tapers[:, v, r] = F_tapers[:, r, v] = sign * bent[:, 0, 1]
    F = F.astype(F_tapers.dtype)
    F[t] = F_tapers / some.E[:, None, None]
    return F


def _stiffness_from_flexibility(g: Lines, F: Array) -> Array:
    """Return the local stiffness (b, 12, 12) of elements from the flexibility of their second ends."""
    return _from_ends(g, np.linalg.inv(F))


def _from_ends(g: Lines, S: Array) -> Array:
    """Return matrices (b, 12, 12) for both ends from those (b, 6, 6) of the second ends."""
    E = np.zeros((len(g.L), 6, 12))  # motion of the second end relative to a rigid body on the first
    E[:, :, 6:] = np.eye(6)
    E[:, :, :6] = -np.eye(6)
    E[:, 1, 5], E[:, 2, 4] = -g.L, g.L
    return np.swapaxes(E, 1, 2) @ S @ E


def _slope_of(g: Lines, F: Array, dF: Array) -> Array:
    """Return the derivative of the local stiffness of elements, from node to node, by that of F.

    Where ends slip, the slips make the energy least: it changes by that of the element as it is bent.
    """
    dK = -_from_ends(g, np.linalg.solve(F, dF) @ np.linalg.inv(F))
    if g.soft.size:
        bent = np.eye(12) - line_slips(g, _stiffness_from_flexibility(g, F)[g.soft])
        dK[g.soft] = np.swapaxes(bent, 1, 2) @ dK[g.soft] @ bent
    return dK
