"""A part from another program, which joins the frame as one element with the part's K and M."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from fem.linalg.lanczos import lowest_eigenpairs
from fem.linalg.solvers import Factor, SingularMatrixError, factorise
from fem.matrices import Matrices, MatricesError
from fem.mesh import Mesh
from fem.model import Contribution, Effect, Model, ModelError, Parameter, dofs_of, lever_matrix

TIES = ("rigid", "average")

HELD = 1e-6
"""A part counts as free if its rigid-body motions meet less than this, relative to its entries one by one."""

_DENSE = 600
"""Parts with at most this many coordinates inside are solved densely."""

_DENSITY = (1e-3, 5e4)
"""Plausible masses of a part by the box around it [kg/m³]: a truss of wires, solid tungsten."""


@dataclass(frozen=True, slots=True, eq=False)
class Attachment:
    """Nodes of a part that are tied to one point of the frame.

    With r from the point to a node, u the point's displacement and θ its rotation:

    - ``"rigid"`` (as RBE2): u_node = u + θ × r for each node, and θ_node = θ where it has
      rotations. The nodes' area keeps its shape, which stiffens the part.
    - ``"average"`` (as RBE3): u and θ are the rigid-body motion nearest to the nodes' translations,
      Σ w |u_node - u - θ × r|² → minimum. The nodes may move otherwise; the part is not stiffened.

    Attributes
    ----------
    point : int
        Point of the mesh.
    nodes : tuple of int
        Nodes of the part.
    tie : str
        ``"rigid"`` or ``"average"``.
    weights : tuple of float
        w of each node for ``"average"`` [-]; all 1 unless given.
    """

    point: int
    nodes: tuple[int, ...]
    tie: str = "rigid"
    weights: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if self.tie not in TIES:
            msg = f"the tie to point {self.point} is '{self.tie}'; allowed are {', '.join(TIES)}"
            raise ModelError(msg)
        if not self.nodes or len(set(self.nodes)) != len(self.nodes):
            msg = (
                f"the tie to point {self.point} has {len(self.nodes)} nodes; one or more are expected, "
                "each once"
            )
            raise ModelError(msg)
        if self.weights and (len(self.weights) != len(self.nodes) or min(self.weights) <= 0):
            msg = (
                f"the tie to point {self.point} has {len(self.weights)} weights for {len(self.nodes)} nodes; "
                "each node needs one, positive"
            )
            raise ModelError(msg)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Superelement(Effect):
    """A part given by its matrices, reduced to its points and to modes with these points held.

    K, M, C, D act on six coordinates of each of ``points`` and on the amplitudes of the fixed-interface modes
    (Craig & Bampton, AIAA J. 6, 1968, 1313-1319), which are internal coordinates of the model. Build it with
    :meth:`from_matrices`.

    Attributes
    ----------
    points : tuple of int
        Points of the mesh, one for each attachment.
    K, M : ndarray (m, m)
        Reduced stiffness and mass, m = 6 · len(points) + n_internal.
    C, D : ndarray (m, m) or None
        Reduced viscous and structural damping.
    recovery : ndarray (n, m)
        From these coordinates to the rows of the part's own matrices.
    fixed_frequency : ndarray (n_internal,)
        Natural frequencies with the points held [Hz].
    left_out : ndarray (6 · len(points), 6 · len(points))
        G = Σ p pᵀ/ω² over the fixed-interface modes that were left out, p their participation φᵀ(M Ψ + M_zb);
        see :meth:`frequency_error` [kg s² …].
    limit : float
        Lowest natural frequency that was left out [Hz]; infinite if none was.
    part : Matrices
        The part itself, with its nodes and their places.
    stiffness, mass : float
        Relative changes of K and M [-].
    eta : float
        Loss factor: D gains ``eta`` · K [-].
    """

    kind: ClassVar[str] = "superelement"
    points: tuple[int, ...]
    K: NDArray[np.float64]
    M: NDArray[np.float64]
    C: NDArray[np.float64] | None = None
    D: NDArray[np.float64] | None = None
    recovery: NDArray[np.float64]
    fixed_frequency: NDArray[np.float64]
    left_out: NDArray[np.float64]
    limit: float
    part: Matrices
    stiffness: Any = 0.0
    mass: Any = 0.0
    eta: Any = 0.0

    @classmethod
    def from_matrices(
        cls,
        name: str,
        matrices: Matrices,
        mesh: Mesh,
        attachments: Sequence[Attachment],
        *,
        max_frequency: float | None = None,
        n_modes: int | None = None,
        held: bool = False,
        eta: float = 0.0,
    ) -> Self:
        """Reduce a part and tie it to points of a mesh.

        The interface nodes are replaced by the points they are tied to; everything else follows statically
        from the points (exact in statics, whatever is left out), plus the lowest modes with the points held.

        Parameters
        ----------
        name : str
            Name of the effect.
        matrices : Matrices
            The part, in SI units and in the mesh's axes (:meth:`Matrices.scaled`, :meth:`Matrices.placed`).
        mesh : Mesh
            Has the points.
        attachments : sequence of Attachment
        max_frequency : float, optional
            Fixed-interface modes up to this are kept [Hz]; twice the highest frequency of interest is a good
            choice, and :meth:`frequency_error` says what it costs.
        n_modes : int, optional
            Number of modes to keep instead. Without either all are kept, of parts with up to 600 coordinates.
        held : bool
            True if the part is held to the ground by itself. Otherwise six rigid-body motions must cost
            nothing; what is left of them after rounding in the file is removed.
        eta : float
            Loss factor of the part [-].

        Raises
        ------
        ModelError
            If the interface does not fit the part, the part is not free though ``held`` is false, has motions
            without stiffness when the points are held, or K or M is not positive semidefinite.

        Warns
        -----
        UserWarning
            If mass, size or place look like other units.
        """
        where = f"superelement '{name}'"
        _check_attachments(matrices, mesh, attachments, where)
        if not held:
            _check_free(matrices, where)
            _check_tied(matrices, attachments, where)
        _warn_of_units(matrices, mesh, attachments, where)
        G, n_b = _interface(matrices, mesh, attachments, where)
        K, M, C, D = (None if X is None else sp.csc_array(G.T @ X @ G) for X in _four(matrices))
        assert K is not None
        assert M is not None
        n_z = K.shape[0] - n_b
        if max_frequency is None and n_modes is None:
            if n_z > _DENSE:
                msg = (
                    f"{where}: the part has {n_z} coordinates inside; say how many modes to keep with "
                    "max_frequency= [Hz] or n_modes="
                )
                raise ModelError(msg)
            n_modes = n_z
        psi, modes, omega2, rest, following = _reduce(K, M, n_b, n_modes, max_frequency, where)
        T = np.zeros((K.shape[0], n_b + modes.shape[1]))
        T[:n_b, :n_b] = np.eye(n_b)
        T[n_b:, :n_b], T[n_b:, n_b:] = psi, modes
        small = [None if X is None else _even(T.T @ (X @ T)) for X in (K, M, C, D)]
        reduced_K, reduced_M = small[0], small[1]
        assert reduced_K is not None
        assert reduced_M is not None
        reduced_K[:n_b, n_b:] = reduced_K[n_b:, :n_b] = 0.0  # Ψ makes these vanish, but for rounding
        reduced_K[n_b:, n_b:] = np.diag(omega2)
        if not held:
            reduced_K[:n_b, :n_b] = _freed(
                reduced_K[:n_b, :n_b], K.diagonal()[:n_b], mesh, [a.point for a in attachments]
            )
        # rounding is relative to what the points' rows were before the inside followed them
        _check_definite(reduced_K, np.concatenate([K.diagonal()[:n_b], omega2]), "K", where)
        _check_definite(reduced_M, np.concatenate([M.diagonal()[:n_b], np.ones_like(omega2)]), "M", where)
        return cls(
            name=name,
            points=tuple(a.point for a in attachments),
            K=reduced_K,
            M=reduced_M,
            C=small[2],
            D=small[3],
            recovery=np.asarray(G @ T),
            fixed_frequency=np.sqrt(np.maximum(omega2, 0.0)) / (2 * np.pi),
            left_out=rest,
            limit=float(np.sqrt(following) / (2 * np.pi)),
            part=matrices,
            eta=eta,
        )

    @property
    def where(self) -> str:
        """The points that it is tied to."""
        return f"part {self.name} at point{'s' * (len(self.points) > 1)} {', '.join(map(str, self.points))}"

    @property
    def n_internal(self) -> int:
        """Number of fixed-interface modes."""
        return self.fixed_frequency.size

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the relative changes of stiffness and mass, and the loss factor."""
        return (
            Parameter("stiffness", "-", self.stiffness, 0.0, -0.8, 4.0, linear=True),
            Parameter("mass", "-", self.mass, 0.0, -0.8, 4.0, linear=True),
            Parameter("eta", "-", self.eta, 0.0, 0.0, 2.0),
        )

    def dofs(self, model: Model) -> NDArray[np.int64]:
        """Return the DOF numbers of its coordinates, shape (m,)."""
        return np.concatenate([dofs_of(self.points).ravel(), model.internal_dofs(self.name)])

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return (1 + stiffness) K, (1 + mass) M, C, and D + eta (1 + stiffness) K."""
        K = (1 + self.stiffness) * self.K
        D = self.D if self.D is not None else 0.0
        damped = self.D is not None or self.eta != 0
        return (
            Contribution(
                self.dofs(model)[None],
                K[None],
                ((1 + self.mass) * self.M)[None],
                None if self.C is None else self.C[None],
                (D + self.eta * K)[None] if damped else None,
            ),
        )

    def motion(self, model: Model, shapes: NDArray[Any]) -> NDArray[Any]:
        """Return the motion of the part's own rows, shape (n, k), for motions of the model (n_dof, k)."""
        return self.recovery @ shapes[self.dofs(model)]

    def frequency_error(
        self, model: Model, frequency: NDArray[np.float64], shapes: NDArray[Any]
    ) -> NDArray[Any]:
        """Return the relative errors of natural frequencies that come of the modes left out, shape (k,).

        A fixed-interface mode that was left out, with λ_k = ω_k² and participation p, would lower λ = ω² of a
        mode of the model by λ² (pᵀu)²/(λ_k - λ), to first order; u is the mode at the points. All of them
        together lower it by at most λ² uᵀ G u/(1 - λ/λ_limit), G = :attr:`left_out`. Half of that relative
        to λ is the error of the frequency, which is too high.

        Parameters
        ----------
        model : Model
        frequency : ndarray (k,)
            Natural frequencies of the model [Hz].
        shapes : ndarray (n_dof, k)
            Its mass-normalised mode shapes.

        Returns
        -------
        ndarray (k,)
            Infinite from ``limit`` on.
        """
        u = shapes[dofs_of(self.points).ravel()]
        omega2 = (2 * np.pi * np.asarray(frequency)) ** 2
        ratio = (np.asarray(frequency) / self.limit) ** 2
        change = omega2 * np.real(np.einsum("ik,ij,jk->k", u.conj(), self.left_out, u))
        return np.divide(change / 2, 1 - ratio, out=np.full_like(omega2, np.inf), where=ratio < 1)

    def locations(self, model: Model) -> NDArray[np.float64]:
        """Return the points."""
        return model.mesh.points[list(self.points)]


