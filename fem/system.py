"""Assembly: from a model to K, M, C and D on the independent coordinates."""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from fem.array_types import Bools, Complexes, Floats, Ints
from fem.elements.frame import Frame
from fem.mesh import Mesh
from fem.model import DIRECTIONS, Constraint, Contribution, Law, Model, ModelError
from fem.summary import summary

_ROUNDING = 1e-9
"""Relative size below which the resistance to a rigid-body motion is rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class System:
    """Matrices of a model on coordinates q with u = Q q.

    Z(ω) = K + iD + iωC - ω²M + Σ (storage(ω) - storage(0) + i loss(ω)) K_law.

    Attributes
    ----------
    K, M, C, D : sparse (n_free, n_free)
        Stiffness [N/m …], with that of frequency-dependent elements at ω = 0; mass [kg …], viscous damping,
        structural damping of local effects.
    Q : sparse (n_dof, n_free)
        From the independent coordinates to all DOFs; orthonormal columns.
    rigid : ndarray (n_free, n_rigid)
        Rigid-body motions that constraints and springs allow, not normalised.
    model : Model
        Where they come from; its ``damping`` is that of the structure and not in C and D.
    laws : tuple of (Law, sparse (n_free, n_free))
        Frequency-dependent elements: each law and the K_law that it multiplies.
    """

    K: sp.csc_array
    M: sp.csc_array
    C: sp.csc_array
    D: sp.csc_array
    Q: sp.csr_array
    rigid: Floats
    model: Model
    laws: tuple[tuple[Law, sp.csc_array], ...] = ()

    def __repr__(self) -> str:
        """Return the number of degrees of freedom on one line."""
        free, every = self.K.shape[0], self.Q.shape[0]
        return summary(self, f"{free} free of {every} DOFs, {self.K.nnz} entries of K")

    @property
    def reciprocal(self) -> bool:
        """Whether all matrices are symmetric."""
        return all(effect.reciprocal for effect in self.model.effects)

    @property
    def n_free(self) -> int:
        """Number of independent coordinates."""
        return self.K.shape[0]

    def dynamic_stiffness(self, omega: float) -> sp.csc_array:
        """Return Z(ω) with the structure's Rayleigh and structural damping, sparse (n_free, n_free).

        Modal damping ratios have no matrix and are left out.

        Parameters
        ----------
        omega : float
            Angular frequency [rad/s].
        """
        damping = self.model.damping
        stiffness = 1 + 1j * (damping.loss_factor + omega * damping.beta)
        Z = stiffness * self.K + 1j * (self.D + omega * self.C)
        Z = Z + (1j * omega * damping.alpha - omega**2) * self.M
        for law, K in self.laws:
            Z = Z + law_change(law, np.array([omega]))[0] * K
        return sp.csc_array(Z)


def assemble(model: Model, *, reciprocal: bool = True) -> System:
    """Assemble a model's matrices and apply its constraints.

    Constraints Σ c u = 0 are applied exactly: for each set of constraints that share DOFs an orthonormal
    basis of their null space becomes columns of Q.

    Parameters
    ----------
    model : Model
    reciprocal : bool
        False allows effects whose C is not symmetric, such as rotors. Then
        :func:`fem.analysis.frf_solver.compute_frf` by the direct method, and undamped modes, which do not see
        C, are right; all other analyses rely on symmetry.

    Raises
    ------
    ModelError
        If a matrix is not finite, a point has neither stiffness nor mass, or an effect is not reciprocal
        though all should be.
    """
    if reciprocal:
        refuse_unsymmetric(model)
    full, laws = _full_matrices(model.mesh, model.n_dof, model.batches())
    for name, X in full.items():
        if not np.isfinite(X.data).all():
            msg = f"the matrix {name} of the model has entries that are not finite numbers"
            raise ModelError(msg)
    constraints = model.constraints()
    Q = null_space(constraints, model.n_dof)
    Q = _without_idle_turns(model, Q, full["K"], full["M"])
    free = _selection(Q)
    K, M, C, D = (_on_q(full.pop(key), Q, free) for key in "KMCD")
    idle = _idle(model, Q, np.flatnonzero((np.diff(K.indptr) == 0) & (np.diff(M.indptr) == 0)))
    if idle.size:
        keep = np.setdiff1d(np.arange(Q.shape[1]), idle)
        Q, K, M, C, D = Q[:, keep], *(sp.csc_array(X[keep][:, keep]) for X in (K, M, C, D))
    on_q = tuple((law, sp.csc_array(Q.T @ X @ Q)) for law, X in laws)
    return System(K, M, C, D, Q, _allowed(model, Q, constraints), model, on_q)


def mass_forces(system: System, shapes: Floats) -> Floats:
    """Return Mφ / φᵀMφ (n_dof, n) of motions φ (n_dof, n) that the constraints allow [1/m]."""
    forces = np.asarray(system.Q @ (system.M @ (system.Q.T @ shapes)))
    return forces / (shapes * forces).sum(axis=0)


def refuse_motionless(system: System) -> None:
    """Raise a ModelError if constraints hold every point: loads on members still have reactions, no more."""
    if system.n_free == 0:
        msg = (
            "the supports and rigid joints leave no motion at all: every point of the mesh is held, and only "
            "points between them could vibrate; divide the members (elements, or mesh.refined)"
        )
        raise ModelError(msg)


def refuse_unsymmetric(model: Model) -> None:
    """Raise a ModelError if an effect of a model is not reciprocal."""
    for effect in model.effects:
        if not effect.reciprocal:
            msg = (
                f"'{effect.name}' is a {effect.kind}, whose matrices are not symmetric; this solver takes "
                "symmetric ones only: leave it out, or compute FRFs with assemble(model, reciprocal=False)"
            )
            raise ModelError(msg)


def reassemble(system: System, model: Model) -> System:
    """Assemble a model that shares most effects with the system's model, faster than :func:`assemble`.

    Effects that are the same objects are not formed again where nothing else is new. New moduli and
    densities of a frame scale its matrices, if all its lines have the same factor, or form those lines again
    that have others. The result differs from that of `assemble` by rounding of the old and the new entries.
    Another mesh, other constraints, frequency-dependent elements or internal coordinates among the
    changes, and effects on rotations that were left out, take it to `assemble`.

    Parameters
    ----------
    system : System
    model : Model
        On the same mesh as ``system.model``; made from it by `with_values`, `with_effect`, ….
    """
    was, kept = system.model, {id(e) for e in model.effects} & {id(e) for e in system.model.effects}
    removed = [e for e in was.effects if id(e) not in kept]
    new = [e for e in model.effects if id(e) not in kept]
    frames = [e for e in (*removed, *new) if isinstance(e, Frame)]
    change = frames[0].change_to(frames[1], model.mesh) if len(frames) == 2 else None
    others = [e for e in (*removed, *new) if not isinstance(e, Frame)]
    if (
        model.mesh is not was.mesh
        or system.laws
        or any(e.internal.n for e in model.effects)
        or any(e.released() or e.constraints(model) for e in others)
        or (frames and change is None)
    ):
        return assemble(model)
    scale: dict[str, float] = dict.fromkeys("KMCD", 1.0)
    lines: Iterable[Contribution] = ()
    if change is not None:
        # effects on a frame may depend on it: all of them are formed anew
        removed, new = ([e for e in m.effects if not isinstance(e, Frame)] for m in (was, model))
        scale |= change.scale
        lines = change.batches
    else:
        changed = {e.name for e in (*removed, *new)}
        # what gives way refers to all that alters its element, and may refer to more or less than before
        follow = {
            e.name
            for m in (was, model)
            for e in m.effects
            if any(name in changed for name, _ in e.refers_to(m))
        }
        removed, new = ([e for e in m.effects if id(e) not in kept or e.name in follow] for m in (was, model))
    before = [c for e in removed for c in was.parts_of(e)]
    after = [c for e in new for c in model.parts_of(e)]
    constraints = model.constraints()
    dropped = _dropped_dofs(system.Q, constraints)
    if any(c.law is not None or dropped[c.dofs].any() for c in after):
        return assemble(model)
    if change is not None:
        before += change.constant
        after += change.constant
    parts = [_scaled(c, {key: -factor for key, factor in scale.items()}) for c in before] + after
    differences, _ = _full_matrices(model.mesh, model.n_dof, itertools.chain(parts, lines))
    free = _selection(system.Q)
    matrices = {}
    for key, D in differences.items():
        X = getattr(system, key)
        X = X if scale[key] == 1.0 else scale[key] * X
        D.eliminate_zeros()
        matrices[key] = X + _on_q(D, system.Q, free) if D.nnz else X
        if not np.isfinite(matrices[key].data).all():
            msg = f"the matrix {key} of the model has entries that are not finite numbers"
            raise ModelError(msg)
    return replace(system, **matrices, rigid=_allowed(model, system.Q, constraints), model=model)


def _scaled(part: Contribution, factor: Mapping[str, float]) -> Contribution:
    """Return matrices times factors."""
    scaled = {key: getattr(part, key) for key in "KMCD"}
    return replace(part, **{key: None if X is None else factor[key] * X for key, X in scaled.items()})


def _dropped_dofs(Q: Any, constraints: Sequence[Constraint]) -> Bools:
    """Return the DOFs that Q leaves out, wholly or in part, though no constraint holds them, (n_dof,)."""
    idle = np.diff(Q.indptr) == 0
    if _selection(Q) is None:
        idle = np.asarray(Q.multiply(Q).sum(axis=1)).ravel() < 1 - 1e-9
    if constraints:
        idle[np.concatenate([c.dofs for c in constraints])] = False
    return idle


def law_change(law: Law, omega: Floats) -> Complexes:
    """Return storage(ω) - storage(0) + i loss(ω), shape (n,): the change of the static stiffness by a law."""
    storage, loss = law(omega)
    return storage - law(np.zeros(1))[0][0] + 1j * loss


def _without_idle_turns(model: Model, Q: Any, K: Any, M: Any) -> Any:
    """Return Q without rotations of a point about an axis that nothing there resists, nor has inertia about.

    Where all ends that meet are released, their torsion alone holds the point, and the axis may lie anywhere.
    """
    ends = [
        model.mesh.lines[rows[k], k]
        for frame in model.of_kind(Frame)
        for member, rows in model.mesh.members.items()
        for k, free in ((0, frame.members[member].release1), (-1, frame.members[member].release2))
        if free
    ]
    columns = np.arange(Q.shape[1])
    blocks, at = [], []
    for point in np.unique(np.array(ends, dtype=np.int64)):
        turns = 6 * int(point) + np.arange(3, 6)
        here = Q[turns]
        if here.nnz != 3 or not (here.data == 1.0).all():
            continue  # a constraint has taken part of them
        stiffness, inertia = (X.tocsr()[turns].toarray() for X in (K, M))
        values, axes = np.linalg.eigh(stiffness[:, turns])
        idle = values <= 1e-12 * values[-1]
        for X in (stiffness, inertia):
            idle &= np.abs(X.T @ axes).max(axis=0) <= 1e-12 * np.abs(X).max()
        if 0 < idle.sum() < 3:
            blocks.append(axes[:, ~idle])
            at.append(here.indices)
    if not blocks:
        return Q
    kept = np.setdiff1d(columns, np.concatenate(at))
    same = sp.coo_array((np.ones(kept.size), (kept, np.arange(kept.size))), shape=(columns.size, kept.size))
    turned = [
        sp.coo_array(
            (V.ravel(), (np.repeat(i, V.shape[1]), np.tile(np.arange(V.shape[1]), 3))),
            shape=(columns.size, V.shape[1]),
        )
        for i, V in zip(at, blocks, strict=True)
    ]
    Q = sp.csr_array(Q @ sp.hstack([same, *turned]))
    return Q[:, np.argsort(_leading(Q), kind="stable")]


def _idle(model: Model, Q: Any, empty: Ints) -> Ints:
    """Return the coordinates without stiffness and mass: rotations where nothing but bars and cables meet.

    Rotations of points that stand for one node of a solid part are others; the rest is an error.
    """
    on_lines = np.zeros(model.n_dof, dtype=bool)
    tied = [e.points for e in model.effects if e.reduced_part]  # type: ignore[attr-defined]
    points = np.unique(np.concatenate([model.mesh.lines.ravel(), *tied]).astype(np.int64))
    on_lines[: 6 * model.mesh.n_points].reshape(-1, 6)[points, 3:] = True
    dofs = np.asarray(abs(Q[:, empty]).argmax(axis=0)).ravel()
    bad = dofs[~on_lines[dofs]]
    if bad.size:
        msg = (
            f"point {bad[0] // 6} of the mesh has neither stiffness nor mass in {DIRECTIONS[bad[0] % 6]}; "
            "leave it out of the mesh, or tie it with a line or a joint"
        )
        raise ModelError(msg)
    return empty


def rigid_motions(model: Model) -> Floats:
    """Return the six rigid-body motions about the mesh's centre, shape (n_dof, 6).

    Rotations are divided by the mesh's size, of one point by 1; internal coordinates of effects stay at rest,
    but for those of a moving ground.
    """
    points = model.mesh.points
    motions = np.zeros((model.n_dof, 6))
    arm = points - points.mean(axis=0)
    at = motions[: 6 * len(points)].reshape(-1, 6, 6)
    at[:] = np.eye(6)
    at[:, 0, 4], at[:, 0, 5], at[:, 1, 5] = arm[:, 2], -arm[:, 1], arm[:, 0]
    at[:, 1, 3], at[:, 2, 3], at[:, 2, 4] = -arm[:, 2], arm[:, 1], -arm[:, 0]
    motions[:, 3:] /= model.mesh.size or 1.0
    ground = model.ground
    if ground is not None:
        motions[ground.dofs, :3] = ground.translated(np.eye(3))
    return motions


def resistance(
    contributions: Iterable[Contribution], motions: Floats, size: float, rounding: float
) -> Floats:
    """Return the forces, as rows (n_rows, n), with which elements oppose motions.

    The motions (n_dof, n) are those of a structure of a size [m]. The forces of an element are judged by
    themselves, against the forces that its entries would give one by one in a motion of 1 and a rotation of
    1/size, and left out below ``rounding`` of these: a spring to ground counts, however soft it is
    relative to the members.
    """
    rows = [np.zeros((0, motions.shape[1]))]
    amplitude = np.repeat([1.0, 1 / (size or 1.0)], 3)
    for part in contributions:
        K = part.static
        if K is None:
            continue
        at = motions[part.dofs]
        terms = np.abs(K) @ amplitude[part.dofs % 6][:, :, None]
        force = np.divide(K @ at, terms, out=np.zeros_like(at), where=terms > 0)
        force = force.reshape(-1, motions.shape[1])
        rows.append(force[np.abs(force).max(axis=1) > rounding])
    return np.vstack(rows)


def unopposed(rows: Floats, tolerance: float) -> Floats:
    """Return the combinations (n, k) of motions that every row (n_rows, n) leaves below a tolerance."""
    n = rows.shape[1]
    _, s, Vt = np.linalg.svd(np.linalg.qr(np.vstack([rows, np.zeros((n, n))]), mode="r"))
    return Vt[s < tolerance].T


def reproduced(model: Model, Q: Any, constraints: Sequence[Constraint]) -> Floats:
    """Return the combinations (6, n) of rigid-body motions that meet the model's constraints.

    Rotations that nothing touches and that Q therefore leaves out do not count.
    """
    motions = rigid_motions(model)
    missed = motions - Q @ (Q.T @ motions)
    idle = _dropped_dofs(Q, constraints)
    missed[idle] = 0.0
    missed[: 6 * model.mesh.n_points].reshape(-1, 6, 6)[:, 3:] *= model.mesh.size
    found = unopposed(missed[np.abs(missed).max(axis=1) > _ROUNDING], 10 * _ROUNDING)
    if not idle.any() or not found.shape[1]:
        return found
    # a straight string does not notice that it turns about itself
    _, s, Vt = np.linalg.svd(np.linalg.qr(Q.T @ motions @ found, mode="r"))
    return found @ Vt[: int((s > _ROUNDING * max(s[0], 1.0)).sum())].T


def held_by(model: Model) -> tuple[tuple[str, ...], int]:
    """Return the names of effects that oppose rigid-body motions, and how many of these nothing opposes.

    A support, a spring or joint to the ground, an elastic foundation; not what takes a motion away from all
    of the structure, as a plane does.
    """
    motions, size = rigid_motions(model), model.mesh.size
    rows = [resistance(model.parts_of(e), motions, size, _ROUNDING) for e in model.effects]
    names = [e.name for e, of in zip(model.effects, rows, strict=True) if len(of)]
    for c in model.constraints():
        row = c.coefficients @ motions[c.dofs] / np.abs(c.coefficients).max()
        if np.abs(row).max() > _ROUNDING:
            rows.append(row[None])
            names += [] if c.everywhere else [c.key[0]]
    return tuple(dict.fromkeys(names)), unopposed(np.vstack(rows), 10 * _ROUNDING).shape[1]


def _allowed(model: Model, Q: Any, constraints: Sequence[Constraint]) -> Floats:
    """Return the rigid-body motions (n_free, n_rigid) that Q reproduces and that no element resists."""
    motions = rigid_motions(model) @ reproduced(model, Q, constraints)
    if not motions.shape[1]:
        return np.zeros((Q.shape[1], 0))
    size = model.mesh.size
    return Q.T @ motions @ unopposed(resistance(model.batches(), motions, size, _ROUNDING), 10 * _ROUNDING)


@dataclass(frozen=True, slots=True, eq=False)
class _SparsityPattern:
    """Which 6x6 blocks the elements on a mesh's lines fill, by rows of points."""

    indptr: NDArray[np.int32]
    indices: NDArray[np.int32]
    diagonal: Ints  # (n_points,): the block of a point with itself
    other: Ints  # (2, n_lines): those of a line's first point with its second, and back
    once: bool  # no two lines join the same two points


