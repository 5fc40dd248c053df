"""Places of sensors and exciters, chosen before a test, and the modes that they cannot observe."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import scipy.linalg as sla
from numpy.typing import ArrayLike, NDArray

from fem.analysis.modes import Modes
from fem.array_types import Floats, Ints
from fem.model import Model
from fem.summary import fields_summary
from updating.correlation.shape_correlation import auto_mac
from updating.measurement.measurement import Sensor

Candidates = Sequence[tuple[int, str]]

_AXES = ("x", "y", "z")
_FULL_RANK = 1e-10
"""Singular values below this part of the largest mean that candidates cannot tell the modes apart."""


def effective_independence(phi: ArrayLike) -> Floats:
    """Compute the contribution of each DOF to the independence of the shapes, diag(Φ (ΦᵀΦ)⁻¹ Φᵀ).

    Kammer, J. Guid. Control Dyn. 14, 1991, 251-259. Without a DOF of value E the determinant of Fisher's
    information matrix ΦᵀΦ is (1 - E) times as large; at 1 the shapes depend on one another without it. The
    sum is the number of modes. The scale of each mode does not matter.

    Parameters
    ----------
    phi : array_like (n_dof, n_modes)
        Real shapes at the candidate DOFs.

    Returns
    -------
    ndarray (n_dof,)
        0 to 1.

    Raises
    ------
    ValueError
        If the DOFs cannot tell the modes apart.
    """
    return (_orthonormal(_real(phi)) ** 2).sum(axis=1)


def place_by_effective_independence(phi: ArrayLike, n_sensors: int, keep: ArrayLike = ()) -> Ints:
    """Choose DOFs by leaving out the one with the least effective independence until enough are left.

    Kammer, 1991: it keeps the determinant of ΦᵀΦ large, hence errors of the modal coordinates small under
    noise that is equal at all sensors. It is greedy, so not always the best set; and it does not ask for
    large motion, nor distinct MAC: neighbouring points may be chosen on fine meshes.

    Parameters
    ----------
    phi : array_like (n_candidates, n_modes)
        Real shapes at the candidates.
    n_sensors : int
        At least the number of modes, at most that of candidates.
    keep : array_like of int
        Candidates that are in the set anyway.

    Returns
    -------
    ndarray of int (n_sensors,)
        Rows of ``phi``, rising.

    Raises
    ------
    ValueError
        If numbers do not fit, or the candidates cannot tell the modes apart.
    """
    phi = _real(phi)
    kept = _checked(phi, n_sensors, keep)
    if n_sensors < phi.shape[1]:
        n = phi.shape[1]
        msg = f"{n_sensors} sensors cannot distinguish {n} modes; at least as many sensors are needed"
        raise ValueError(msg)
    remaining = np.arange(len(phi))
    Q = _orthonormal(phi)
    inverse, E = np.eye(Q.shape[1]), (Q**2).sum(axis=1)
    for step in range(len(phi) - n_sensors):
        # Candidates taken out between two fresh factorisations, against rounding
        if step and step % 50 == 0:
            Q = _orthonormal(phi[remaining])
            inverse, E = np.eye(Q.shape[1]), (Q**2).sum(axis=1)
        worst = int(np.argmin(np.where(np.isin(remaining, kept), np.inf, E)))
        v, rest = inverse @ Q[worst], max(1 - E[worst], 1e-12)
        inverse = inverse + np.outer(v, v) / rest
        E = np.delete(E + (Q @ v) ** 2 / rest, worst)
        remaining, Q = np.delete(remaining, worst), np.delete(Q, worst, axis=0)
    return remaining


def place_by_auto_mac(phi: ArrayLike, n_sensors: int, keep: ArrayLike = ()) -> Ints:
    """Choose DOFs so that the largest MAC between different modes is small.

    Begins with a QR factorisation with pivots, adds the DOF that makes the largest off-diagonal MAC least
    (Carne and Dohrmann, IMAC XIII, 1995, 927-933), then exchanges single DOFs as long as that lowers it. The
    result is optimal against single exchanges, not against all sets. It does not ask for large motion: see
    :func:`assess_sensors`.

    Parameters
    ----------
    phi : array_like (n_candidates, n_modes)
        Real shapes at the candidates.
    n_sensors : int
        At most the number of candidates.
    keep : array_like of int
        Candidates that are in the set anyway.

    Returns
    -------
    ndarray of int (n_sensors,)
        Rows of ``phi``, rising.

    Raises
    ------
    ValueError
        If numbers do not fit.
    """
    shapes = _real(phi)
    kept = _checked(shapes, n_sensors, keep)
    unit = shapes / _lengths(shapes)
    chosen = list(kept)
    order = sla.qr(unit.T, mode="r", pivoting=True)[1]
    for i in order[: min(unit.shape)]:
        if len(chosen) < min(n_sensors, unit.shape[1]) and i not in chosen:
            chosen.append(int(i))
    while len(chosen) < n_sensors:
        value = _largest_if_added(unit, chosen)
        chosen.append(int(np.argmin(value)))
    best = _largest(auto_mac(unit[chosen]))
    improved = True
    while improved:
        improved = False
        for k, i in enumerate(chosen):
            if i in kept:
                continue
            others = chosen[:k] + chosen[k + 1 :]
            value = _largest_if_added(unit, others)
            j = int(np.argmin(value))
            if value[j] < best - 1e-9:
                chosen[k], best, improved = j, float(value[j]), True
    return np.sort(np.array(chosen, dtype=np.int64))


def driving_point_residues(phi: ArrayLike, frequency: ArrayLike) -> Floats:
    """Compute the modulus of the residue of each mode in the receptance at each driving point, φ²/(2ω).

    The receptance of a lightly damped mass-normalised mode of natural frequency ω_r is φ² / (2iω_r (iω - s))
    near its pole s; Ewins, *Modal Testing*, 2000, ch. 2. Where it is small an exciter does not drive the
    mode.

    Parameters
    ----------
    phi : array_like (n_dof, n_modes)
        Mass-normalised shapes [1/√kg].
    frequency : array_like (n_modes,)
        Natural frequencies, positive [Hz].

    Returns
    -------
    ndarray (n_dof, n_modes)
        [s/kg].

    Raises
    ------
    ValueError
        If numbers do not fit, or a frequency is not positive.
    """
    phi = _real(phi)
    f = _frequencies(frequency, phi.shape[1])
    return phi**2 / (4 * np.pi * f)


def place_exciters(phi: ArrayLike, frequency: ArrayLike, n_exciters: int, keep: ArrayLike = ()) -> Ints:
    """Choose driving points so that the mode that is driven worst is driven as well as possible.

    Residues are taken relative to the largest that any candidate has in the mode and summed over the
    exciters, at most 1. Points are added one after another and then exchanged one by one, as long as the
    worst mode gains, or with equal worst modes the second worst, and so on.

    Parameters
    ----------
    phi : array_like (n_candidates, n_modes)
        Mass-normalised shapes.
    frequency : array_like (n_modes,)
        Natural frequencies, positive [Hz].
    n_exciters : int
    keep : array_like of int
        Candidates that are in the set anyway.

    Returns
    -------
    ndarray of int (n_exciters,)
        Rows of ``phi``, those to keep first.

    Raises
    ------
    ValueError
        If numbers do not fit.
    """
    residues = driving_point_residues(phi, frequency)
    _lengths(residues)
    kept = _checked(residues, n_exciters, keep)
    chosen = list(kept)
    relative = residues / np.maximum(residues.max(axis=0), np.finfo(float).tiny)

    def best_with(others: list[int]) -> tuple[int, tuple[float, ...]]:
        """Return the best candidate to join others, and how far they drive the modes, the worst first."""
        together = np.round(np.sort(np.minimum(relative + relative[others].sum(axis=0), 1.0), axis=1), 9)
        i = next(int(i) for i in np.lexsort(together.T[::-1])[::-1] if i not in others)
        return i, tuple(together[i].tolist())

    while len(chosen) < n_exciters:
        chosen.append(best_with(chosen)[0])
    reached = tuple(np.round(np.sort(np.minimum(relative[chosen].sum(axis=0), 1.0)), 9).tolist())
    improved = True
    while improved:
        improved = False
        for k in range(len(kept), n_exciters):
            i, level = best_with(chosen[:k] + chosen[k + 1 :])
            if level > reached:
                chosen[k], reached, improved = i, level, True
    return np.array(chosen, dtype=np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Observability:
    """Observability of modes by a set of sensors.

    Attributes
    ----------
    seen : ndarray (n_modes,)
        Σφ² at the sensors over that at as many candidates where the mode moves most, 0 to 1 [-].
    auto_mac : ndarray (n_modes, n_modes)
        Of the shapes at the sensors.
    rank : int
        Number of modes that the sensors tell apart but for rounding.
    condition : float
        Condition number of the shapes at the sensors, each of unit length over all candidates [-]; infinite
        below full rank. Noise may be enlarged by it when modal coordinates are found.
    poorly_seen : tuple of int
        Modes with ``seen`` below the limit, counted from 0.
    confused : tuple of (int, int, float)
        Pairs of modes whose MAC at the sensors is above the limit, and it, worst first.
    """

    seen: Floats
    auto_mac: Floats
    rank: int
    condition: float
    poorly_seen: tuple[int, ...]
    confused: tuple[tuple[int, int, float], ...]

    __repr__ = fields_summary

    @property
    def largest_off_diagonal(self) -> float:
        """The largest MAC between different modes [-]."""
        return _largest(self.auto_mac)


def assess_sensors(
    phi: ArrayLike, chosen: ArrayLike, least_seen: float = 0.1, most_alike: float = 0.25
) -> Observability:
    """List the weaknesses of a set of sensors: modes that hardly move them, and pairs that they confuse.

    Parameters
    ----------
    phi : array_like (n_candidates, n_modes)
        Real shapes at the candidates, in one unit.
    chosen : array_like of int
        Rows where the sensors are.
    least_seen : float
        Modes below this part of the most visible motion are named [-].
    most_alike : float
        Pairs above this MAC are named [-].

    Raises
    ------
    ValueError
        If a sensor is not among the candidates, or a mode moves none of these.
    """
    phi = _real(phi)
    rows = np.atleast_1d(np.asarray(chosen, dtype=np.int64))
    kept = _checked(phi, rows.size, rows)
    at = phi[list(kept)]
    size = _lengths(phi)
    at = np.where(np.linalg.norm(at, axis=0) > _FULL_RANK * size, at, 0.0)
    square = np.sort(phi**2, axis=0)[::-1][: len(kept)].sum(axis=0)
    seen = (at**2).sum(axis=0) / square
    s = np.linalg.svd(at / size, compute_uv=False)
    rank = int((s > _FULL_RANK * max(s.max(initial=0.0), np.finfo(float).tiny)).sum())
    n = phi.shape[1]
    condition = float(s[0] / s[-1]) if rank == n else np.inf
    alike = auto_mac(at)
    pairs = [
        (i, j, float(alike[i, j])) for i in range(n) for j in range(i + 1, n) if alike[i, j] > most_alike
    ]
    return Observability(
        seen,
        alike,
        rank,
        condition,
        tuple(int(k) for k in np.flatnonzero(seen < least_seen)),
        tuple(sorted(pairs, key=lambda p: -p[2])),
    )


@dataclass(frozen=True, slots=True, eq=False)
class PretestPlan:
    """Sensors and exciters for the modes of a model, and their assessment.

    Attributes
    ----------
    sensors, exciters : tuple of Sensor
        In global directions, named like ``"12Z+"``.
    candidates : tuple of (int, str)
        Points and directions that were allowed.
    sensor_rows, exciter_rows : ndarray of int
        Which candidates were chosen.
    frequency : ndarray (n_modes,)
        Natural frequencies of the modes [Hz].
    observability : Observability
        Of the modes by the sensors.
    driven : ndarray (n_modes,)
        Sum of the exciters' driving-point residues, relative to the largest that any candidate has [-].
    """

    sensors: tuple[Sensor, ...]
    exciters: tuple[Sensor, ...]
    candidates: tuple[tuple[int, str], ...]
    sensor_rows: Ints
    exciter_rows: Ints
    frequency: Floats
    observability: Observability
    driven: Floats

    __repr__ = fields_summary

    def summary(self) -> str:
        """Return the choice and its weaknesses as lines of text, modes counted from 1."""
        o = self.observability
        lines = [
            f"{len(self.sensors)} sensors: {', '.join(s.name for s in self.sensors)}",
            f"{len(self.exciters)} exciters: {', '.join(s.name for s in self.exciters)}",
            f"largest MAC between different modes {o.largest_off_diagonal:.2f}, condition {o.condition:.3g}, "
            f"rank {o.rank} of {self.frequency.size}",
        ]
        lines += [
            f"mode {k + 1} ({self.frequency[k]:.4g} Hz) is seen to {o.seen[k]:.2g} only"
            for k in o.poorly_seen
        ]
        lines += [f"modes {i + 1} and {j + 1} look alike (MAC {value:.2f})" for i, j, value in o.confused]
        return "\n".join(lines)


def plan_pretest(
    model: Model,
    modes: Modes,
    n_sensors: int,
    n_exciters: int = 1,
    candidates: Candidates | None = None,
    method: Literal["effective independence", "auto mac"] = "effective independence",
) -> PretestPlan:
    """Place sensors and exciters for the elastic modes of a model.

    The plan is as good as the model: modes beyond those given, and those of the true structure that differ,
    are not asked for. Exciters are chosen among the candidates too.

    Parameters
    ----------
    model : Model
    modes : Modes
        Of the model, mass-normalised; rigid-body modes are left out.
    n_sensors, n_exciters : int
    candidates : sequence of (int, str), optional
        Points and directions ``x``, ``y``, ``z``; all translations of the mesh unless given.
    method : str
        How sensors are placed.

    Raises
    ------
    ValueError
        If numbers do not fit, a candidate is not in the mesh, or the candidates cannot tell the modes apart.
    """
    points = model.mesh.points
    allowed = (
        tuple((p, d) for p in range(len(points)) for d in _AXES)
        if candidates is None
        else tuple((int(p), d) for p, d in candidates)
    )
    for p, d in allowed:
        if d not in _AXES or not 0 <= p < len(points):
            msg = (
                f"candidate ({p}, '{d}') is not in the mesh; points are 0 to {len(points) - 1}, "
                "directions x, y, z"
            )
            raise ValueError(msg)
    rows = np.array([6 * p + _AXES.index(d) for p, d in allowed], dtype=np.int64)
    elastic = slice(modes.n_rigid, None)
    phi, frequency = _real(modes.shapes[rows][:, elastic]), modes.frequency[elastic]
    placers = {"effective independence": place_by_effective_independence, "auto mac": place_by_auto_mac}
    if method not in placers:
        msg = f"the method is '{method}'; allowed are {', '.join(placers)}"
        raise ValueError(msg)
    chosen = placers[method](phi, n_sensors)
    pushed = place_exciters(phi, frequency, n_exciters)
    residues = driving_point_residues(phi, frequency)
    driven = residues[pushed].sum(axis=0) / np.maximum(residues.max(axis=0), np.finfo(float).tiny)

    def named(which: Ints) -> tuple[Sensor, ...]:
        return tuple(
            Sensor(f"{p}{d.upper()}+", points[p], np.eye(3)[_AXES.index(d)])
            for p, d in (allowed[int(k)] for k in which)
        )

    return PretestPlan(
        named(chosen), named(pushed), allowed, chosen, pushed, frequency, assess_sensors(phi, chosen), driven
    )


def _real(phi: ArrayLike) -> Floats:
    values: NDArray[Any] = np.asarray(phi)
    if np.iscomplexobj(values):
        msg = "the shapes are complex; placing takes the real shapes of an undamped model"
        raise ValueError(msg)
    values = np.asarray(values, dtype=float)
    if values.ndim != 2:
        msg = f"the shapes have shape {values.shape}; (n_candidates, n_modes) is expected"
        raise ValueError(msg)
    return values


def _frequencies(frequency: ArrayLike, n: int) -> Floats:
    f = np.atleast_1d(np.asarray(frequency, dtype=float))
    if f.shape != (n,) or not (f > 0).all():
        msg = f"the frequencies are {f}; {n} positive ones are needed, rigid-body modes left out [Hz]"
        raise ValueError(msg)
    return f


def _checked(phi: Floats, n: int, keep: ArrayLike) -> tuple[int, ...]:
    kept = tuple(int(k) for k in np.atleast_1d(np.asarray(keep, dtype=np.int64)))
    if len(set(kept)) != len(kept) or any(not 0 <= k < len(phi) for k in kept):
        msg = f"the DOFs {kept} must differ and be rows of the {len(phi)} candidates, counted from 0"
        raise ValueError(msg)
    if not max(len(kept), 1) <= n <= len(phi):
        msg = f"{n} DOFs are asked for with {len(kept)} to keep; there are {len(phi)} candidates"
        raise ValueError(msg)
    return kept


def _orthonormal(phi: Floats) -> Floats:
    """Return an orthonormal basis of the shapes' space; the modes' scale does not matter to it."""
    U, s, Vt = np.linalg.svd(phi / _lengths(phi), full_matrices=False)
    if len(phi) < phi.shape[1] or s[-1] <= _FULL_RANK * s[0]:
        guilty = np.flatnonzero(np.abs(Vt[-1]) > 0.1 * np.abs(Vt[-1]).max())
        modes = ", ".join(str(int(k)) for k in guilty)
        msg = (
            f"the {len(phi)} candidates cannot distinguish the modes {modes} "
            "(counted from 0); allow more places or directions, or leave modes out"
        )
        raise ValueError(msg)
    return U


def _lengths(phi: Floats) -> Floats:
    """Return the length of each shape, refusing those that are rounding errors against the others."""
    size = np.linalg.norm(phi, axis=0)
    unmoved = np.flatnonzero(~(size > _FULL_RANK * size.max(initial=0.0)))
    if unmoved.size:
        msg = f"mode {int(unmoved[0])} (counted from 0) moves none of the {len(phi)} candidates"
        raise ValueError(msg)
    return size


def _largest(alike: Floats) -> float:
    return float((alike - np.diag(np.diag(alike))).max(initial=0.0))


def _largest_if_added(phi: Floats, chosen: list[int]) -> Floats:
    """Return the largest off-diagonal MAC of the chosen DOFs with one more; infinite for those chosen."""
    G = phi[chosen].T @ phi[chosen]
    i, j = np.triu_indices(phi.shape[1], 1)
    cross = G[i, j] + phi[:, i] * phi[:, j]
    square = np.diag(G) + phi**2
    size = square[:, i] * square[:, j]
    # a mode that no DOF sees is as bad as one confused
    value = np.divide(cross**2, size, out=np.ones_like(size), where=size > 1e-24).max(axis=1, initial=0.0)
    value[chosen] = np.inf
    return value
