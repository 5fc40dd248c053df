"""Frequency based substructuring on labelled FRFs: coupling and decoupling by interface forces (LM-FBS).

u = Y (f + g) with the interface forces g = -Bᵀ λ, compatibility B u = 0: de Klerk, Rixen & Voormeeren, AIAA
Journal 46 (2008) 1169-1181, eqs. (22)-(27).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from fem.analysis.frf import FRF, FRFKind
from fem.array_types import Complexes, Floats, Ints
from fem.summary import fields_summary
from joint._checks import as_frequency, as_lines, as_square, check_same_lines, frozen_copy, solve_lines
from joint.interface import Interface, SubstructureFRF

_LINES = 32


class SubstructuringError(ValueError):
    """FRFs that cannot be joined or separated as asked; the message names labels and lines."""


@dataclass(frozen=True, slots=True)
class Regularisation:
    """How the interface's receptances are inverted.

    Attributes
    ----------
    method : str
        ``"none"`` solves; ``"tsvd"`` leaves out singular values below ``amount`` of the largest at a line;
        ``"tikhonov"`` divides by σ + (``amount`` σ₁)²/σ in place of σ.
    amount : float
        Relative to the largest singular value at a line [-].
    """

    method: str = "none"
    amount: float = 0.0

    def __post_init__(self) -> None:
        if self.method not in ("none", "tsvd", "tikhonov"):
            msg = f"the regularisation is '{self.method}'; allowed are none, tsvd, tikhonov"
            raise SubstructuringError(msg)
        if not 0 <= self.amount < 1:
            msg = (
                f"the amount of regularisation is {self.amount}; it is relative to the largest value: 0 to 1"
            )
            raise SubstructuringError(msg)

    def solve(self, A: Complexes, B: Complexes) -> Complexes:
        """Return the regularised solution X of A X = B at each line, (n_freq, n, k)."""
        if self.method == "none":
            return solve_lines(A, B)
        U, s, Vh = np.linalg.svd(A)
        return Vh.conj().mT @ (self._filter(s)[:, :, None] * (U.conj().mT @ B))

    def _filter(self, s: Floats) -> Floats:
        largest = s[:, :1]
        if self.method == "tsvd":
            return np.divide(1.0, s, out=np.zeros_like(s), where=s > self.amount * largest)
        return s / (s**2 + (self.amount * largest) ** 2)


@dataclass(frozen=True, slots=True, eq=False)
class Substructured:
    """Hold coupled or decoupled FRFs.

    Attributes
    ----------
    frf : FRF
        All responses and inputs of all parts, in their order; receptance.
    condition : (n_freq,) array
        2-norm condition number of the interface's receptance B Y Bᵀ, each row and column scaled to a unit
        diagonal.
    gap : (n_freq,) array
        ‖B u‖ / ‖u at the interface‖ that regularisation leaves open [-]; rounding without.
    """

    frf: FRF
    condition: Floats
    gap: Floats

    __repr__ = fields_summary

    def __post_init__(self) -> None:
        for name in ("condition", "gap"):
            object.__setattr__(self, name, frozen_copy(getattr(self, name)))


def couple_frf(
    parts: FRF | Sequence[FRF],
    connections: Sequence[tuple[str, str]],
    *,
    compliance: npt.ArrayLike | None = None,
    regularisation: Regularisation | None = None,
) -> Substructured:
    """Couple substructures at pairs of DOFs.

    Y_c = Y - Y Bᵀ (B Y Bᵀ + S)⁻¹ B Y

    with Y block-diagonal by part and one row of B, +1 and -1, for each pair; S is the compliance of flexible
    connections, 0 for rigid ones (LM-FBS). Only the rows and columns at the interface are multiplied, part by
    part.

    Parameters
    ----------
    parts : FRF or sequence of FRF
        One or more, on the same lines. All labels differ; each connected DOF is a response and an input.
    connections : sequence of (str, str)
        Labels of DOFs that move together. The sign of a label such as ``"3Z-"`` counts; directions themselves
        are the user's matter.
    compliance : (n_freq, n, n) array_like, optional
        Relative motion for each force of the connections [m/N, rad/N, …], Z_j⁻¹.
    regularisation : Regularisation, optional
        None unless given.

    Returns
    -------
    Substructured

    Raises
    ------
    SubstructuringError
        For a label that is not there, occurs twice or is no response and input; for lines that differ; for an
        interface whose motions depend on one another, without regularisation.
    """
    parts = _receptances(parts)
    return _dual(parts, connections, (1.0,) * len(parts), compliance, regularisation)


def decouple_frf(
    assembly: FRF,
    part: FRF,
    connections: Sequence[tuple[str, str]],
    *,
    regularisation: Regularisation | None = None,
) -> Substructured:
    """Take a known part out of an assembly: dual decoupling.

    The part's negative is coupled to the assembly. Internal DOFs of the part that are in ``connections`` as
    well make the interface an extended one; with more equations than forces need, regularise.

    D'Ambrogio & Fregolent, Mechanical Systems and Signal Processing 24 (2010) 2035-2048.

    Parameters
    ----------
    assembly, part : FRF
        On the same lines, with labels of their own.
    connections : sequence of (str, str)
        Pairs of a label of the assembly and one of the part.
    regularisation : Regularisation, optional
        None unless given.

    Returns
    -------
    Substructured
        Of the remaining structure, at the assembly's responses and inputs. At DOFs that lie on the part it
        has no meaning.

    Raises
    ------
    SubstructuringError
        As `couple_frf`.
    """
    both = tuple(f.as_kind(FRFKind.RECEPTANCE) for f in (assembly, part))
    found = _dual(both, connections, (1.0, -1.0), None, regularisation)
    frf = found.frf.select(outputs=assembly.outputs, inputs=assembly.inputs)
    return Substructured(frf, found.condition, found.gap)


def invert_substructure(
    assembly: FRF,
    connections: Sequence[tuple[str, str]],
    *,
    regularisation: Regularisation | None = None,
) -> Complexes:
    """Return a joint's dynamic stiffness from the assembly alone: inverse substructuring.

    With DOFs on both sides of a joint without mass, the inverse of their receptances holds -Z_j between the
    sides, whatever is attached to them: Meggitt, Elliott & Moorhouse, Proc. Inst. Mech. Eng. C 230 (2016)
    986-993.

    Parameters
    ----------
    assembly : FRF
        With responses and inputs at both sides.
    connections : sequence of (str, str)
        Pairs of a label on the first side and one on the second.
    regularisation : Regularisation, optional
        None unless given.

    Returns
    -------
    (n_freq, n, n) complex array
        Z_j for the relative motions of the pairs [N/m, N m/rad, …]: the mean of both off-diagonal blocks.

    Raises
    ------
    SubstructuringError
        As `couple_frf`.
    """
    frf = assembly.as_kind(FRFKind.RECEPTANCE)
    labels = [a for a, _ in connections] + [b for _, b in connections]
    _check_labels((frf,), connections)
    Y = frf.select(outputs=labels, inputs=labels).H
    n = len(connections)
    _condition(Y, labels, frf.frequency, regularisation)
    solver = regularisation or Regularisation()
    Z = solver.solve(Y, np.broadcast_to(np.eye(2 * n, dtype=complex), Y.shape))
    return -(Z[:, :n, n:] + Z[:, n:, :n]) / 2


def interface_problem(
    parts: FRF | Sequence[FRF], connections: Sequence[tuple[str, str]], *, removed: FRF | None = None
) -> tuple[Complexes, Complexes]:
    """Return the matrix that coupling and decoupling invert, and its right side: A = B Y Bᵀ and B Y.

    For `l_curve`, which shows how much to regularise.

    Parameters
    ----------
    parts : FRF or sequence of FRF
        As `couple_frf`; for decoupling the assembly.
    connections : sequence of (str, str)
    removed : FRF, optional
        The part that `decouple_frf` takes out.

    Returns
    -------
    A, B : (n_freq, n, n) and (n_freq, n, n_in) complex arrays
        Receptances of the n connections, and the motions that the inputs of all parts open there.

    Raises
    ------
    SubstructuringError
        As `couple_frf`.
    """
    kept = _receptances(parts)
    taken = () if removed is None else _receptances(removed)
    signs = (1.0,) * len(kept) + (-1.0,) * len(taken)
    _, A, opened = _interface(kept + taken, connections, signs)
    return A, opened


def _receptances(parts: FRF | Sequence[FRF]) -> tuple[FRF, ...]:
    given = (parts,) if isinstance(parts, FRF) else tuple(parts)
    return tuple(part.as_kind(FRFKind.RECEPTANCE) for part in given)


@dataclass(frozen=True, slots=True, eq=False)
class RegularisationCurve:
    """Hold residual and solution norms of an inversion against the amount of regularisation.

    Attributes
    ----------
    amount : (n,) array
        Relative to the largest singular value [-].
    residual, solution : (n,) arrays
        Root mean square over lines of ‖A X - B‖/‖B‖ and of ‖X‖ over its largest value [-].
    corner : float
        The amount at the point of greatest curvature in the double logarithmic picture.
    """

    amount: Floats
    residual: Floats
    solution: Floats
    corner: float


def l_curve(
    A: npt.ArrayLike, B: npt.ArrayLike, method: str = "tikhonov", amounts: npt.ArrayLike | None = None
) -> RegularisationCurve:
    """Return the L-curve of an inversion A X = B at many lines.

    Hansen, SIAM Review 34 (1992) 561-580.

    Parameters
    ----------
    A, B : (n_freq, n, n) and (n_freq, n, k) array_like
        For example the interface's receptances and the motions that forces must close.
    method : str
        ``"tikhonov"`` or ``"tsvd"``.
    amounts : array_like, optional
        At least five amounts to try; 10⁻⁸ to 0.5 unless given.

    Raises
    ------
    SubstructuringError
        If shapes do not fit, a value is not finite, A or B is zero, or the method or an amount is none.
    """
    A, B = np.asarray(A, dtype=complex), np.asarray(B, dtype=complex)
    if A.ndim != 3 or A.shape[1] != A.shape[2] or B.ndim != 3 or B.shape[:2] != A.shape[:2]:
        msg = f"A and B have shapes {A.shape} and {B.shape}; (n_freq, n, n) and (n_freq, n, k) are needed"
        raise SubstructuringError(msg)
    for name, array in (("A", A), ("B", B)):
        if not np.isfinite(array).all() or not array.any(axis=(1, 2)).all():
            msg = f"{name} holds a value that is not finite, or a line of zeros; there is nothing to invert"
            raise SubstructuringError(msg)
    if method not in ("tsvd", "tikhonov"):
        msg = f"the method is '{method}'; an L-curve is one of tsvd or tikhonov"
        raise SubstructuringError(msg)
    tried = np.geomspace(1e-8, 0.5, 60) if amounts is None else np.unique(np.asarray(amounts, dtype=float))
    if tried.size < 5 or not tried[0] > 0:
        least = f", the least {tried[0]:g}" if tried.size else ""
        msg = f"{tried.size} amounts are given{least}; at least five above zero are needed"
        raise SubstructuringError(msg)
    U, s, _ = np.linalg.svd(A)
    c = U.conj().mT @ B
    total = np.linalg.norm(B, axis=(1, 2))
    rows = []
    for amount in tried:
        kept = Regularisation(method, float(amount))._filter(s)
        x = np.linalg.norm(kept[:, :, None] * c, axis=(1, 2))
        r = np.linalg.norm((1 - kept * s)[:, :, None] * c, axis=(1, 2)) / total
        rows.append((np.sqrt((r**2).mean()), np.sqrt((x**2).mean())))
    residual, solution = np.array(rows).T
    solution = solution / solution.max()
    return RegularisationCurve(tried, residual, solution, _corner(tried, residual, solution))


def _corner(amount: Floats, residual: Floats, solution: Floats) -> float:
    x, y = np.log(np.maximum(residual, 1e-300)), np.log(solution)
    t = np.log(amount)
    dx, dy = np.gradient(x, t), np.gradient(y, t)
    ddx, ddy = np.gradient(dx, t), np.gradient(dy, t)
    bend = (dx * ddy - ddx * dy) / np.maximum((dx**2 + dy**2) ** 1.5, 1e-300)
    moving = (dx**2 + dy**2) > 1e-6
    return float(amount[int(np.argmax(np.where(moving, bend, -np.inf)))])


def _dual(
    parts: tuple[FRF, ...],
    connections: Sequence[tuple[str, str]],
    signs: tuple[float, ...],
    compliance: npt.ArrayLike | None,
    regularisation: Regularisation | None,
) -> Substructured:
    touched, A, opened = _interface(parts, connections, signs)
    frequency, n, n_freq = parts[0].frequency, len(connections), len(A)
    columns = np.cumsum([0] + [len(part.inputs) for part in parts])
    rows_of = np.cumsum([0] + [len(part.outputs) for part in parts])
    if compliance is not None:
        S = np.asarray(compliance, dtype=complex)
        if S.shape != A.shape:
            msg = f"compliance has shape {S.shape}; {A.shape} is needed: one row for each connection"
            raise SubstructuringError(msg)
        if not np.isfinite(S).all():
            msg = "compliance holds values that are not finite; leave out a connection that does not hold"
            raise SubstructuringError(msg)
        A = A + S
    names = [f"{a} = {b}" for a, b in connections]
    condition = _condition(A, names, frequency, regularisation)
    solver = regularisation or Regularisation()
    H = np.empty((n_freq, rows_of[-1], columns[-1]), dtype=complex)
    gap = np.zeros(n_freq)
    to_forces = [
        np.take(part.H, inn, axis=2) * (-s * sign)
        for part, (_, _, inn, sign), s in zip(parts, touched, signs, strict=True)
    ]
    for start in range(0, n_freq, _LINES):  # a few lines at a time stay in the processor's cache
        some = slice(start, start + _LINES)
        motions = opened[some]
        forces = solver.solve(A[some], motions)
        for k, (part, (rows, *_), s) in enumerate(zip(parts, touched, signs, strict=True)):
            block = H[some, rows_of[k] : rows_of[k + 1]]
            acting = forces if np.array_equal(rows, np.arange(n)) else forces[:, rows]
            np.matmul(to_forces[k][some], acting, out=block)
            block[:, :, columns[k] : columns[k + 1]] += part.H[some] if s == 1 else s * part.H[some]
        residual, size = _square(motions - A[some] @ forces), _square(motions)
        gap[some] = np.sqrt(np.divide(residual, size, out=np.zeros(len(size)), where=size > 0))
    outputs = tuple(label for part in parts for label in part.outputs)
    inputs = tuple(label for part in parts for label in part.inputs)
    frf = replace(parts[0], frequency=frequency, H=H, outputs=outputs, inputs=inputs)
    return Substructured(frf, condition, gap)


_Touched = tuple[Ints, Ints, Ints, Floats]


def _interface(
    parts: tuple[FRF, ...], connections: Sequence[tuple[str, str]], signs: tuple[float, ...]
) -> tuple[list[_Touched], Complexes, Complexes]:
    """Return the parts' FRFs at the interface, B Y Bᵀ and B Y."""
    if not parts:
        msg = "there are no parts; at least one is needed"
        raise SubstructuringError(msg)
    for k, part in enumerate(parts[1:], start=1):
        try:
            check_same_lines(part.frequency, parts[0].frequency, f"part {k}", "part 0")
        except ValueError as error:
            raise SubstructuringError(str(error)) from error
    _check_labels(parts, connections)
    n, n_freq = len(connections), parts[0].n_freq
    columns = np.cumsum([0] + [len(part.inputs) for part in parts])
    # per part: the rows of B that touch it, as response and input positions with signs
    touched = [_touched(part, connections) for part in parts]
    opened = np.zeros((n_freq, n, columns[-1]), dtype=complex)
    A = np.zeros((n_freq, n, n), dtype=complex)
    for k, (part, places, s) in enumerate(zip(parts, touched, signs, strict=True)):
        of_part = opened[:, :, columns[k] : columns[k + 1]]
        for row, out, _, sign in zip(*places, strict=True):
            of_part[:, row] += s * sign * part.H[:, out]
        for row, _, inn, sign in zip(*places, strict=True):
            A[:, :, row] += sign * of_part[:, :, inn]
    return touched, A, opened