def _pattern(mesh: Mesh) -> _SparsityPattern:
    """Return the blocks of a mesh."""
    n, first, second = mesh.n_points, *mesh.lines.T
    keys = np.concatenate([np.arange(n) * (n + 1), first * n + second, second * n + first])
    blocks, place = np.unique(keys, return_inverse=True)
    indptr = np.searchsorted(blocks, n * np.arange(n + 1)).astype(np.int32)
    once = len(blocks) == len(keys)
    return _SparsityPattern(indptr, (blocks % n).astype(np.int32), place[:n], place[n:].reshape(2, -1), once)


def full_matrices(model: Model) -> dict[str, Any]:
    """Return sparse K, M, C and D on all DOFs by name, with the static K of frequency-dependent elements."""
    return _full_matrices(model.mesh, model.n_dof, model.batches())[0]


def sum_stiffness(model: Model, parts: Iterable[Contribution]) -> Any:
    """Return the stiffness of some contributions on all DOFs, sparse (n_dof, n_dof)."""
    return _full_matrices(model.mesh, model.n_dof, parts)[0]["K"]


def stiffness_pattern(system: System) -> sp.csc_array:
    """Return ones, sparse (n_free, n_free), at all entries of K and all that elements on lines may have.

    An order of elimination of this pattern is one of K with any geometric stiffness.
    """
    mesh, n = system.model.mesh, system.Q.shape[0]
    pattern = mesh.kept.get("pattern", lambda: _pattern(mesh))
    ones = np.ones((len(pattern.indices), 6, 6))
    X = sp.bsr_array((ones, pattern.indices, pattern.indptr)).tocsr()
    X.resize((n, n))
    of_K = sp.csc_array((np.ones(system.K.nnz), system.K.indices, system.K.indptr), shape=system.K.shape)
    out = sp.csc_array(_on_q(X, abs(system.Q), _selection(system.Q)) + of_K)
    out.sort_indices()
    out.data[:] = 1.0
    return out


