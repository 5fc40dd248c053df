"""A part from another program, which joins the frame as one element with the part's K and M."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
from numpy.typing import NDArray

from fem.array_types import Floats, Ints
from fem.declarations import Internal, Role, Site
from fem.elements.part_faces import PartFaces
from fem.elements.part_ties import (
    FREE_RESISTANCE,
    Attachment,
    check_attachments,
    check_free,
    check_tied,
    inner_places,
    interface_map,
    warn_of_units,
)
from fem.linalg.lanczos import lowest_eigenpairs
from fem.linalg.solvers import Factor, SingularMatrixError, factorise
from fem.matrices import Matrices
from fem.mesh import Mesh
from fem.model import DIRECTIONS, Contribution, Effect, Model, ModelError, Parameter, dofs_of, lever_matrix


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Superelement(Effect):
    """A part given by its matrices, reduced to its points and to modes with these points fixed.

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
        From these coordinates to the rows of the part's matrices.
    fixed_frequency : ndarray (n_internal,)
        Natural frequencies with the points fixed [Hz].
    left_out : ndarray (6 · len(points), 6 · len(points))
        G = Σ p pᵀ/ω² over the fixed-interface modes that were left out, p their participation φᵀ(M Ψ + M_zb);
        see :meth:`frequency_error` [kg s² …].
    order : int
        Power of ω² that the error of :attr:`left_out` goes with: 1, or 3 with residual modes.
    limit : float
        Lowest natural frequency that was left out [Hz]; infinite if none was.
    reach : float
        Median over the attachments of the distance of their nodes from their point [m].
    part : Matrices
        The part itself, with its nodes and their places.
    faces : PartFaces or None
        Its outer surface, for pictures (:func:`fem.io.meshio_mesh.read_part_faces`).
    stiffness, mass : float
        Relative changes of K and M [-].
    eta : float
        Loss factor: D gains ``eta`` · K [-].
    n_uncertain : int
        Number of its lowest fixed-interface modes whose eigenvalues ω² may differ from those of the matrices;
        each then has a parameter ``mode1``, ``mode2`` … Statics and mode shapes stay as they are.
    deviations : mapping of str to float
        Relative changes of these eigenvalues that are not zero [-].
    """

    kind: ClassVar[str] = "superelement"
    role: ClassVar[Role] = Role.STIFFNESS | Role.MASS | Role.DISSIPATION
    reduced_part: ClassVar[bool] = True
    points: tuple[int, ...]
    K: Floats
    M: Floats
    C: Floats | None = None
    D: Floats | None = None
    recovery: Floats
    fixed_frequency: Floats
    left_out: Floats
    limit: float
    part: Matrices
    order: int = 1
    reach: float = 0.0
    faces: PartFaces | None = None
    stiffness: Any = 0.0
    mass: Any = 0.0
    eta: Any = 0.0
    n_uncertain: int = 0
    deviations: Mapping[str, Any] = field(default_factory=dict)

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
        residual: bool = False,
        faces: PartFaces | None = None,
    ) -> Self:
        """Reduce a part and tie it to points of a mesh.

        The interface nodes are replaced by the points they are tied to; everything else follows statically
        from the points (exact in statics with any number of modes), plus the lowest modes with the points
        fixed.

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
            choice; :meth:`frequency_error` gives its error.
        n_modes : int, optional
            Number of modes to keep instead. Without either all are kept, of parts with up to 600 coordinates.
        held : bool
            True if the part is held to the ground by itself. Otherwise six rigid-body motions must cost
            no energy; the resistance that rounding in the file leaves is removed.
        eta : float
            Loss factor of the part [-].
        residual : bool
            Whether static responses to the inertia of the constraint modes are added, up to six for each
            attachment; the error then goes with the sixth power of the frequency rather than the second.
        faces : PartFaces, optional
            Its outer surface, which pictures show.

        Raises
        ------
        ModelError
            If the interface does not fit the part, the part is not free though ``held`` is false, has motions
            without stiffness when the points are fixed, or K or M is not positive semidefinite.

        Warns
        -----
        UserWarning
            If mass, size or place look like other units.
        """
        where = f"superelement '{name}'"
        check_attachments(matrices, mesh, attachments, where)
        if not held:
            check_free(matrices, where)
            check_tied(matrices, attachments, where)
        warn_of_units(matrices, mesh, attachments, where)
        G, n_b = interface_map(matrices, mesh, attachments, where)
        four = matrices.K, matrices.M, matrices.C, matrices.D
        K, M, C, D = (None if X is None else sp.csc_array(G.T @ X @ G) for X in four)
        assert K is not None
        assert M is not None
        n_z = K.shape[0] - n_b
        if max_frequency is None and n_modes is None:
            if n_z > DENSE:
                msg = (
                    f"{where}: the part has {n_z} coordinates inside; say how many modes to keep with "
                    "max_frequency= [Hz] or n_modes="
                )
                raise ModelError(msg)
            n_modes = n_z
        psi, modes, omega2, rest, following = reduce_inside(
            K, M, n_b, n_modes, max_frequency, where, residual, inner_places(matrices, G, n_b)
        )
        T = np.zeros((K.shape[0], n_b + modes.shape[1]))
        T[:n_b, :n_b] = np.eye(n_b)
        T[n_b:, :n_b], T[n_b:, n_b:] = psi, modes
        small = [None if X is None else symmetrised(T.T @ (X @ T)) for X in (K, M, C, D)]
        reduced_K, reduced_M = small[0], small[1]
        assert reduced_K is not None
        assert reduced_M is not None
        reduced_K[:n_b, n_b:] = reduced_K[n_b:, :n_b] = 0.0  # Ψ makes these vanish, but for rounding
        reduced_K[n_b:, n_b:] = np.diag(omega2)
        if not held:
            reduced_K[:n_b, :n_b] = without_rigid_resistance(
                reduced_K[:n_b, :n_b], K.diagonal()[:n_b], mesh, [a.point for a in attachments]
            )
        # rounding is relative to the points' rows before the inside followed them
        check_definite(reduced_K, np.concatenate([K.diagonal()[:n_b], omega2]), "K", where)
        check_definite(reduced_M, np.concatenate([M.diagonal()[:n_b], np.ones_like(omega2)]), "M", where)
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
            order=3 if residual else 1,
            reach=float(np.median([a.reach(matrices, mesh) for a in attachments])),
            faces=faces,
            eta=eta,
        )

    @property
    def where(self) -> Site:
        """The points that it is tied to."""
        return Site(
            f"part {self.name} at point{'s' * (len(self.points) > 1)} {', '.join(map(str, self.points))}"
        )

    @property
    def weight(self) -> float:
        """Mass of the part [kg]: that of a translation along x."""
        moved = np.where(self.part.direction == 1, 1.0, 0.0)
        return float(moved @ (self.part.M @ moved))

    def point_stiffness(self, direction: str) -> float:
        """Return the median over its points of the stiffness in a direction with all others fixed."""
        d = self.K.diagonal()[: 6 * len(self.points)].reshape(-1, 6)[:, DIRECTIONS.index(direction)]
        return float(np.median(d[d > 0])) if (d > 0).any() else 0.0

    @property
    def n_internal(self) -> int:
        """Number of fixed-interface modes."""
        return self.fixed_frequency.size

    @property
    def internal(self) -> Internal:
        """Its fixed-interface modes."""
        return Internal(self.n_internal)

    def n_modes_below(self, frequency: float) -> int:
        """Return the number of fixed-interface modes below a frequency [Hz], no static responses counted."""
        return int((self.fixed_frequency < min(frequency, self.limit)).sum())

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the relative changes of stiffness and mass, the loss factor, and changes of eigenvalues."""
        modes = (f"mode{k + 1}" for k in range(self.n_uncertain))
        return (
            Parameter("stiffness", "-", self.stiffness, 0.0, -0.8, 4.0, linear=True),
            Parameter("mass", "-", self.mass, 0.0, -0.8, 4.0, linear=True),
            Parameter("eta", "-", self.eta, 0.0, 0.0, 2.0),
            *(Parameter(m, "-", self.deviations.get(m, 0.0), 0.0, -0.6, 1.5, linear=True) for m in modes),
        )

    def with_values(self, **values: Any) -> Self:
        """Return the part with other values; those of modes are kept as deviations."""
        modes = {name: values.pop(name) for name in list(values) if name.startswith("mode")}
        return replace(self, deviations={**self.deviations, **modes}, **values)

    def dofs(self, model: Model) -> Ints:
        """Return the DOF numbers of its coordinates, shape (m,)."""
        return np.concatenate([dofs_of(self.points).ravel(), model.internal_dofs(self.name)])

    def contribute(self, model: Model) -> tuple[Contribution, ...]:
        """Return K' = (1 + stiffness) K + Σ deviation ω² of modes, (1 + mass) M, C, and D + eta K'."""
        K = (1 + self.stiffness) * self.K
        if self.deviations:
            n_b = 6 * len(self.points)
            change = np.zeros(len(self.K), dtype=np.result_type(*map(np.asarray, self.deviations.values())))
            for name, deviation in self.deviations.items():
                row = n_b + int(name.removeprefix("mode")) - 1
                change[row] = deviation * self.K[row, row]
            K = K + np.diag(change)
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
        """Return the motion of the part's rows, shape (n, k), for motions of the model (n_dof, k)."""
        return self.recovery @ shapes[self.dofs(model)]

    def frequency_error(self, model: Model, frequency: Floats, shapes: NDArray[Any]) -> NDArray[Any]:
        """Return the relative errors of natural frequencies that come of the modes left out, shape (k,).

        A fixed-interface mode that was left out, with λ_k = ω_k² and participation p, would lower λ = ω² of a
        mode of the model by λ² (pᵀu)²/(λ_k - λ), to first order; u is the mode at the points. All of them
        together lower it by at most λ² uᵀ G u/(1 - λ/λ_limit), G = :attr:`left_out`. Half of that relative
        to λ is the error of the frequency, which is too high. With residual modes the terms in λ and λ² of
        1/(λ_k - λ) are exact, and λ⁴ takes the place of λ²; it is an estimate then, good to a factor of 2.

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
        change = omega2**self.order * np.real(np.einsum("ik,ij,jk->k", u.conj(), self.left_out, u))
        return np.divide(change / 2, 1 - ratio, out=np.full_like(omega2, np.inf), where=ratio < 1)

    def locations(self, model: Model) -> Floats:
        """Return the points."""
        return model.mesh.points[list(self.points)]


# Reduction of a part to its points and to modes with these points fixed (Craig & Bampton 1968) --------------


DENSE = 600
"""Parts with at most this many coordinates inside are solved densely."""


def reduce_inside(
    K: sp.csc_array,
    M: sp.csc_array,
    n_b: int,
    n_modes: int | None,
    max_frequency: float | None,
    where: str,
    residual: bool = False,
    places: Floats | None = None,
) -> tuple[Floats, Floats, Floats, Floats, float]:
    """Reduce the inside to constraint modes and fixed-interface modes.

    With ``residual`` the static response X = K⁻¹ P to the inertia P of the constraint modes, as far as the
    modes that are kept do not have it, joins them as further modes: the terms in λ and λ² of what was left
    out are then exact (Dickens, Nakagawa, Wittbrodt, Computers & Structures 62, 1997, 985-998).

    ``places`` (n_z, 3) are those of the coordinates inside [m], for a faster factorisation.

    Returns
    -------
    psi : ndarray (n_z, n_b)
        Constraint modes.
    modes : ndarray (n_z, k)
        Fixed-interface modes, M-normalised.
    omega2 : ndarray (k,)
        Their ω² [rad²/s²].
    rest : ndarray (n_b, n_b)
        Σ p pᵀ/ω² of those that were left out; with ``residual`` what is missing of Σ p pᵀ/ω⁶.
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
        factor = factorise(S @ Kzz @ S, places=places)
    except SingularMatrixError as reason:
        raise ModelError(_mechanism(where)) from reason
    _check_fixed_inside(S @ Kzz @ S, factor, where)

    def solve(b: Floats) -> Floats:
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
    if not np.isfinite(following):
        return psi, modes, omega2, np.zeros((n_b, n_b)), following
    static = solve(P)
    rest = symmetrised(P.T @ static - (p.T / omega2) @ p)
    if residual:
        more, higher = _residual_modes(static - modes @ (p / omega2[:, None]), rest, Mzz)
        inertia = Mzz @ (more @ ((more.T @ P) / higher[:, None]))
        W = solve(inertia) - more @ ((more.T @ inertia) / higher[:, None])
        rest = symmetrised(W.T @ (Kzz @ W))
        modes, omega2 = np.hstack([modes, more]), np.concatenate([omega2, higher])
    return psi, modes, omega2, rest, following