def _square(values: Complexes) -> Floats:
    """Return the sum of |values|² at each line, (n_lines,)."""
    flat = values.reshape(len(values), -1).view(float)
    return np.vecdot(flat, flat)


def _touched(part: FRF, connections: Sequence[tuple[str, str]]) -> _Touched:
    place_out = {label: i for i, label in enumerate(part.outputs)}
    place_in = {label: i for i, label in enumerate(part.inputs)}
    found = [
        (row, place_out[label], place_in[label], sign)
        for row, pair in enumerate(connections)
        for label, sign in zip(pair, (1.0, -1.0), strict=True)
        if label in place_out
    ]
    rows, out, inn, sign = zip(*found, strict=True) if found else ((), (), (), ())
    positions = [np.array(values, dtype=np.int64) for values in (rows, out, inn)]
    return positions[0], positions[1], positions[2], np.array(sign, dtype=float)


def _check_labels(parts: tuple[FRF, ...], connections: Sequence[tuple[str, str]]) -> None:
    if not connections:
        msg = "there are no connections; at least one pair of labels is needed"
        raise SubstructuringError(msg)
    for pair in connections:
        if isinstance(pair, str) or len(pair) != 2:
            msg = f"the connection {pair!r} is no pair of labels, such as ('A3z', 'B1z')"
            raise SubstructuringError(msg)
    outputs = [label for part in parts for label in part.outputs]
    inputs = [label for part in parts for label in part.inputs]
    for word, labels in (("response", outputs), ("input", inputs)):
        twice = {label for label in labels if labels.count(label) > 1}
        if twice:
            msg = f"the {word} '{min(twice)}' occurs in two parts; give their labels different names"
            raise SubstructuringError(msg)
        for pair in connections:
            for label in pair:
                if label not in labels:
                    msg = f"'{label}' is no {word} of any part; there are {', '.join(labels[:12])}"
                    raise SubstructuringError(msg)
    for k, pair in enumerate(connections):
        if pair[0] == pair[1] or any(set(pair) == set(other) for other in connections[:k]):
            msg = f"the connection {pair} joins a DOF to itself or occurs twice"
            raise SubstructuringError(msg)