def on_pattern(X: Any, pattern: sp.csc_array) -> sp.csc_array:
    """Return a sparse matrix with the entries of a wider pattern, those that it lacks being 0."""
    out = sp.csc_array((np.zeros(pattern.nnz), pattern.indices, pattern.indptr), shape=pattern.shape)
    place = sp.csc_array((np.arange(pattern.nnz), pattern.indices, pattern.indptr), shape=pattern.shape)
    X = sp.csc_array(X)
    X.sum_duplicates()
    mask = sp.csc_array((np.ones(X.nnz, dtype=np.int64), X.indices, X.indptr), shape=X.shape)
    shifted = place.copy()
    shifted.data += 1  # a product drops entries that are 0
    at = sp.csc_array(shifted.multiply(mask))
    at.sort_indices()
    out.data[at.data - 1] = X.data
    return out


def _full_matrices(
    mesh: Mesh, n: int, batches: Iterable[Contribution]
) -> tuple[dict[str, Any], list[tuple[Law, Any]]]:
    """Return K, M, C and D on all n DOFs, and each law with the stiffness that it multiplies.

    Elements on lines of the mesh are summed block by block in a pattern that is sorted once; all others are
    sorted by their entries.
    """
    pattern = mesh.kept.get("pattern", lambda: _pattern(mesh))  # every model of a fit is on one mesh
    blocks: dict[str, Any] = {}
    others: list[Contribution] = []
    for part in batches:
        if part.lines is None or part.law is not None:
            others.append(part)
            continue
        _add_blocks(blocks, pattern, mesh.lines[part.lines], part)
    rest = sum_contributions(tuple(others), n)
    for X in rest:
        X.eliminate_zeros()
    full: dict[str, Any] = {}
    for key, sums in zip("KMCD", rest, strict=True):
        if key not in blocks:
            full[key] = sums
            continue
        X = sp.bsr_array((blocks.pop(key).reshape(-1, 6, 6), pattern.indices, pattern.indptr)).tocsr()
        X.resize((n, n))
        X.eliminate_zeros()
        full[key] = X + sums if sums.nnz else X
    laws = [(c.law, sum_contributions((replace(c, law=None),), n)[0]) for c in others if c.law is not None]
    return full, laws