def _four(matrices: Matrices) -> tuple[Any, Any, Any, Any]:
    return matrices.K, matrices.M, matrices.C, matrices.D


def _even(X: NDArray[np.float64]) -> NDArray[np.float64]:
    return (X + X.T) / 2


# The interface ----------------------------------------------------------------------------------------------


def _check_attachments(matrices: Matrices, mesh: Mesh, attachments: Sequence[Attachment], where: str) -> None:
    if not attachments:
        msg = f"{where}: it is tied to no point; give attachments"
        raise ModelError(msg)
    seen: dict[int, int] = {}
    for a in attachments:
        if not 0 <= a.point < mesh.n_points:
            msg = f"{where}: point {a.point} is not in the mesh, which has points 0 to {mesh.n_points - 1}"
            raise ModelError(msg)
        for node in a.nodes:
            if node in seen:
                msg = (
                    f"{where}: node {node} is tied to the points {seen[node]} and {a.point}; a node has one "
                    "tie"
                )
                raise ModelError(msg)
            seen[node] = a.point
            try:
                rows = matrices.rows_of(node)
                matrices.place_of(node)
            except MatricesError as reason:
                msg = f"{where}: {reason}"
                raise ModelError(msg) from reason
            if (rows[:3] < 0).any():
                missing = ", ".join(axis for axis, row in zip("XYZ", rows, strict=False) if row < 0)
                msg = (
                    f"{where}: node {node} has no row for {missing}; interface nodes need three translations "
                    "(is it held in the part's own model?)"
                )
                raise ModelError(msg)


