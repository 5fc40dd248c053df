"""Forms of a joint: the parameters of its dynamic stiffness, and their matrices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from itertools import combinations_with_replacement, pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from fem.array_types import Bools, Complexes, Floats, Ints
from fem.laws import FractionalKelvinVoigt, FractionalZener, Zener
from fem.summary import fields_summary
from joint._checks import frozen_copy
from joint.interface import CoordinateSet

LAWS = {"zener": Zener, "fractional_kelvin_voigt": FractionalKelvinVoigt, "fractional_zener": FractionalZener}
"""Viscoelastic laws by name."""

KINDS = ("K", "M", "C", "D", *LAWS)
"""How a term depends on frequency: stiffness, mass, viscous or structural damping, viscoelastic."""

_BOUNDS = {"ratio": (1e-4, 1e4), "tau": (1e-9, 1e3), "alpha": (0.02, 1.0)}
_STEP = 1e-200


class FormError(ValueError):
    """A form that a joint cannot have; the message names the term and the terms allowed."""


@dataclass(frozen=True, slots=True)
class Term:
    """One summand of a joint's dynamic stiffness: a matrix times a number that depends on frequency.

    Attributes
    ----------
    name : str
        Such as ``"K x x"``.
    kind : str
        One of `KINDS`: θ, -ω² θ, iω θ, i θ, or θ law(ω) with the law's own parameters after it.
    matrix : int
        Which of the form's matrices it multiplies.
    unit : str
        SI unit of θ.
    """

    name: str
    kind: str
    matrix: int
    unit: str

    @property
    def parameters(self) -> tuple[tuple[str, str], ...]:
        """Names and units of its parameters."""
        if self.kind not in LAWS:
            return ((self.name, self.unit),)
        units = {"ratio": "-", "tau": "s", "alpha": "-"}
        inner = tuple((f"{self.name} {f.name}", units[f.name]) for f in fields(LAWS[self.kind]))
        return ((self.name, self.unit), *inner)

    def factor(self, omega: Floats, theta: Sequence[Any] | Floats) -> npt.NDArray[Any]:
        """Return the factor of the matrix at ω, (n_freq,)."""
        if self.kind in LAWS:
            storage, loss = LAWS[self.kind](*theta[1:])(omega)
            return np.real(theta[0]) * (np.real(storage) + 1j * np.real(loss))
        return theta[0] * _unit_factor(self.kind, omega)

    def slopes(self, omega: Floats, theta: Sequence[float] | Floats) -> Complexes:
        """Return the derivatives of `factor` by its parameters, (n, n_freq); exact, by complex steps."""
        if self.kind not in LAWS:
            return _unit_factor(self.kind, omega)[None]
        law = LAWS[self.kind]
        storage, loss = law(*theta[1:])(omega)
        rows = [storage + 1j * loss]
        for i in range(1, len(theta)):
            at = [value + (1j * _STEP if k == i else 0.0) for k, value in enumerate(theta)]
            storage, loss = law(*at[1:])(omega)
            rows.append(theta[0] * (np.imag(storage) + 1j * np.imag(loss)) / _STEP)
        return np.array(rows)


def _unit_factor(kind: str, omega: Floats) -> Complexes:
    powers = {"K": np.ones_like(omega), "M": -(omega**2), "C": 1j * omega, "D": 1j * np.ones_like(omega)}
    return powers[kind].astype(complex)


@dataclass(frozen=True, slots=True, eq=False)
class JointForm:
    """A joint's dynamic stiffness as a function of parameters θ: Z_j(ω; θ) = Σ factor(ω; θ) T.

    Attributes
    ----------
    coordinates : CoordinateSet
        The N joint coordinates.
    terms : tuple of Term
    matrices : (n_matrices, N, N) array
        The different T, real: symmetric for a reciprocal joint.
    """

    coordinates: CoordinateSet
    terms: tuple[Term, ...]
    matrices: Floats

    __repr__ = fields_summary

    def __post_init__(self) -> None:
        n = len(self.coordinates)
        if self.matrices.ndim != 3 or self.matrices.shape[1:] != (n, n) or not self.terms:
            msg = (
                f"the form has {len(self.terms)} terms and matrices of shape {self.matrices.shape}; "
                f"(n_matrices, {n}, {n}) and at least one term are needed"
            )
            raise FormError(msg)
        names = [name for name, _ in self.parameters]
        twice = {name for name in names if names.count(name) > 1}
        if twice:
            msg = f"the parameter '{min(twice)}' occurs twice; names must differ"
            raise FormError(msg)
        object.__setattr__(self, "matrices", frozen_copy(self.matrices))

    @property
    def parameters(self) -> tuple[tuple[str, str], ...]:
        """Names and units of all parameters, in the order of θ."""
        return tuple(p for term in self.terms for p in term.parameters)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters, in the order of θ."""
        return tuple(name for name, _ in self.parameters)

    @property
    def linear(self) -> bool:
        """True without viscoelastic terms: Z_j is then a linear function of θ."""
        return all(term.kind not in LAWS for term in self.terms)

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Least and greatest value of each parameter: only those of viscoelastic laws have any."""
        limits = [_BOUNDS.get(name.rpartition(" ")[2], (-np.inf, np.inf)) for name in self.names]
        return np.array([lo for lo, _ in limits]), np.array([hi for _, hi in limits])

    @property
    def positive(self) -> Bools:
        """Mark the parameters that are positive and fitted as logarithms: those of viscoelastic terms."""
        marks = [
            term.kind in LAWS and not name.endswith(" alpha")
            for term in self.terms
            for name, _ in term.parameters
        ]
        return np.array(marks, dtype=bool)

    @property
    def semidefinite(self) -> Bools:
        """Mark the parameters whose matrices are positive semidefinite: those on a diagonal."""
        least = np.linalg.eigvalsh((self.matrices + self.matrices.mT) / 2)[:, 0]
        marked = least >= -1e-9 * np.linalg.norm(self.matrices, axis=(1, 2))
        marks = [
            bool(marked[term.matrix]) and k == 0 for term in self.terms for k in range(len(term.parameters))
        ]
        return np.array(marks, dtype=bool)

    def starts(self, theta: npt.ArrayLike, frequency: Floats) -> list[Floats]:
        """Return points from which to start: θ with NaN replaced by usual values of viscoelastic laws.

        Parameters
        ----------
        theta : (n,) array_like
            NaN where a law's own parameter is not known.
        frequency : (n_freq,) array
            Lines [Hz]; relaxation times start at one over their lowest, middle and highest ω.
        """
        try:
            theta = np.array(theta, dtype=float)
        except (TypeError, ValueError) as error:
            msg = f"start is {theta!r}; numbers in the order of the form's names are needed"
            raise FormError(msg) from error
        if theta.shape != (len(self.names),):
            first = ", ".join(self.names[:6])
            msg = f"start has shape {theta.shape}; {len(self.names)} finite values are needed: {first} …"
            raise FormError(msg)
        asked = np.flatnonzero(np.isnan(theta))
        words = [self.names[i].rpartition(" ")[2] for i in asked]
        lines = frequency[frequency > 0]
        times = 1 / (2 * np.pi * np.geomspace(lines[0], lines[-1], 3)) if "tau" in words else [0.0]
        out = []
        for tau in times:
            start = theta.copy()
            start[asked] = [{"ratio": 1.0, "tau": float(tau), "alpha": 0.5}.get(w, np.nan) for w in words]
            out.append(start)
        return out

    def coefficients(self, omega: Floats, theta: Floats) -> Complexes:
        """Return the factor of each matrix, (n_matrices, n_freq)."""
        out = np.zeros((len(self.matrices), omega.size), dtype=complex)
        for term, at in zip(self.terms, self._slices(), strict=True):
            out[term.matrix] += term.factor(omega, theta[at])
        return out

    def slopes(self, omega: Floats, theta: Floats) -> tuple[Complexes, Ints]:
        """Return derivatives of the coefficients, (n, n_freq), and which matrix each belongs to, (n,)."""
        rows, which = [], []
        for term, at in zip(self.terms, self._slices(), strict=True):
            rows.append(term.slopes(omega, theta[at]))
            which += [term.matrix] * len(rows[-1])
        return np.vstack(rows), np.array(which, dtype=np.int64)

    def _slices(self) -> list[slice]:
        ends = np.cumsum([0] + [len(term.parameters) for term in self.terms])
        return [slice(int(a), int(b)) for a, b in pairwise(ends)]

    def Z(self, frequency: npt.ArrayLike, theta: npt.ArrayLike) -> Complexes:
        """Return the dynamic stiffness f/x, (n_freq, N, N) [N/m, N/rad, N m/m, N m/rad].

        Parameters
        ----------
        frequency : (n_freq,) array_like
            Lines [Hz].
        theta : (n,) array_like
            Values of the parameters, in their order and units.
        """
        omega = 2 * np.pi * np.atleast_1d(np.asarray(frequency, dtype=float))
        coefficients = self.coefficients(omega, np.asarray(theta, dtype=float))
        return np.einsum("uf,uij->fij", coefficients, self.matrices, optimize=True)

    def matrix(self, kind: str, theta: npt.ArrayLike) -> Floats:
        """Return K, M, C or D, (N, N): the sum of the terms of one kind."""
        theta = np.asarray(theta, dtype=float)
        out = np.zeros(self.matrices.shape[1:])
        for term, at in zip(self.terms, self._slices(), strict=True):
            if term.kind == kind:
                out += theta[at][0] * self.matrices[term.matrix]
        return out

    def values_of(self, **matrices: npt.ArrayLike) -> Floats:
        """Return θ for given K, M, C, D (N, N) by least squares; terms of other kinds get zero.

        Raises
        ------
        FormError
            If a matrix is not of this form.
        """
        theta = np.zeros(len(self.parameters))
        for kind, given in matrices.items():
            X = np.asarray(given, dtype=float)
            rows = [
                (at.start, term.matrix)
                for term, at in zip(self.terms, self._slices(), strict=True)
                if term.kind == kind
            ]
            basis = np.array([self.matrices[m].ravel() for _, m in rows]).T.reshape(X.size, len(rows))
            found = np.linalg.lstsq(basis, X.ravel(), rcond=None)[0] if rows else np.zeros(0)
            if np.abs(basis @ found - X.ravel()).max() > 1e-9 * max(np.abs(X).max(), 1e-300):
                msg = f"{kind} is not of the form that its {len(rows)} terms allow"
                raise FormError(msg)
            theta[[i for i, _ in rows]] = found
        return theta

    def with_term(self, name: str, kind: str, matrix: npt.ArrayLike, unit: str = "") -> JointForm:
        """Return a form with one more term.

        Raises
        ------
        FormError
            For an unknown kind, or a matrix that is not (N, N) and finite.
        """
        T = np.asarray(matrix, dtype=float)
        if kind not in KINDS:
            msg = f"the kind of the term '{name}' is '{kind}'; allowed are {', '.join(KINDS)}"
            raise FormError(msg)
        if T.shape != self.matrices.shape[1:] or not np.isfinite(T).all() or not T.any():
            n = len(self.coordinates)
            msg = (
                f"the matrix of the term '{name}' has shape {T.shape}; "
                f"({n}, {n}), finite and not zero, is needed"
            )
            raise FormError(msg)
        same = [k for k, known in enumerate(self.matrices) if np.array_equal(known, T)]
        matrices = self.matrices if same else np.concatenate([self.matrices, T[None]])
        term = Term(name, kind, same[0] if same else len(self.matrices), unit)
        return replace(self, terms=(*self.terms, term), matrices=matrices)

    def basis(self, length: float = 1.0) -> Floats:
        """Return an orthonormal basis (N, p) of the directions in which the joint acts.

        Parameters
        ----------
        length : float
            Characteristic length by which rotations are scaled [m]; the basis is that of x / scale.
        """
        scale = np.where(self.coordinates.rotational, 1 / length, 1.0)
        T = scale[:, None] * self.matrices * scale
        T = T / np.linalg.norm(T, axis=(1, 2), keepdims=True)
        U, s, _ = np.linalg.svd(np.concatenate([*T, *T.mT], axis=1))
        return U[:, : int((s > 1e-9 * s[0]).sum())] / scale[:, None]


def full_form(
    coordinates: CoordinateSet,
    kinds: Sequence[str] = "KMCD",
    *,
    reciprocal: bool = True,
    pattern: npt.ArrayLike | None = None,
) -> JointForm:
    """Return the form of a joint whose matrices have any entries at its coordinates.

    Soleimanian, Tizfahm & Sadeghi (2011), eqs. (22)-(24): 4 N² unknowns, or 4 N (N + 1)/2 if reciprocal.

    Parameters
    ----------
    coordinates : CoordinateSet
    kinds : sequence of str
        Which of K, M, C, D it has; without M it is massless.
    reciprocal : bool
        Whether the matrices are symmetric.
    pattern : (N, N) array_like of bool, optional
        Entries that may differ from zero; all of them unless given.

    Raises
    ------
    FormError
        For an unknown kind, or a pattern that leaves nothing.
    """
    n = len(coordinates)
    allowed = _pattern(pattern, n)
    return _of_units(
        coordinates, np.eye(n), coordinates.labels, coordinates.rotational, kinds, reciprocal, allowed
    )


def _pattern(pattern: npt.ArrayLike | None, n: int) -> Bools:
    """Return which entries (n, n) may differ from zero, all unless given."""
    allowed = np.ones((n, n), dtype=bool) if pattern is None else np.asarray(pattern, dtype=bool)
    if allowed.shape != (n, n) or not allowed.any():
        msg = f"the pattern has shape {allowed.shape}; ({n}, {n}) with at least one entry is needed"
        raise FormError(msg)
    return allowed


def relative_form(
    coordinates: CoordinateSet,
    B: npt.ArrayLike,
    kinds: Sequence[str] = "KCD",
    *,
    pattern: npt.ArrayLike | None = None,
    names: Sequence[str] = ("x", "y", "z", "rx", "ry", "rz"),
) -> JointForm:
    """Return the form of a reciprocal joint that resists relative motions q = B x only: Z_j = Bᵀ z B.

    A rigid motion of everything costs nothing, so that the matrices are rigid-body-consistent.

    Parameters
    ----------
    coordinates : CoordinateSet
        The N coordinates x.
    B : (p, N) array_like
        Relative motions, such as `relative_coordinates`.
    kinds : sequence of str
        Which of K, C, D it has; masses are no function of relative motions: add them with `with_masses`.
    pattern : (p, p) array_like of bool, optional
        Entries of z that may differ from zero; ``np.eye(p)`` for a joint without coupling.
    names : sequence of str
        Names of the p relative motions; those that start with r are rotations.

    Raises
    ------
    FormError
        For an unknown kind, shapes that do not fit, or a pattern that leaves nothing.
    """
    B = np.asarray(B, dtype=float)
    names = tuple(names)
    if B.ndim != 2 or B.shape != (len(names), len(coordinates)) or not np.isfinite(B).all():
        msg = f"B has shape {B.shape}; ({len(names)}, {len(coordinates)}), finite, is needed"
        raise FormError(msg)
    turn = np.array([name.startswith("r") for name in names])
    return _of_units(coordinates, B, names, turn, kinds, True, _pattern(pattern, len(names)))


def with_masses(form: JointForm, places: npt.ArrayLike) -> JointForm:
    """Return a form with a rigid body's mass and inertias Jx, Jy, Jz about global axes, shared by the sides.

    Parameters
    ----------
    form : JointForm
        Whose coordinates are x y z rx ry rz of each of some nodes.
    places : (n_nodes, 3) array_like
        From each node to the joint point [m].

    Raises
    ------
    FormError
        If the coordinates are not all six of every node.
    """
    arms = np.atleast_2d(np.asarray(places, dtype=float))
    nodes = list(dict.fromkeys(label.rpartition(":")[0] for label in form.coordinates.labels))
    wanted = tuple(f"{node}:{d}" for node in nodes for d in ("x", "y", "z", "rx", "ry", "rz"))
    if form.coordinates.labels != wanted or arms.shape != (len(nodes), 3):
        msg = (
            f"masses need x y z rx ry rz of each node in order and an arm for each; there are {len(nodes)} "
            f"nodes, {len(form.coordinates)} coordinates and {len(arms)} arms"
        )
        raise FormError(msg)
    n = 6 * len(nodes)
    for name, rows in (("m", (0, 1, 2)), ("Jx", (3,)), ("Jy", (4,)), ("Jz", (5,))):
        T = np.zeros((n, n))
        for k, arm in enumerate(arms):
            carry = np.eye(6)
            carry[:3, 3:] = -np.cross(np.eye(3), arm)  # u' = u + θ × arm
            part = carry.T[:, list(rows)] @ carry[list(rows)]
            T[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] = part / len(nodes)
        form = form.with_term(name, "M", T, "kg" if name == "m" else "kg m²")
    return form


def _of_units(
    coordinates: CoordinateSet,
    B: Floats,
    names: Sequence[str],
    turn: Bools,
    kinds: Sequence[str],
    reciprocal: bool,
    allowed: Bools,
) -> JointForm:
    unknown = [kind for kind in kinds if kind not in KINDS]
    if unknown or not len(kinds):
        msg = f"the kinds of terms are {list(kinds)}; allowed are {', '.join(KINDS)}"
        raise FormError(msg)
    p = len(names)
    if reciprocal:
        allowed = allowed | allowed.T
        entries = [(i, j) for i, j in combinations_with_replacement(range(p), 2) if allowed[i, j]]
    else:
        entries = [(i, j) for i in range(p) for j in range(p) if allowed[i, j]]
    matrices = []
    for i, j in entries:
        T = np.outer(B[i], B[j])
        matrices.append(T + T.T if reciprocal and i != j else T)
    terms = tuple(
        Term(f"{kind} {names[i]} {names[j]}", kind, k, _unit(kind, bool(turn[i]), bool(turn[j])))
        for kind in kinds
        for k, (i, j) in enumerate(entries)
    )
    return JointForm(coordinates, terms, np.array(matrices))


def _unit(kind: str, row: bool, column: bool) -> str:
    force, motion = ("N m" if row else "N"), ("rad" if column else "m")
    if kind == "M":
        return {0: "kg", 1: "kg m", 2: "kg m²"}[int(row) + int(column)]
    return f"{force} s/{motion}" if kind == "C" else f"{force}/{motion}"