def _add_blocks(
    blocks: dict[str, NDArray[Any]], pattern: _SparsityPattern, ends: Ints, part: Contribution
) -> None:
    """Add element matrices (b, 12, 12) on lines with these ends (b, 2) to blocks (n_blocks, 36)."""
    points, row = np.unique(ends, return_inverse=True)
    gather = sp.csr_array((np.ones(ends.size), (row.ravel(), np.arange(ends.size))))
    diagonal, other = pattern.diagonal[points], pattern.other[:, part.lines]
    for key in "KMCD":
        X = getattr(part, key)
        if X is None:
            continue
        if key not in blocks:
            blocks[key] = np.zeros((len(pattern.indices), 36), dtype=X.dtype)
        out = blocks[key]
        quarters = np.ascontiguousarray(X.reshape(-1, 2, 6, 2, 6).transpose(1, 3, 0, 2, 4)).reshape(
            2, 2, -1, 36
        )
        for place, block in zip(other, (quarters[0, 1], quarters[1, 0]), strict=True):
            if pattern.once:
                out[place] += block
            else:
                np.add.at(out, place, block)
        out[diagonal] += gather @ quarters[[0, 1], [0, 1]].transpose(1, 0, 2).reshape(-1, 36)


def _selection(Q: Any) -> Ints | None:
    """Return the DOFs that Q takes as they are, in order; None if it combines some."""
    if Q.nnz != Q.shape[1] or not (Q.data == 1.0).all() or (np.diff(Q.indices) <= 0).any():
        return None
    return np.flatnonzero(np.diff(Q.indptr))