def _interface(
    matrices: Matrices, mesh: Mesh, attachments: Sequence[Attachment], where: str
) -> tuple[sp.csr_array, int]:
    """Return G with u_part = G (u_points, z), z all that is inside, and the number of rows of u_points."""
    taken = np.zeros(matrices.n, dtype=bool)
    blocks: list[tuple[NDArray[np.int64], int, NDArray[np.float64]]] = []
    n_b = 6 * len(attachments)
    n = n_b
    for k, a in enumerate(attachments):
        rows = np.array([matrices.rows_of(node) for node in a.nodes])
        T = np.vstack([lever_matrix(matrices.place_of(node) - mesh.points[a.point]) for node in a.nodes])
        have = rows.ravel() >= 0
        if a.tie == "average":
            have &= np.tile(np.arange(6) < 3, len(a.nodes))  # rotations of the nodes stay inside
        rows, T = rows.ravel()[have], T[have]
        taken[rows] = True
        blocks.append((rows, 6 * k, T))
        if a.tie == "rigid":
            continue
        w = np.repeat(np.asarray(a.weights or np.ones(len(a.nodes)), dtype=float), 3)
        arms = np.abs(T[:, 3:]).max()
        scale = np.array([1.0, 1.0, 1.0, *[1 / max(arms, 1e-300)] * 3])
        U, s, _ = np.linalg.svd(np.sqrt(w)[:, None] * T * scale, full_matrices=True)
        if len(rows) < 6 or s[5] < 1e-6 * s[0]:
            msg = (
                f"{where}: the {len(a.nodes)} nodes tied to point {a.point} do not say its rotation; an "
                "average needs three or more that do not lie in a line"
            )
            raise ModelError(msg)
        # u = T u_point + N α with W N = 0: the weighted average of what α moves is nothing
        N = U[:, 6:] / np.sqrt(w)[:, None]
        N, _ = np.linalg.qr(N)
        blocks.append((rows, n, N))
        n += N.shape[1]
    inside = np.flatnonzero(~taken)
    i, j, data = [inside], [n + np.arange(inside.size)], [np.ones(inside.size)]
    for rows, first, B in blocks:
        i.append(np.repeat(rows, B.shape[1]))
        j.append(np.tile(first + np.arange(B.shape[1]), len(rows)))
        data.append(B.ravel())
    index = (np.concatenate(i), np.concatenate(j))
    G = sp.coo_array((np.concatenate(data), index), shape=(matrices.n, n + inside.size))
    return G.tocsr(), n_b