def _residual_modes(X: Floats, K: Floats, M: sp.csc_array) -> tuple[Floats, Floats]:
    """Return M-normalised combinations of vectors X (n_z, n_b) that do not couple, and their ω².

    ``K`` (n_b, n_b) is their stiffness.
    """
    there = K.diagonal() > 1e-12 * K.diagonal().max(initial=0.0)
    scale = 1 / np.sqrt(K.diagonal()[there])
    X, K = X[:, there] * scale, np.outer(scale, scale) * K[np.ix_(there, there)]
    strength, V = np.linalg.eigh(K)
    strong = strength > 1e-9 * strength.max(initial=0.0)
    V = V[:, strong] / np.sqrt(strength[strong])
    X = X @ V  # of unit stiffness now, so that the eigenvalues of M are 1/ω²
    nu, V = np.linalg.eigh(symmetrised(X.T @ (M @ X)))
    keep = np.flatnonzero(nu > 1e-9 * nu.max(initial=0.0))[::-1]
    return X @ V[:, keep] / np.sqrt(nu[keep]), 1 / nu[keep]


def _fixed_modes(
    K: sp.csc_array, M: sp.csc_array, solve: Any, n_modes: int | None, max_frequency: float | None
) -> tuple[Floats, Floats]:
    """Return the lowest modes with fixed points, M-normalised; one more than is asked for if there is one.

    M may have no mass in some directions, which then have no mode.
    """
    n = K.shape[0]
    limit = -np.inf if max_frequency is None else (2 * np.pi * max_frequency) ** 2
    want = n_modes + 1 if n_modes is not None else 1
    if n > DENSE and want <= n // 3:
        pairs = lowest_eigenpairs(solve, M, 0.0, want, limit)
        return pairs.vectors, pairs.eigenvalues
    scale = 1 / np.sqrt(K.diagonal())
    outer = np.outer(scale, scale)
    nu, vectors = sla.eigh(outer * M.toarray(), outer * K.toarray())
    order = np.argsort(-nu)
    order = order[nu[order] > 1e-13 * max(nu[-1], 0.0)]
    modes = scale[:, None] * vectors[:, order]
    return modes / np.sqrt(np.maximum(np.einsum("ij,ij->j", modes, M @ modes), 1e-300)), 1 / nu[order]