def _on_q(X: Any, Q: Any, free: Ints | None) -> sp.csc_array:
    """Return QᵀXQ without entries that are zero."""
    if free is None:
        product = sp.csc_array(Q.T @ X @ Q)
        product.eliminate_zeros()
        product.sort_indices()
        return product
    return sp.csc_array(X if len(free) == X.shape[0] else X[free][:, free])


def sum_contributions(contributions: Iterable[Contribution], n_dof: int) -> list[Any]:
    """Return sparse K, M, C and D (n_dof, n_dof) from batches of element matrices.

    Elements that depend on frequency give their static stiffness.
    """
    out, parts = [], tuple(contributions)
    for key in "KMCD":
        rows, cols, data = [], [], []
        for part in parts:
            X = part.static if key == "K" else getattr(part, key)
            if X is None:
                continue
            m = part.dofs.shape[1]
            rows.append(np.repeat(part.dofs, m, axis=1).ravel())
            cols.append(np.tile(part.dofs, (1, m)).ravel())
            data.append(X.ravel())
        if not data:
            out.append(sp.csr_array((n_dof, n_dof)))
            continue
        index = (np.concatenate(rows), np.concatenate(cols))
        out.append(sp.coo_array((np.concatenate(data), index), shape=(n_dof, n_dof)).tocsr())
    return out