# Reduction --------------------------------------------------------------------------------------------------


def _reduce(
    K: sp.csc_array, M: sp.csc_array, n_b: int, n_modes: int | None, max_frequency: float | None, where: str
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float]:
    """Reduce the inside to constraint modes and fixed-interface modes.

    Returns
    -------
    psi : ndarray (n_z, n_b)
        Constraint modes.
    modes : ndarray (n_z, k)
        Fixed-interface modes, M-normalised.
    omega2 : ndarray (k,)
        Their ω² [rad²/s²].
    rest : ndarray (n_b, n_b)
        Σ p pᵀ/ω² of those that were left out.
    following : float
        The lowest ω² left out.
    """
    n_z = K.shape[0] - n_b
    if n_z == 0:
        nothing = np.zeros((0, 0))
        return np.zeros((0, n_b)), nothing, np.zeros(0), np.zeros((n_b, n_b)), np.inf
    Kzz, Kzb = sp.csc_array(K[n_b:, n_b:]), K[n_b:, :n_b].toarray()
    Mzz, Mzb = sp.csc_array(M[n_b:, n_b:]), M[n_b:, :n_b].toarray()
    if Kzz.diagonal().min() <= 0:
        msg = f"{where}: K is not that of a part: it has {Kzz.diagonal().min():.3g} on its diagonal"
        raise ModelError(msg)
    scale = 1 / np.sqrt(Kzz.diagonal())
    S = sp.diags_array(scale)
    try:
        factor = factorise(S @ Kzz @ S)
    except SingularMatrixError as reason:
        raise ModelError(_loose(where)) from reason
    _check_held_inside(S @ Kzz @ S, factor, where)

    def solve(b: NDArray[np.float64]) -> NDArray[np.float64]:
        by_row = scale.reshape(-1, *([1] * (b.ndim - 1)))
        return by_row * factor.solve(by_row * b)

    psi = -solve(Kzb)
    if Mzz.diagonal().min() < 0:
        msg = f"{where}: M is not positive semidefinite: it has {Mzz.diagonal().min():.3g} on its diagonal"
        raise ModelError(msg)
    modes, omega2 = _fixed_modes(Kzz, Mzz, solve, n_modes, max_frequency)
    keep = len(omega2) - 1
    if max_frequency is not None and n_modes is None:
        keep = int((omega2 <= (2 * np.pi * max_frequency) ** 2).sum())
    elif n_modes is not None:
        keep = min(n_modes, len(omega2))
    following = float(omega2[keep]) if keep < len(omega2) else np.inf
    modes, omega2 = modes[:, :keep], omega2[:keep]
    P = Mzz @ psi + Mzb
    p = modes.T @ P
    rest = _even(P.T @ solve(P) - (p.T / omega2) @ p)
    if not np.isfinite(following):
        rest = np.zeros((n_b, n_b))
    return psi, modes, omega2, rest, following