def _condition(
    A: Complexes,
    names: Sequence[str],
    frequency: Floats,
    regularisation: Regularisation | None,
) -> Floats:
    size = np.sqrt(np.maximum(np.abs(np.einsum("fii->fi", A)), 1e-300))
    scaled = A / size[:, :, None] / size[:, None, :]
    s = np.linalg.svd(scaled, compute_uv=False)
    condition = np.divide(s[:, 0], s[:, -1], out=np.full(len(s), np.inf), where=s[:, -1] > 0)
    # Condition number from which an interface counts as singular: its motions depend on one another
    if (condition > 1e13).any() and (regularisation is None or regularisation.method == "none"):
        line = int(np.argmax(condition))
        null = np.abs(np.linalg.svd(scaled[line])[2][-1])
        words = ", ".join(
            names[i] for i in sorted(range(len(null)), key=lambda i: -null[i])[:4] if null[i] > 0.2
        )
        msg = (
            f"the interface is singular at {frequency[line]:g} Hz (condition {condition[line]:.0e}): its "
            f"motions {words} depend on one another; leave some out, or give a Regularisation"
        )
        raise SubstructuringError(msg)
    return condition


# Couple substructures through joints by their receptances, and take a joint out again -----------------------


@dataclass(frozen=True, slots=True, eq=False)
class AssemblyFRF:
    """Hold the receptances of an assembly.

    x_n = H_nn f_n + H_nj f_j,  x_j = H_jn f_n + H_jj f_j

    Attributes
    ----------
    frequency : (n_freq,) array
        Lines [Hz].
    interface : Interface
        M internal outputs, L internal inputs, N joint coordinates: those of the substructures.
    H_nn, H_nj, H_jn, H_jj : (n_freq, M, L), (n_freq, M, N), (n_freq, N, L), (n_freq, N, N) complex arrays
        Receptances x/f [m/N, rad/N, m/(N m), rad/(N m)], e^{+iωt}.
    """

    frequency: Floats
    interface: Interface
    H_nn: Complexes
    H_nj: Complexes
    H_jn: Complexes
    H_jj: Complexes

    def __post_init__(self) -> None:
        for name in ("frequency", "H_nn", "H_nj", "H_jn", "H_jj"):
            object.__setattr__(self, name, frozen_copy(getattr(self, name)))