def connection_stiffness(system: System) -> sp.csc_array:
    """Return the part of K that belongs to connections, sparse (n_free, n_free)."""
    model, Q = system.model, system.Q
    parts = tuple(c for e in model.effects if e.connection for c in model.parts_of(e))
    return sp.csc_array(Q.T @ sum_contributions(parts, Q.shape[0])[0] @ Q)


def null_space(constraints: tuple[Constraint, ...], n_dof: int) -> sp.csr_array:
    """Return an orthonormal basis Q (n_dof, n_free) of the motions that meet all constraints."""
    taken = np.zeros(n_dof, dtype=bool)
    fixed = np.zeros(n_dof, dtype=bool)
    joint = [c for c in constraints if len(c.dofs) != 1]
    linked = np.zeros(n_dof, dtype=bool)
    for c in joint:
        linked[c.dofs] = True
    for c in constraints:
        if len(c.dofs) == 1:
            if linked[c.dofs[0]]:
                joint.append(c)
            else:
                fixed[c.dofs[0]] = True
    rows, cols, data = [], [], []
    for group in constraint_groups(tuple(joint)):
        dofs = np.unique(np.concatenate([c.dofs for c in group]))
        taken[dofs] = True
        N = _null(_rows(group, dofs))
        for j in range(N.shape[1]):
            rows.append(dofs)
            cols.append(np.full(len(dofs), len(cols)))
            data.append(N[:, j])
    free = np.flatnonzero(~(taken | fixed))
    n_groups = len(cols)
    rows.append(free)
    cols.append(n_groups + np.arange(len(free)))
    data.append(np.ones(len(free)))
    Q = sp.coo_array(
        (np.concatenate(data), (np.concatenate(rows), np.concatenate(cols))),
        shape=(n_dof, n_groups + len(free)),
    ).tocsr()
    return Q[:, np.argsort(_leading(Q), kind="stable")] if n_groups else Q