def _mechanism(where: str) -> str:
    return f"{where}: with its points fixed, the part still has motions without stiffness; it is a mechanism"


def _check_fixed_inside(A: Any, factor: Factor, where: str) -> None:
    """Raise an error if the stiffness inside, scaled to a unit diagonal, is singular but for rounding."""
    x = np.random.default_rng(0).standard_normal(A.shape[0])
    for _ in range(3):
        x = factor.solve(x / np.linalg.norm(x))
    lowest = float(x @ (A @ x) / (x @ x)) if np.isfinite(x).all() else 0.0
    if abs(lowest) < 1e-14:
        raise ModelError(_mechanism(where))
    if lowest < 0 or (factor.backend == "multifrontal" and factor.count_negative()):
        msg = f"{where}: K is not positive semidefinite: with the points fixed it has negative eigenvalues"
        raise ModelError(msg)


def without_rigid_resistance(K: Floats, before: Floats, mesh: Mesh, points: Sequence[int]) -> Floats:
    """Return K of the points without the resistance to rigid-body motions that rounding in the file leaves.

    ``before`` is the diagonal of K before the inside followed the points: it scales metres and radians alike.
    """
    if len(points) == 1:
        return np.zeros_like(K)
    places = mesh.points[list(points)]
    R = lever_matrix(places - places.mean(axis=0)).reshape(-1, 6)
    there = before > 0  # a point that is tied to a single node turns freely
    weight = np.sqrt(before[there])
    Q, _ = np.linalg.qr(weight[:, None] * R[there])
    P = np.eye(len(weight)) - Q @ Q.T
    out, inner = np.zeros_like(K), np.ix_(there, there)
    out[inner] = symmetrised(weight[:, None] * (P @ (K[inner] / np.outer(weight, weight)) @ P) * weight)
    return out


def check_definite(X: Floats, diagonal: Floats, name: str, where: str) -> None:
    """Raise an error if a reduced matrix, scaled by a diagonal, has eigenvalues below 0 beyond rounding."""
    scale = np.sqrt(np.maximum(diagonal, 1e-14 * np.abs(diagonal).max(initial=1e-300)))
    lowest = float(np.linalg.eigvalsh(X / np.outer(scale, scale))[0])
    if diagonal.min(initial=0.0) < 0 or lowest < -FREE_RESISTANCE:
        msg = (
            f"{where}: {name} is not positive semidefinite: reduced and scaled to a unit diagonal it has the "
            f"eigenvalue {lowest:.3g}"
        )
        raise ModelError(msg)


def symmetrised(X: Floats) -> Floats:
    """Return the symmetric part of a matrix."""
    return (X + X.T) / 2
