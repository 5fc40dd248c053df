"""A cut: a place of a member that gives way in one direction, as a crack or a joint within it does."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fem.elements.connections import mass_from_nodes, with_connections, with_rigid_ends
from fem.elements.frame import Frame
from fem.elements.lines import Lines, flexible_fraction
from fem.elements.matrices import local_mass, local_stiffness, to_global
from fem.mesh import Mesh
from fem.model import DIRECTIONS, Array, Contribution, Model, lever_matrix

Slip = tuple[str, Any, str, Any]
"""Member, arc length [m], direction and compliance of a cut."""

RIGID = 1e-9
"""Relative force up to which an element resists no rigid-body motion: rounding [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class Cut:
    """One element of a member that gives way at a place, all in local axes; see :func:`cut`.

    Attributes
    ----------
    g : Lines
        The element's line.
    x : number
        Place of the cut, as a fraction of the flexible part.
    m, rigid, turned : ndarray (12,)
        Motions by a unit slip: of the second end, of the part beyond as one body, and the first without the
        turn of the element where the cut is at its first end.
    mass, beyond : ndarray (12, 12)
        Mass of the element, and of what is beyond the cut; None where all mass is lumped.
    slip : number
        a = c / (1 + c mᵀ K m).
    q : ndarray (12,)
        Force at the cut by the motion of the nodes, K m.
    excess : ndarray (12, 12) or None
        Damping that other effects add beyond that of their stiffness.
    """

    g: Lines
    x: Any
    m: Array
    rigid: Array
    turned: Array
    mass: Array | None
    beyond: Array | None
    slip: Any
    q: Array
    excess: Array | None

    @property
    def at_end(self) -> bool:
        """Whether it is at an end of the element's flexible part."""
        return bool(self.x in (0.0, 1.0))

    @property
    def contribution(self) -> Contribution:
        """The change of K, M and D."""
        g, slip, q = self.g, self.slip, self.q
        K = to_global((-slip * np.outer(q, q))[None], g.T_nodes)
        M = None
        if self.mass is not None and self.beyond is not None:
            b, beta = self._inertia(self.mass, self.beyond)
            bent = slip * np.outer(b, q)
            M = to_global((bent + bent.T + slip**2 * beta * np.outer(q, q))[None], g.T_nodes)
        D = g.eta[:, None, None] * K if np.any(g.eta != 0) else None
        if self.excess is not None:
            change = to_global((self._moved.T @ self.excess @ self._moved - self.excess)[None], g.T_nodes)
            D = change if D is None else D + change
        return Contribution(g.dofs, K, M, D=D)

    def steps(
        self, mesh: Mesh, changes: Sequence[tuple[Frame | None, Sequence[Contribution]]]
    ) -> tuple[Contribution, ...]:
        """Return complex steps of the change by those of the element, where the cut stays as it is.

        With A = 1 - a m qᵀ, and dK, dM and dD of the element and of what else changes it,

            dΔK = Aᵀ dK A - dK,   d(a q) = a Aᵀ dK m,

        and ΔM follows by the product rule: one congruence for each parameter in place of another cut.

        Parameters
        ----------
        mesh : Mesh
        changes : sequence of (Frame or None, sequence of Contribution)
            For each step the frame if it has one, and the contributions of other effects that have one.
        """
        g, A, v = self.g, self._moved, self.slip * self.q
        dK, dM, dB, dE = np.zeros((4, len(changes), 12, 12))
        for k, (frame, others) in enumerate(changes):
            for total, X in zip((dK, dM, dE), _changes(g, others, self.at_end), strict=True):
                if X is not None:
                    total[k] += np.imag(X)
            if frame is None:
                continue
            g_step, K_step, M_step = _kept_line(frame, mesh, int(g.rows[0]))
            dK[k] += np.imag(K_step)
            dM[k] += np.imag(M_step)
            if self.beyond is not None and not self.at_end:
                dB[k] = np.imag(mass_from_nodes(g_step, local_mass(g_step, self.x))[0])
        if self.at_end:
            dB = dM * (1.0 - self.x)
        K = A.T @ dK @ A - dK
        M = None
        dv = self.slip * (dK @ self.turned) @ A
        if self.mass is not None and self.beyond is not None:
            (b, beta), (db, dbeta) = self._inertia(self.mass, self.beyond), self._inertia(dM, dB)
            half = db[:, :, None] * v + b[:, None] * dv[:, None] + beta * v[:, None] * dv[:, None]
            M = half + np.swapaxes(half, 1, 2) + dbeta[:, None, None] * np.outer(v, v)
        D = None if not np.any(g.eta != 0) else g.eta[0] * K
        if self.excess is not None or dE.any():
            change = A.T @ dE @ A - dE
            if self.excess is not None:
                turned = np.swapaxes(-self.turned[:, None] * dv[:, None], 1, 2) @ self.excess @ A
                change = change + turned + np.swapaxes(turned, 1, 2)
            D = change if D is None else D + change
        K, M, D = (None if X is None else 1j * to_global(X, g.T_nodes)[:, None] for X in (K, M, D))
        each = zip(*([None] * len(changes) if X is None else X for X in (K, M, D)), strict=True)
        return tuple(Contribution(g.dofs, k, m, D=d) for k, m, d in each)

    @property
    def _moved(self) -> Array:
        """A = 1 - a m qᵀ."""
        out: Array = np.eye(12) - self.slip * np.outer(self.turned, self.q)
        return out

    def _inertia(self, mass: Array, beyond: Array) -> tuple[Array, Any]:
        """Return b (..., 12) and β (...) by the mass of the element and of the part beyond, (..., 12, 12)."""
        m, rigid = self.m, self.rigid
        b = beyond @ rigid - mass @ m
        return b, (beyond @ rigid) @ rigid - 2 * ((beyond @ rigid) @ m) + (mass @ m) @ m


def cut(
    frame: Frame,
    model: Model,
    member: str,
    position: Any,
    direction: str,
    compliance: Any,
    others: Sequence[Contribution] = (),
) -> Cut:
    """Return an element of a member that gives way at a place, in one direction.

    The two sides of the cut slip by the compliance c times the force that is passed. With m the motion
    of the element's second end that a unit slip lets it have, and K of the element between its points,

        ΔK = -c K m mᵀ K / (1 + c mᵀ K m),

    which is exact: the element's flexibility grows by c times the square of the force at the cut
    (Przemieniecki, Theory of Matrix Structural Analysis, ch. 8). At a member's end it equals a spring of
    1/c. The element's shapes N get the kink ψ = r - N m of a unit slip, r the rigid motion of the
    part beyond, so that with a = c / (1 + c mᵀ K m), μ the mass per length and q = K m

        ΔM = a (b qᵀ + q bᵀ) + a² β q qᵀ,   b = ∫ Nᵀ μ ψ dx,   β = ∫ ψᵀ μ ψ dx.

    Without that the mass follows the nodes, and frequencies err with the cube of the element's part of
    the member. Lumps stay with the nodes. Of what else changes the element, stiffness is in K; its mass and
    damping follow the turn at a member's end, D by (I - a m qᵀ)ᵀ D (I - a m qᵀ). There tensions and springs
    on the element are in K as well, with the turn of that end alone for m.

    Parameters
    ----------
    frame : Frame
    model : Model
    member : str
    position : float
        Arc length [m]; complex for derivatives.
    direction : str
        x y z rx ry rz, local.
    compliance : float
        c [m/N or rad/(N·m)].
    others : sequence of Contribution
        Changes of the element by other effects.
    """
    mesh = model.mesh
    at = mesh.locate(member, float(np.real(position)))
    # the cuts of one line are asked for together, in all directions
    g, K0, M0 = _kept_line(frame, mesh, at.line)
    xi = at.xi + (1j * np.imag(position) / mesh.lengths()[at.line] if np.iscomplexobj(position) else 0.0)
    x = flexible_fraction(g, np.atleast_1d(xi))[0]
    m, rigid = slipped(g, x, direction)
    # a slip at the first end turns that end alone: the same strains, without the turn of the element
    turned = m - rigid if x == 0.0 else m
    at_end = x in (0.0, 1.0)
    stiff, added, excess = _changes(g, others, at_end)
    q = K0 @ m
    opposed = m @ q
    if stiff is not None:
        more = stiff @ turned
        q, opposed = q + more, opposed + turned @ more
    slip = compliance / (1 + compliance * opposed)
    mass = beyond = None
    if not g.lumped[0]:
        mass = M0 if added is None else M0 + added
        beyond = mass * (1.0 - x) if at_end else mass_from_nodes(g, local_mass(g, x))[0]
    return Cut(g, x, m, rigid, turned, mass, beyond, slip, q, excess)


def slipped(g: Lines, x: Any, direction: str) -> tuple[Array, Array]:
    """Return the local motion (12,) of the second end by a unit slip, and the rigid one beyond the cut."""
    i = DIRECTIONS.index(direction)
    m = np.zeros(12, dtype=np.result_type(x))
    m[6 + i] = 1.0
    arm = (1 - x) * g.L[0]
    if direction == "ry":
        m[8] = -arm
    if direction == "rz":
        m[7] = arm
    rigid = m.copy()
    rigid[i] = 1.0
    if direction == "ry":
        rigid[2] = x * g.L[0]
    if direction == "rz":
        rigid[1] = -x * g.L[0]
    return m, rigid


def slips(
    frame: Frame, mesh: Mesh, line: int, cuts: Sequence[Slip]
) -> tuple[Array, Array, Array, Array, Array]:
    """Return what cuts of one line do to motion within it, as parts of a common slip vector s.

    With the nodes' motion u and a force f at a place that moves by Ψ s, s = S (Qᵀ u + Ψᵀ f),
    S = (C⁻¹ + Mᵀ K M)⁻¹; C the compliances, M the motions m of :func:`cut`, Q = K M.

    Returns
    -------
    x : ndarray (n,)
        Places of the cuts, as fractions of the flexible part.
    M, rigid : ndarray (12, n)
        Local.
    S : ndarray (n, n)
    Q : ndarray (12, n)
        Global.
    """
    g, K, _ = _kept_line(frame, mesh, line)
    places = [mesh.locate(member, float(np.real(at))).xi for member, at, *_ in cuts]
    steps = [1j * np.imag(at) / mesh.lengths()[line] if np.iscomplexobj(at) else 0.0 for _, at, *_ in cuts]
    x = np.array([flexible_fraction(g, np.atleast_1d(a + b))[0] for a, b in zip(places, steps, strict=True)])
    M, rigid = (
        np.stack(part, axis=1)
        for part in zip(*(slipped(g, xk, d) for xk, (_, _, d, _) in zip(x, cuts, strict=True)), strict=True)
    )
    Q, c = K @ M, np.array([slip[3] for slip in cuts])
    S = np.linalg.solve(np.eye(len(c)) + c[:, None] * (M.T @ Q), np.diag(c))
    return x, M, rigid, S, g.T_nodes[0].T @ Q


def _changes(
    g: Lines, others: Sequence[Contribution], at_end: bool
) -> tuple[Array | None, Array | None, Array | None]:
    """Return local changes of an element's stiffness and mass, and of its damping beyond that stiffness's.

    Within an element those that resist its motion as a rigid body, as tensions do, are left out: they do not
    follow from the strains.
    """
    back = np.linalg.inv(g.T_nodes) if others else g.T

    def total(key: str) -> Array | None:
        parts = [to_global(X, back)[0] for c in others if (X := getattr(c, key)) is not None]
        parts = parts if at_end else [X for X in parts if not _resists_rigid_motion(X, g.L[0])]
        out: Array | None = sum(parts) if parts else None
        return out

    K, M, D = total("K"), total("M") if at_end else None, total("D")
    if K is not None and np.any(g.eta != 0):
        D = (0.0 if D is None else D) - g.eta[0] * K
    return K, M, D


def _resists_rigid_motion(X: Array, length: float) -> bool:
    """Whether a local matrix (12, 12) of an element resists its motion as a rigid body."""
    moved = np.vstack([np.eye(6), lever_matrix([length, 0.0, 0.0])])
    return bool((np.abs(X @ moved) > RIGID * (np.abs(X) @ np.abs(moved)).max()).any())


def _kept_line(frame: Frame, mesh: Mesh, line: int) -> tuple[Lines, Array, Array]:
    """Return the same as :func:`_uncut_line`, computed once for a frame."""
    out: tuple[Lines, Array, Array]
    out = frame.kept.get(("uncut", mesh, line), lambda: _uncut_line(frame, mesh, line))
    return out


def _uncut_line(frame: Frame, mesh: Mesh, line: int) -> tuple[Lines, Array, Array]:
    """Return a line of the mesh and its local stiffness and mass (12, 12) from node to node."""
    g = frame.lines(mesh, [line])
    K, M = with_connections(g, local_stiffness(with_rigid_ends(g)))[0], mass_from_nodes(g, local_mass(g))[0]
    for shared in (g.dofs, g.T, K, M):
        shared.flags.writeable = False
    return g, K, M