def particular(constraints: tuple[Constraint, ...], released: Constraint, n_dof: int) -> Floats:
    """Return a motion, shape (n_dof,), that violates one constraint by one unit and meets all others.

    Zero where there is none: another constraint says the same.
    """
    u = np.zeros(n_dof)
    for group in constraint_groups((*constraints, released)):
        if released not in group:
            continue
        dofs = np.unique(np.concatenate([c.dofs for c in group]))
        rhs = np.array([float(c is released) for c in group])
        B = _rows(group, dofs)
        best = np.linalg.lstsq(B, rhs, rcond=None)[0]
        if np.abs(B @ best - rhs).max() < 1e-6:
            u[dofs] = best
    return u


def constraint_groups(constraints: tuple[Constraint, ...]) -> list[tuple[Constraint, ...]]:
    """Return the constraints in sets that share no DOF."""
    if not constraints:
        return []
    n = len(constraints)
    rows = np.concatenate([np.full(len(c.dofs), i) for i, c in enumerate(constraints)])
    dofs, column = np.unique(np.concatenate([c.dofs for c in constraints]), return_inverse=True)
    graph = sp.coo_array((np.ones(len(rows)), (rows, n + column)), shape=(n + len(dofs),) * 2)
    label = connected_components(graph, directed=False)[1][:n]
    order = np.argsort(label, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(label[order])) + 1)
    return [tuple(constraints[i] for i in part) for part in parts]


def _rows(group: tuple[Constraint, ...], dofs: Ints) -> Floats:
    B = np.zeros((len(group), len(dofs)))
    for i, c in enumerate(group):
        np.add.at(B[i], np.searchsorted(dofs, c.dofs), c.coefficients)
    return B


def _null(B: Floats) -> Floats:
    _, s, Vt = np.linalg.svd(B / np.linalg.norm(B, axis=1, keepdims=True))
    rank = int((s > 1e-10).sum())
    return Vt[rank:].T


def _leading(Q: Any) -> Ints:
    """Return the first DOF that each column moves: keeps the bandwidth small."""
    first = np.full(Q.shape[1], Q.shape[0])
    coo = Q.tocoo()
    np.minimum.at(first, coo.col, coo.row)
    return first
