"""Receptances by superposition, with a bound of the contribution of the vectors left out.

Structural, Rayleigh and modal damping do not couple the modes; local dampers and elements that depend on
frequency enter by Woodbury's identity. docs/theory-fem.md derives the bound.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fem.analysis.basis import Complement, root_of
from fem.analysis.modes import Eigenpairs, solve_eigenpairs
from fem.array_types import Complexes, Floats, Ints
from fem.linalg.solvers import factorise
from fem.model import Contribution, Damping, Law
from fem.system import System, law_change, refuse_unsymmetric, sum_contributions

LOCAL_DAMPING = 48
"""A contribution to the damping that touches more DOFs than this is not local.

It is then taken for a member with a loss factor rather than a damper.
"""


_SOLVE_COLUMNS = 64
"""Right-hand sides that are solved at once where only products of the solutions are needed."""

_CHUNK = 1_000_000
"""Complex numbers that one array over lines holds at most."""


@dataclass(frozen=True, slots=True, eq=False)
class Locals:
    """Damping in addition to structural, Rayleigh and modal damping.

    Attributes
    ----------
    U : sparse (n_free, n)
        Forces of local dampers and local elements that depend on frequency.
    C, D : ndarray (n, n)
        Their damping in these directions.
    laws : tuple of (Law, ndarray (n, n))
        Their dependence on frequency.
    wide : tuple
        Terms on many DOFs: of each ("C", "D" or its Law) the sparse (n_free, n_free) matrix.
    loss : float
        Loss factor of all of K that is taken out of ``D`` and ``wide`` [-]: that of the members'
        material, which joints and springs then lack.
    """

    U: Any
    C: Floats
    D: Floats
    laws: tuple[tuple[Law, Floats], ...]
    wide: tuple[tuple[str | Law, Any], ...]
    loss: float = 0.0

    def stiffness(self, omega: Floats) -> Complexes:
        """Return the local part of Z, (n_freq, n, n)."""
        s: NDArray[Any] = 1j * (omega[:, None, None] * self.C + self.D)
        for law, K in self.laws:
            s = s + law_change(law, omega)[:, None, None] * K
        return s

    def wide_factors(self, omega: Floats) -> list[Complexes]:
        """Return the factor of each wide matrix at each line."""
        factors = {"C": 1j * omega, "D": np.full(len(omega), 1j)}
        return [factors[of] if isinstance(of, str) else law_change(of, omega) for of, _ in self.wide]


def locals_of(system: System, *, reciprocal: bool = True) -> Locals:
    """Separate a system's dampers into local and wide parts; rotors too if ``reciprocal`` is False.

    Each local element gives an orthonormal basis of the range of its C, D and K with a law.
    """
    if reciprocal:
        refuse_unsymmetric(system.model)
    if not (system.C.count_nonzero() or system.D.count_nonzero() or system.laws):
        return Locals(sp.csr_array((system.n_free, 0)), np.zeros((0, 0)), np.zeros((0, 0)), (), ())
    n_dof = system.model.n_dof
    rows, values, blocks = [], [], []
    wide: dict[str | Law, Any] = {}
    n = 0
    parts = system.model.contributions()
    loss = _common_loss(parts)
    lacking = sum(len(p.dofs) for p in parts if p.K is not None and p.dofs.size <= LOCAL_DAMPING)
    # With more joints and springs than this, members' loss factors do not count as one of the structure
    loss = loss if lacking <= 10 else 0.0
    for part in parts:
        law = part.law
        # the law's part without its static stiffness, which K contains, and the loss factor of all of K
        damping = {"C": part.C, "D": _less(part.D, part.static, loss), "law": None if law is None else part.K}
        have = {key: X for key, X in damping.items() if X is not None and X.any()}
        if not have:
            continue
        acts = np.any([X.any(axis=(1, 2)) for X in have.values()], axis=0)
        dofs_of_all, have = part.dofs[acts], {key: X[acts] for key, X in have.items()}
        if dofs_of_all.size > LOCAL_DAMPING:
            for key, X in have.items():
                kind = law if key == "law" and law is not None else key
                full = sum_contributions((Contribution(dofs_of_all, X),), n_dof)[0]
                on_q = sp.csc_array(system.Q.T @ full @ system.Q)
                wide[kind] = wide[kind] + on_q if kind in wide else on_q
            continue
        for i, dofs in enumerate(dofs_of_all):
            matrices = {key: X[i] for key, X in have.items()}
            stacked = np.hstack([X / max(np.abs(X).max(), 1e-300) for X in matrices.values()])
            vectors, s, _ = np.linalg.svd(stacked)
            V = vectors[:, s > 1e-12 * s[0]] if s[0] > 0 else vectors[:, :0]
            k = V.shape[1]
            rows.append((np.repeat(dofs, k), np.tile(np.arange(n, n + k), len(dofs))))
            values.append(V.ravel())
            blocks.append((n, k, law, {key: V.T @ X @ V for key, X in matrices.items()}))
            n += k
    if not n:
        none = np.zeros((0, 0))
        return Locals(sp.csr_array((system.n_free, 0)), none, none, (), tuple(wide.items()), loss)
    index = tuple(np.concatenate([r[i] for r in rows]) for i in (0, 1))
    U = sp.coo_array((np.concatenate(values), index), shape=(n_dof, n)).tocsr()
    C, D = np.zeros((2, n, n))
    laws: dict[Law, Floats] = {}
    for start, k, law, matrices in blocks:
        at = slice(start, start + k)
        for key, X in matrices.items():
            target = C if key == "C" else D if key == "D" else laws.setdefault(law, np.zeros((n, n)))
            target[at, at] += X
    return Locals(system.Q.T @ U, C, D, tuple(laws.items()), tuple(wide.items()), loss)


def _common_loss(parts: tuple[Contribution, ...]) -> float:
    """Return the loss factor that most elements of members have, 0 where they have none."""
    found = [np.zeros(0)]
    for part in parts:
        if part.D is None or part.K is None or part.law is not None or part.dofs.size <= LOCAL_DAMPING:
            continue
        size = np.einsum("bij,bij->b", part.K, part.K)
        eta = np.einsum("bij,bij->b", part.D, part.K) / np.maximum(size, 1e-300)
        rest = np.abs(part.D - eta[:, None, None] * part.K).max(axis=(1, 2))
        found.append(eta[(rest <= 1e-12 * np.abs(part.D).max(axis=(1, 2))) & (eta > 0)])
    values, first, count = np.unique(
        np.round(np.concatenate(found), 12), return_index=True, return_counts=True
    )
    return float(np.concatenate(found)[first[np.argmax(count)]]) if values.size else 0.0


def _less(D: Any, K: Any, loss: float) -> Any:
    """Return D - loss · K, (b, m, m), exactly 0 for elements of just that loss factor; None for none."""
    if loss == 0 or K is None:
        return D
    if D is None:
        return -loss * K
    rest = D - loss * K
    equal = np.abs(rest).max(axis=(1, 2)) <= 1e-12 * np.abs(D).max(axis=(1, 2))
    return np.where(equal[:, None, None], 0.0, rest)


@dataclass(frozen=True, slots=True, eq=False)
class Superposition:
    """A system on vectors that its stiffness and mass do not couple.

    Attributes
    ----------
    stiffness, mass : ndarray (r,)
        Of each vector: φᵀKφ and φᵀMφ; the modes come first.
    n_modes, n_rigid : int
        How many are modes, and rigid-body modes.
    loads : ndarray (r, n_in + n_local)
        Forces in these coordinates: the inputs, then those of local dampers.
    responses : ndarray (r, n_out)
        Outputs in these coordinates.
    local : Locals
    wide : tuple of ndarray (r, r)
        The wide damping in these coordinates.
    damping : Damping
        The structure's.
    residual : tuple of ndarray (n_out, n_in + n_local), (n_local, n_in + n_local) or None
        Static flexibility of the modes left out (method "modal").
    outside : ndarray (q, n_in + n_local), (q, r - n_modes) or None
        Coordinates of the remainders of a force and of a vector outside the vectors.
    shift, cut : float
        σ, and the lowest eigenvalue that the modes may lack (infinite if they lack none) [rad²/s²].
    beyond : ndarray (q, n_in + n_local)
        Coordinates of the forces without the modes in which their length is √(bᵀ(K - σM)⁻¹b).
    response_size : ndarray (n_out,)
        That length of the outputs without the modes.
    same : ndarray of int (n_out,)
        The input that an output equals, -1 without one.
    """

    stiffness: Floats
    mass: Floats
    n_modes: int
    n_rigid: int
    loads: Floats
    responses: Floats
    local: Locals
    wide: tuple[Floats, ...]
    damping: Damping
    residual: tuple[Floats, Floats] | None = None
    outside: tuple[Floats, Floats] | None = None
    shift: float = 0.0
    cut: float = np.inf
    beyond: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    response_size: Floats = field(default_factory=lambda: np.zeros(0))
    same: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @property
    def n_vectors(self) -> int:
        """Number of vectors, modes included."""
        return len(self.stiffness)

    @property
    def n_in(self) -> int:
        """Number of inputs."""
        return self.loads.shape[1] - self.local.C.shape[0]

    def chunks(self, n_freq: int) -> Iterator[slice]:
        """Return slices of lines, small enough for arrays over lines and coordinates."""
        width = (self.n_vectors + self.responses.shape[1]) * self.loads.shape[1]
        if self.local.C.size:
            width += self.n_vectors * self.responses.shape[1]
        if self.wide:
            width += self.n_vectors**2
        step = max(1, _CHUNK // max(width, 1))
        return (slice(start, start + step) for start in range(0, n_freq, step))


@dataclass(frozen=True, slots=True, eq=False)
class _ModalLines:
    """Superposition at some lines: Z = stiffness + damping, and motions of the proportional part."""

    omega: Floats
    k: NDArray[Any]
    m: NDArray[Any]
    z: NDArray[Any]
    undamped: NDArray[Any]

    @classmethod
    def of(cls, s: Superposition, omega: Floats) -> "_ModalLines":
        d = s.damping
        k = 1 + 1j * (d.loss_factor + s.local.loss + omega * d.beta)
        m = 1j * omega * d.alpha - omega**2
        undamped = k[:, None] * s.stiffness + m[:, None] * s.mass
        positive = np.maximum(s.stiffness, 0.0)  # motions that grow have no damping ratio
        root = np.sqrt(positive * s.mass)
        omega2 = np.divide(positive, s.mass, out=np.full(len(root), np.inf), where=s.mass > 0)
        zeta = d.ratio_at(np.sqrt(omega2) / (2 * np.pi))
        z = undamped + 2j * omega[:, None] * (zeta * root) if zeta.any() else undamped
        return cls(omega, k, m, z, undamped)


def receptance(s: Superposition, omega: Floats, bounds: bool = True) -> tuple[Complexes, Floats | None]:
    """Return receptances (n_freq, n_out, n_in) at some lines, and a bound of the error of each.

    The bound is None where none is known: with damping of members.
    """
    H = np.empty((len(omega), s.responses.shape[1], s.n_in), dtype=complex)
    bound = np.empty(H.shape) if bounds and not s.wide else None
    with np.errstate(all="ignore"):
        for lines in s.chunks(len(omega)):
            H[lines], error = _receptance(s, omega[lines], bound is not None)
            if bound is not None:
                bound[lines] = error
    return H, bound


def receptance_blocks(
    s: Superposition, omega: Floats, derivatives: int, symmetric: bool, out: NDArray[Any] | None
) -> Iterator[tuple[slice, Complexes]]:
    """Return slices of lines and the FRFs there, (lines, n_out, n_in), one after the other.

    Each overwrites the former unless there is an array ``out`` (n_freq, n_out, n_in) for all. Of modes that
    nothing couples, H is one real product for each line: Φₒ times the real and imaginary columns of Φᵢ/z side
    by side. ``symmetric`` says that outputs are inputs: then entries below the diagonal are copied.
    """
    n_out, n_in = s.responses.shape[1], s.n_in
    step = max(1, _CHUNK // max(n_out * n_in, 1))
    plain = not (s.wide or s.local.C.size or s.residual is not None)
    buffer = np.empty((min(step, len(omega)), n_out, n_in), dtype=complex) if out is None else None
    outputs = np.ascontiguousarray(s.responses.T)
    edges = np.linspace(0, n_out, 1 + (max(1, min(n_out // 48, 8)) if symmetric else 1)).astype(int)
    work = np.empty((s.n_vectors, n_in), dtype=complex)
    for start in range(0, len(omega), step):
        lines = slice(start, min(start + step, len(omega)))
        H = out[lines] if out is not None else buffer[: lines.stop - start]  # type: ignore[index]
        factor = (1j * omega[lines]) ** derivatives
        if not plain:
            H[...] = receptance(s, omega[lines], bounds=False)[0] * factor[:, None, None]
            yield lines, H
            continue
        with np.errstate(all="ignore"):
            flexibility = factor[:, None] / _ModalLines.of(s, omega[lines]).z
        for k in range(len(H)):
            np.multiply(s.loads, flexibility[k, :, None], out=work)
            for a, b in pairwise(edges):
                first = a if symmetric else 0
                if H.flags.c_contiguous and first == 0 and b - a == n_out:
                    np.matmul(outputs, work.view(float), out=H[k].view(float))
                else:
                    H[k, a:b, first:] = (outputs[a:b] @ work.view(float)[:, 2 * first :]).view(complex)
                if symmetric:
                    H[k, b:, a:b] = H[k, a:b, b:].T
        yield lines, H


def _receptance(s: Superposition, omega: Floats, bounds: bool) -> tuple[Complexes, Any]:
    at, n_in = _ModalLines.of(s, omega), s.n_in
    if s.wide:
        return _coupled(s, at), None
    y = s.loads * (1 / at.z)[:, :, None]
    H = _real_times(s.responses.T, y)
    if s.residual is not None:
        H = H + s.residual[0] / at.k[:, None, None]
    if not s.local.C.size:
        return H, _bound(s, at, y, None, H) if bounds else None
    forces = s.loads[:, n_in:]
    G = _real_times(forces.T, y)
    if s.residual is not None:
        G = G + s.residual[1] / at.k[:, None, None]
    S = s.local.stiffness(omega)
    eye = np.eye(forces.shape[1])
    # W = S (I + G S)⁻¹
    try:
        W = np.linalg.solve(eye + S @ G[:, :, n_in:], S)
    except np.linalg.LinAlgError:
        W = np.full(S.shape, np.nan + 0j)
    reaction = W @ G[:, :, :n_in]
    damped = H[:, :, :n_in] - H[:, :, n_in:] @ reaction
    # A line next to a resonance of the rest, which only dampers limit: there the two terms cancel.
    near = np.abs(at.z) < 1e-7 * (np.abs(at.k)[:, None] * s.stiffness + np.abs(at.m)[:, None] * s.mass)
    back = W @ np.swapaxes(H[:, :, n_in:], 1, 2)
    if s.residual is None:
        for i in np.flatnonzero(near.any(axis=1)):
            Z = np.diag(at.z[i]) + forces @ S[i] @ forces.T
            try:
                X = np.linalg.solve(Z, np.hstack([s.loads, s.responses]))
            except np.linalg.LinAlgError:
                continue
            damped[i] = s.responses.T @ X[:, :n_in]
            move = forces.T @ X
            reaction[i] = S[i] @ move[:, :n_in]
            back[i] = S[i] @ move[:, s.loads.shape[1] :]
            W[i] = S[i] - S[i] @ move[:, n_in : s.loads.shape[1]] @ S[i]
    return damped, _bound(s, at, y, (W, reaction, back), damped) if bounds else None


def _coupled(s: Superposition, at: _ModalLines) -> Complexes:
    """Return receptances where damping of members couples all vectors: one solution for each line."""
    n = s.n_vectors
    Z = np.zeros((len(at.omega), n, n), dtype=complex)
    Z[:, np.arange(n), np.arange(n)] = at.z
    for factor, X in zip(s.local.wide_factors(at.omega), s.wide, strict=True):
        Z += factor[:, None, None] * X
    if s.local.C.size:
        forces = s.loads[:, s.n_in :]
        Z += forces @ s.local.stiffness(at.omega) @ forces.T
    try:
        X = np.linalg.solve(Z, s.loads[:, : s.n_in].astype(complex))
    except np.linalg.LinAlgError:
        X = np.full((len(at.omega), n, s.n_in), np.inf + 0j)
    H = _real_times(s.responses.T, X)
    return H if s.residual is None else H + s.residual[0][:, : s.n_in] / at.k[:, None, None]


def _bound(s: Superposition, at: _ModalLines, y: NDArray[Any], damped: Any, H: Complexes) -> Floats:
    """Return a bound of the error at each line; see the section "FRFs" of docs/theory-fem.md.

    ‖r_b‖ · min(‖c‖ + ‖G W H_c‖, ‖r_c‖) / (1 - ‖G W Gᵀ‖), in coordinates in which the flexibility
    left out is at most 1.
    """
    n_in = s.n_in
    total = np.zeros(H.shape)
    if s.cut < np.inf and s.outside is not None:
        square, ratio = at.omega**2, _largest_ratio(s)
        root = ratio * at.omega * np.sqrt(s.cut)
        if s.residual is not None:
            kappa = (np.abs(at.m) + 2 * root) / (s.cut - square)
            G = np.broadcast_to(s.outside[0].astype(complex), (len(square), *s.outside[0].shape))
        else:
            kappa = (s.cut - s.shift) / (s.cut - square)
            inner = s.loads[s.n_modes :] / at.undamped[:, s.n_modes :, None] if ratio else y[:, s.n_modes :]
            factor = at.m + at.k * s.shift
            G = s.outside[0] - factor[:, None, None] * _real_times(s.outside[1], inner)
        kappa = np.where(s.cut > square, kappa, np.inf)
        size, G = np.sqrt(kappa), np.sqrt(kappa)[:, None, None] * G
        if ratio and s.residual is None:
            # Change by the damping ratios above the cut, in the system and in its vectors.
            change = 4 * root * (s.cut - s.shift) / (s.cut - square) ** 2
            G = np.concatenate([G, np.sqrt(change)[:, None, None] * s.beyond], axis=1)
            size = np.sqrt(kappa + change)
        c, gain = size[:, None] * s.response_size, np.ones(len(square))
        if damped is None:
            r = _length(G[:, :, :n_in])
        else:
            W, reaction, back = damped
            GU = G[:, :, n_in:]
            r = _length(G[:, :, :n_in] - GU @ reaction)
            c = c + _length(GU @ back)
            weak = 1 - np.sqrt((np.abs(GU @ W @ np.swapaxes(GU, 1, 2)) ** 2).sum(axis=(1, 2)))
            gain = np.where(weak > 0, 1 / np.where(weak > 0, weak, 1.0), np.inf)
        c = np.where(s.same >= 0, np.minimum(c, r[:, s.same]), c)
        total = gain[:, None, None] * c[:, :, None] * r[:, None, :]
    return total


def _largest_ratio(s: Superposition) -> float:
    """Return the largest modal damping ratio of modes above the cut."""
    d = s.damping
    beyond = d.ratio[d.frequency > np.sqrt(s.cut) / (2 * np.pi)]
    return float(max(d.ratio_at(np.sqrt(s.cut) / (2 * np.pi)), beyond.max(initial=0.0)))


def _length(G: Complexes) -> Floats:
    return np.sqrt((np.abs(G) ** 2).sum(axis=1))


def _real_times(A: Floats, Y: NDArray[Any]) -> Complexes:
    """Multiply a real matrix (m, r) with complex ones (n_freq, r, n) by real products."""
    Y = np.ascontiguousarray(Y)
    out = np.empty((len(Y), len(A), Y.shape[2]), dtype=complex)
    if Y.shape[2]:
        np.matmul(A, Y.view(float), out=out.view(float))
    return out


def superpose(
    system: System,
    pairs: Eigenpairs,
    cut: float,
    local: Locals,
    inputs: Any,
    outputs: Any,
    loads: Floats,
    more: Complement | None,
    response_size: Floats | None = None,
) -> Superposition:
    """Project a system on its modes and on vectors beyond them.

    Parameters
    ----------
    system : System
    pairs : Eigenpairs
        All modes below ``cut``.
    cut : float
        The lowest eigenvalue that the modes may lack [rad²/s²].
    local : Locals
    inputs, outputs : sparse (n_free, n_in), (n_free, n_out)
    loads : ndarray (n_free, n_in + n_local)
        The inputs and the forces of local dampers.
    more : Complement or None
        Vectors beyond the modes; None for modes alone.
    response_size : ndarray (n_out,), optional
        From :func:`response_sizes`, for a bound.
    """
    phi = pairs.vectors
    stiffness, mass = pairs.eigenvalues, np.ones(phi.shape[1])
    on_loads, on_responses = phi.T @ loads, (outputs.T @ phi).T
    V, outside, beyond = phi, None, np.zeros((0, loads.shape[1]))
    if more is not None:
        mu, S = np.linalg.eigh(more.M)
        mu = np.maximum(mu, 0.0)
        stiffness = np.concatenate([stiffness, np.maximum(1 + pairs.shift * mu, 0.0)])
        mass = np.concatenate([mass, mu])
        on_loads = np.vstack([on_loads, S.T @ more.B])
        on_responses = np.vstack([on_responses, S.T @ (outputs.T @ more.Q).T])
        if local.wide:
            V = np.hstack([phi, more.Q @ S])
        if response_size is not None:
            N = more.outside(system, pairs.shift)
            n = loads.shape[1]
            outside = N[:, :n], N[:, n:] @ S
            beyond = root_of(more.BB)
    wide = tuple(V.T @ (X @ V) for _, X in local.wide)
    return Superposition(
        stiffness,
        mass,
        phi.shape[1],
        pairs.n_rigid,
        on_loads,
        np.ascontiguousarray(on_responses),
        local,
        wide,
        system.model.damping,
        outside=outside,
        shift=pairs.shift,
        cut=cut,
        beyond=beyond,
        response_size=np.zeros(outputs.shape[1]) if response_size is None else response_size,
        same=_same(inputs, outputs),
    )


def response_sizes(system: System, pairs: Eigenpairs, forces: Any) -> Floats:
    """Return √(bᵀ(K - σM)⁻¹b) of sparse forces (n_free, n) without their part in the modes."""
    forces = sp.csc_array(forces)
    out = np.zeros(forces.shape[1])
    for start in range(0, len(out), _SOLVE_COLUMNS):
        block = forces[:, start : start + _SOLVE_COLUMNS]
        b = block.toarray()
        b = b - system.M @ (pairs.vectors @ (pairs.vectors.T @ b))
        out[start : start + _SOLVE_COLUMNS] = np.einsum("ij,ij->j", b, pairs.factor.solve(b))
    return np.sqrt(np.maximum(out, 0.0))


def _same(inputs: Any, outputs: Any) -> Ints:
    """Return the input that each output equals, -1 without one."""

    def keys(X: Any) -> list[tuple[bytes, bytes]]:
        X = sp.csc_array(X)
        X.sort_indices()
        spans = zip(X.indptr[:-1], X.indptr[1:], strict=True)
        return [(X.indices[a:b].tobytes(), X.data[a:b].tobytes()) for a, b in spans]

    number = {key: i for i, key in enumerate(keys(inputs))}
    return np.array([number.get(key, -1) for key in keys(outputs)], dtype=np.int64)


def static_residual(
    system: System, pairs: Eigenpairs, s: Superposition, loads: Floats, outputs: Any
) -> Superposition:
    """Add the static flexibility of the modes left out to modes alone.

    It is the solution of K x = b without the modes, by iteration with the factor of K - σM: the rest falls
    by |σ|/(λ + |σ|) a step, with λ the lowest eigenvalue left out.
    """
    if s.cut == np.inf:
        return s
    if abs(pairs.shift) > s.cut:  # far below motions that grow, which are modes
        shift = -0.1 * s.cut
        pairs = replace(pairs, factor=factorise(system.K - shift * system.M), shift=shift)

    def solved(b: Floats) -> tuple[Floats, Floats]:
        b = b - system.M @ (pairs.vectors @ (pairs.vectors.T @ b))
        x = pairs.factor.solve(b)
        rate = abs(pairs.shift) / (s.cut + abs(pairs.shift))
        for _ in range(int(np.ceil(np.log(1e-13) / np.log(max(rate, 1e-13))))):
            x = pairs.factor.solve(b - pairs.shift * (system.M @ x))
            x = x - pairs.vectors @ (pairs.vectors.T @ (system.M @ x))
        return b, x

    b, x = solved(loads)
    n_in = s.n_in
    G = root_of(b.T @ x)
    sizes = []
    for start in range(0, outputs.shape[1], _SOLVE_COLUMNS):
        c, xc = solved(outputs[:, start : start + _SOLVE_COLUMNS].toarray())
        sizes.append(np.einsum("ij,ij->j", c, xc))
    size = np.sqrt(np.maximum(np.concatenate(sizes), 0.0))
    return replace(
        s,
        residual=(outputs.T @ x, b[:, n_in:].T @ x),
        outside=(G, np.zeros((len(G), 0))),
        response_size=size,
    )


def nearly_static(system: System, pairs: Eigenpairs, cut: float) -> Eigenpairs:
    """Return the modes with a factor whose shift lies below the modes that are left out.

    The shift that was good enough for the modes may lie far above them: responses to it die away within a
    fraction of the structure, and many vectors are needed. Only then the matrix is factorised again.
    """
    if cut == np.inf or abs(pairs.shift) < cut:
        return pairs
    shift = min(-0.1 * cut, 1.1 * float(pairs.eigenvalues.min()))
    return replace(pairs, factor=factorise(system.K - shift * system.M), shift=shift)


def modes_below(system: System, frequency: float) -> tuple[Eigenpairs, float]:
    """Return all modes up to a frequency [Hz], and the lowest eigenvalue that they may lack."""
    pairs = sharpened(system, solve_eigenpairs(system, max_frequency=frequency, unstable=True))
    every = pairs.vectors.shape[1] >= system.n_free
    return pairs, np.inf if every else (2 * np.pi * frequency) ** 2


def sharpened(system: System, pairs: Eigenpairs) -> Eigenpairs:
    """Return modes with Rayleigh's quotients where these keep more digits than 1/ν + σ does.

    The first loses 10⁻¹⁶ of φᵀ diag(K) φ, the other 10⁻¹⁶ of σ.
    """
    phi = pairs.vectors
    better = np.einsum("ij,ij,i->j", phi, phi, system.K.diagonal()) < abs(pairs.shift)
    better[: pairs.n_rigid] = False
    if not better.any():
        return pairs
    quotient = np.einsum("ij,ij->j", phi, system.K @ phi)
    quotient = np.where(pairs.eigenvalues < 0, quotient, np.maximum(quotient, 0.0))
    return replace(pairs, eigenvalues=np.where(better, quotient, pairs.eigenvalues))