def _fixed_modes(
    K: sp.csc_array, M: sp.csc_array, solve: Any, n_modes: int | None, max_frequency: float | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lowest modes with the points held, M-normalised, one more than is asked for if there is one.

    M may have no mass in some directions, which then have no mode.
    """
    n = K.shape[0]
    limit = -np.inf if max_frequency is None else (2 * np.pi * max_frequency) ** 2
    want = n_modes + 1 if n_modes is not None else 1
    if n > _DENSE and want <= n // 3:
        pairs = lowest_eigenpairs(solve, M, 0.0, want, limit)
        return pairs.vectors, pairs.eigenvalues
    scale = 1 / np.sqrt(K.diagonal())
    outer = np.outer(scale, scale)
    nu, vectors = sla.eigh(outer * M.toarray(), outer * K.toarray())
    order = np.argsort(-nu)
    order = order[nu[order] > 1e-13 * max(nu[-1], 0.0)]
    modes = scale[:, None] * vectors[:, order]
    return modes / np.sqrt(np.maximum(np.einsum("ij,ij->j", modes, M @ modes), 1e-300)), 1 / nu[order]


# Checks -----------------------------------------------------------------------------------------------------


def _check_free(matrices: Matrices, where: str) -> None:
    """Raise an error if a rigid-body motion of the part meets resistance."""
    try:
        R = matrices.rigid_motions()
    except MatricesError as reason:
        msg = f"{where}: {reason}"
        raise ModelError(msg) from reason
    R = R / np.array([1.0, 1.0, 1.0, *[max(matrices.size, 1e-300)] * 3])
    force = np.abs(matrices.K @ R).max(axis=0)
    terms = np.max(abs(matrices.K) @ np.abs(R), axis=0)
    resisted = np.divide(force, terms, out=np.zeros(6), where=terms > 0)
    if resisted.max() <= HELD:
        return
    names = ("x", "y", "z", "rx", "ry", "rz")
    energy = np.einsum("ij,ij->j", R, matrices.K @ R)
    inertia = np.einsum("ij,ij->j", R, matrices.M @ R)
    hertz = np.sqrt(np.maximum(energy, 0) / np.maximum(inertia, 1e-300)) / (2 * np.pi)
    words = [f"{names[k]} {resisted[k]:.1e} ({hertz[k]:.3g} Hz)" for k in np.flatnonzero(resisted > HELD)]
    msg = (
        f"{where}: the part is not free: rigid-body motions meet forces of {'; '.join(words)} of those "
        f"that its entries give one by one, where rounding leaves less than {HELD:g}. Nodes may be at other "
        "places than those the matrices were made with; if the part is held to the ground by itself, say "
        "held=True"
    )
    raise ModelError(msg)


def _check_tied(matrices: Matrices, attachments: Sequence[Attachment], where: str) -> None:
    """Raise an error if a piece of a free part is not tied, or the ties leave it free to turn."""
    order = np.argsort(matrices.node, kind="stable")
    same = np.flatnonzero(np.diff(matrices.node[order]) == 0)
    nodes = sp.coo_array((np.ones(same.size), (order[same], order[same + 1])), shape=matrices.K.shape)
    n_pieces, piece = connected_components(abs(matrices.K) + abs(matrices.M) + nodes, directed=False)
    R = matrices.rigid_motions() / np.array([1.0, 1.0, 1.0, *[max(matrices.size, 1e-300)] * 3])
    for k in range(n_pieces):
        held, tied = np.zeros((0, 6)), []
        for a in attachments:
            rows = np.concatenate([matrices.rows_of(node) for node in a.nodes])
            rows = rows[rows >= 0]
            rows = rows[piece[rows] == k]
            tied += [str(a.point)] * bool(rows.size)
            held = np.vstack([held, R[rows]])
        # six motions of a piece, or three of a single node without rotations
        want = np.linalg.matrix_rank(R[piece == k], tol=1e-9)
        if np.linalg.matrix_rank(held, tol=1e-6) < want:
            loose = np.unique(matrices.node[piece == k])
            words = (
                f"tied to point{'s' * (len(tied) > 1)} {', '.join(tied)} and free to turn"
                if tied
                else "not tied"
            )
            msg = (
                f"{where}: the part is in {n_pieces} piece{'s' * (n_pieces > 1)}, of which the one with "
                f"nodes {', '.join(str(n) for n in loose[:4])}{', …' * (loose.size > 4)} is {words}"
            )
            raise ModelError(msg)


def _loose(where: str) -> str:
    return f"{where}: with its points held, the part still has motions without stiffness; it is a mechanism"


def _check_held_inside(A: Any, factor: Factor, where: str) -> None:
    """Raise an error if the stiffness inside, scaled to a unit diagonal, is singular but for rounding."""
    x = np.random.default_rng(0).standard_normal(A.shape[0])
    for _ in range(3):
        x = factor.solve(x / np.linalg.norm(x))
    lowest = float(x @ (A @ x) / (x @ x)) if np.isfinite(x).all() else 0.0
    if abs(lowest) < 1e-14:
        raise ModelError(_loose(where))
    if lowest < 0 or (factor.backend == "multifrontal" and factor.count_negative()):
        msg = f"{where}: K is not positive semidefinite: with the points held it has negative eigenvalues"
        raise ModelError(msg)


def _freed(
    K: NDArray[np.float64], before: NDArray[np.float64], mesh: Mesh, points: Sequence[int]
) -> NDArray[np.float64]:
    """Return K of the points without what rounding in the file leaves to resist rigid-body motions.

    ``before`` is the diagonal of K before the inside followed the points: it scales metres and radians alike.
    """
    if len(points) == 1:
        return np.zeros_like(K)
    places = mesh.points[list(points)]
    R = np.vstack([lever_matrix(p) for p in places - places.mean(axis=0)])
    weight = np.sqrt(before)
    Q, _ = np.linalg.qr(weight[:, None] * R)
    P = np.eye(len(K)) - Q @ Q.T
    return _even(weight[:, None] * (P @ (K / np.outer(weight, weight)) @ P) * weight)


def _check_definite(X: NDArray[np.float64], diagonal: NDArray[np.float64], name: str, where: str) -> None:
    """Raise an error if a reduced matrix, scaled by a diagonal, has eigenvalues below 0 but for rounding."""
    scale = np.sqrt(np.maximum(diagonal, 1e-14 * np.abs(diagonal).max(initial=1e-300)))
    lowest = float(np.linalg.eigvalsh(X / np.outer(scale, scale))[0])
    if diagonal.min(initial=0.0) < 0 or lowest < -HELD:
        msg = (
            f"{where}: {name} is not positive semidefinite: reduced and scaled to a unit diagonal it has the "
            f"eigenvalue {lowest:.3g}"
        )
        raise ModelError(msg)


def _warn_of_units(matrices: Matrices, mesh: Mesh, attachments: Sequence[Attachment], where: str) -> None:
    moved = np.where(matrices.direction == 1, 1.0, 0.0)
    mass = float(moved @ (matrices.M @ moved))
    size = matrices.size
    sides = np.maximum(np.ptp(matrices.points, axis=0), 1e-3 * size)
    # a line of nodes has no volume: what is too heavy is judged by a cube, what is too light by the box
    light, heavy = mass / max(float(np.prod(sides)), 1e-300), mass / max(size, 1e-300) ** 3
    if len(matrices.points) > 1 and (light < _DENSITY[0] or heavy > _DENSITY[1]):
        odd = light if light < _DENSITY[0] else heavy
        box = " x ".join(f"{s:.3g}" for s in np.ptp(matrices.points, axis=0))
        warnings.warn(
            f"{where}: {mass:.3g} kg in a box of {box} m is {odd:.2g} kg/m³, "
            "which no part has; units='mm-t-s' and others are for files that are not in SI",
            stacklevel=3,
        )
    for a in attachments:
        middle = np.mean([matrices.place_of(node) for node in a.nodes], axis=0)
        gap = float(np.linalg.norm(middle - mesh.points[a.point]))
        if gap > 2 * max(size, mesh.size):
            warnings.warn(
                f"{where}: point {a.point} lies {gap:.3g} m from the middle of its nodes, the part is "
                f"{size:.3g} m and the mesh {mesh.size:.3g} m large; it may be elsewhere or in other units",
                stacklevel=3,
            )