def joint_impedance(
    frequency: npt.ArrayLike,
    K: npt.ArrayLike,
    M: npt.ArrayLike | None = None,
    C: npt.ArrayLike | None = None,
    D: npt.ArrayLike | None = None,
) -> Complexes:
    """Return the dynamic stiffness of a joint.

    Z_j(ω) = K - ω² M + iω C + i D,  ω = 2π f

    Soleimanian, Tizfahm & Sadeghi (2011), eq. (27), with structural damping D as in their eq. (24).

    Parameters
    ----------
    frequency : (n_freq,) array_like
        Lines [Hz].
    K, M, C, D : (n, n) array_like
        Stiffness [N/m, N m/rad], mass [kg, kg m²], viscous damping [N s/m, N m s/rad] and structural
        damping [N/m, N m/rad]. None means zero.

    Returns
    -------
    (n_freq, n, n) complex array
        f = Z_j x at the joint's coordinates.

    Raises
    ------
    ValueError
        If a matrix is not square, not of the size of `K`, or not finite.
    """
    lines = as_frequency(frequency)
    n = len(np.atleast_1d(np.asarray(K)))
    K, M, C, D = (as_square(matrix, name, n) for matrix, name in ((K, "K"), (M, "M"), (C, "C"), (D, "D")))
    omega = (2 * np.pi * lines)[:, None, None]
    return K - omega**2 * M + 1j * (omega * C + D)


def couple(substructures: SubstructureFRF, Z_j: npt.ArrayLike) -> AssemblyFRF:
    """Join substructures by a joint system.

    H_jn = (I + H_bb Z_j)⁻¹ H_ba            H_nn = H_aa - H_ab Z_j H_jn
    H_jj = (I + H_bb Z_j)⁻¹ H_bb            H_nj = H_ab (I + Z_j H_bb)⁻¹

    Soleimanian, Tizfahm & Sadeghi (2011), eqs. (12)-(15). With (I + Z H)⁻¹ Z = Z (I + H Z)⁻¹ the rows of
    (13) and (15) need no difference of nearly equal terms when the joint is stiff.

    Parameters
    ----------
    substructures : SubstructureFRF
        All substructures side by side (`stack_substructures`).
    Z_j : (n_freq, N, N) array_like
        Dynamic stiffness of the joint system, in the order of `substructures.interface.joint`
        (`joint_impedance`, `stack_joints`) [N/m, N/rad, N m/m, N m/rad].

    Returns
    -------
    AssemblyFRF

    Raises
    ------
    ValueError
        If `Z_j` does not fit the joint coordinates or is not finite.
    numpy.linalg.LinAlgError
        If I + H_bb Z_j is singular: an undamped resonance of the assembly lies exactly on a line.
    """
    joint = substructures.interface.joint.labels
    Z = as_lines(Z_j, "Z_j", substructures.frequency, joint, joint)
    H_aa, H_ab = substructures.H_aa, substructures.H_ab
    H_ba, H_bb = substructures.H_ba, substructures.H_bb
    unit = np.eye(len(joint))
    H_jn = solve_lines(unit + H_bb @ Z, H_ba)
    return AssemblyFRF(
        substructures.frequency,
        substructures.interface,
        H_nn=H_aa - H_ab @ (Z @ H_jn),
        H_nj=solve_lines((unit + Z @ H_bb).mT, H_ab.mT).mT,
        H_jn=H_jn,
        H_jj=solve_lines(unit + H_bb @ Z, H_bb),
    )


def decouple(assembly: AssemblyFRF, Z_j: npt.ArrayLike) -> SubstructureFRF:
    """Take a known joint system out of an assembly, which is to couple its negative.

    From (15), H_bb⁻¹ = H_jj⁻¹ - Z_j; Z_j = Z + (-Z) = 0 leaves the substructures of (12)-(15).

    Errors grow by up to ‖I + Z_j H_bb‖ squared in H_bb: motion that a stiff joint hides is not recovered.

    Parameters
    ----------
    assembly : AssemblyFRF
        The joined structure.
    Z_j : (n_freq, N, N) array_like
        Dynamic stiffness to take out, in the order of `assembly.interface.joint`.

    Returns
    -------
    SubstructureFRF

    Raises
    ------
    ValueError
        If `Z_j` does not fit the joint coordinates or is not finite.
    """
    joined = SubstructureFRF(
        assembly.frequency,
        assembly.interface,
        assembly.H_nn,
        assembly.H_nj,
        assembly.H_jn,
        assembly.H_jj,
    )
    free = couple(joined, -np.asarray(Z_j, dtype=complex))
    return SubstructureFRF(free.frequency, free.interface, free.H_nn, free.H_nj, free.H_jn, free.H_jj)
