"""Expansion: from shapes at a few sensors to all DOFs of a model."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
from numpy.typing import ArrayLike

from fem.analysis.modes import Modes, UnstableError
from fem.analysis.selection import Selection, dof_vectors
from fem.array_types import Floats
from fem.linalg.solvers import SingularMatrixError, factorise
from fem.model import Array, ModelError
from fem.summary import fields_summary
from fem.system import System

_TIED = 1e-10
"""Relative size below which a sensor's row, or its part independent of others, is rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class Expansion:
    """Measured shapes on all DOFs.

    Attributes
    ----------
    method : str
        How they were expanded.
    shapes : ndarray (n_dof, n_shapes)
        Real or complex as the measured ones, in their units.
    residual : ndarray (n_sensors, n_shapes)
        Measured minus expanded, at the sensors.
    misfit : ndarray (n_shapes,)
        Norm of the residual relative to that of the measured shape [-].
    condition : float
        Condition number of the system solved [-]: errors of the sensors may reach the amplitudes of the
        shapes larger by this factor.
    sensors : tuple of str
        Labels of the sensors.
    amplitudes : ndarray (n_modes, n_shapes) or None
        Factors of the modes, where modes were used.
    """

    method: str
    shapes: Array
    residual: Array
    misfit: Floats
    condition: float
    sensors: tuple[str, ...]
    amplitudes: Array | None = None

    __repr__ = fields_summary


def expand_serep(system: System, modes: Modes, sensors: Selection, shapes: ArrayLike) -> Expansion:
    """Expand by modes: u = Φ c with c of least squares at the sensors.

    SEREP (O'Callahan, Avitabile & Riemer, IMAC VII, 1989, 29-37). Noise is smoothed as far as there are more
    sensors than modes, and motions outside the modes' span are lost.

    Parameters
    ----------
    system : System
    modes : Modes
        Of the system, those that the shapes may contain.
    sensors : selection
        DOF numbers, (point, direction) pairs, or combinations of DOFs as rows (n_sensors, n_dof): a place
        along a member is a row of ``Frame.interpolate``.
    shapes : array_like (n_sensors, n_shapes)
        Measured shapes, real or complex.

    Raises
    ------
    ModelError
        For fewer sensors than modes, modes that the sensors cannot tell apart, or shapes that do not fit.
    """
    rows, labels, measured = _checked(system, sensors, shapes)
    inverse, condition = left_inverse(rows.T @ modes.shapes, modes.frequency, len(labels))
    amplitudes = inverse @ measured
    return _result("serep", modes.shapes @ amplitudes, rows, measured, condition, labels, amplitudes)


def expand_hybrid(system: System, modes: Modes, sensors: Selection, shapes: ArrayLike) -> Expansion:
    """Expand by modes, and their residual at the sensors statically: u = Φ c + T_s (ψ - S Φ c).

    The hybrid of Kammer, *J. Vib. Acoust.* 113 (1991) 325-332. It meets the measured values exactly, noise
    included; motions outside the modes' span follow the statics.

    Parameters
    ----------
    system, modes, sensors, shapes
        As in :func:`expand_serep`.

    Raises
    ------
    ModelError
        As :func:`expand_serep` and :func:`expand_static`.
    """
    smooth = expand_serep(system, modes, sensors, shapes)
    rest = expand_static(system, sensors, smooth.residual)
    rows, labels, measured = _checked(system, sensors, shapes)
    return _result(
        "hybrid",
        smooth.shapes + rest.shapes,
        rows,
        measured,
        max(smooth.condition, rest.condition),
        labels,
        smooth.amplitudes,
    )


def expand_smooth(
    system: System, modes: Modes, sensors: Selection, shapes: ArrayLike, noise: ArrayLike
) -> Expansion:
    """Expand by the shape of least strain energy that meets the sensors within their noise.

    Of all u = Φ c with ‖(ψ - S u) / s‖² ≤ n_sensors it is that with the least cᵀ Ω² c = uᵀ K u: Tikhonov's
    regularisation with Morozov's discrepancy principle, a smoothing spline whose curvature is that
    of the structure. Rigid-body modes cost nothing and are met by least squares. There may be more modes than
    sensors; for all modes and no noise it tends to the static expansion. Where even the best fit misses by
    more than the noise, that fit is returned, and ``misfit`` shows it.

    Parameters
    ----------
    system, modes, sensors, shapes
        As in :func:`expand_serep`, but there may be more modes than sensors.
    noise : array_like (), (n_sensors,) or (n_sensors, n_shapes)
        Standard deviation s of the measured values [their units], positive.

    Raises
    ------
    ModelError
        For shapes or noise that do not fit, or rigid-body modes that the sensors cannot tell apart.
    UnstableError
        For modes below zero.
    """
    rows, labels, measured = _checked(system, sensors, shapes)
    try:
        s = np.broadcast_to(np.asarray(noise, dtype=float).reshape(_column(noise)), measured.shape)
    except ValueError:
        msg = f"the noise has shape {np.shape(noise)}; a number or {measured.shape} is expected"
        raise ModelError(msg) from None
    if not (np.isfinite(s).all() and (s > 0).all()):
        msg = "the noise must be positive: it is the standard deviation of the measured values"
        raise ModelError(msg)
    if np.iscomplexobj(modes.shapes):
        msg = "the modes are complex; strain energy needs the undamped system's real ones (solve_modes)"
        raise ModelError(msg)
    if (modes.frequency < 0).any():
        msg = (
            f"{int((modes.frequency < 0).sum())} of the modes grow: the structure is unstable, and no motion "
            "has the least strain energy; less compression is needed"
        )
        raise UnstableError(msg)
    seen = rows.T @ modes.shapes
    n_rigid = modes.n_rigid
    if n_rigid:
        left_inverse(seen[:, :n_rigid], modes.frequency[:n_rigid], len(labels))
    amplitudes = np.empty((modes.n_modes, measured.shape[1]), dtype=measured.dtype)
    condition = 1.0
    for j in range(measured.shape[1]):
        amplitudes[:, j], c = _smoothest(seen / s[:, [j]], measured[:, j] / s[:, j], modes.omega, n_rigid)
        condition = max(condition, c)
    return _result("smooth", modes.shapes @ amplitudes, rows, measured, condition, labels, amplitudes)


def expand_static(system: System, sensors: Selection, shapes: ArrayLike) -> Expansion:
    """Expand statically: the motion of least strain energy that meets the sensors.

    For sensors that are DOFs this is Guyan's u_o = -K_oo⁻¹ K_oa u_a (*AIAA J.* 3, 1965, 380). It meets the
    measured values exactly and is good as long as the shape's frequency lies well below the lowest one of the
    structure held at its sensors.

    Parameters
    ----------
    system : System
    sensors, shapes
        As in :func:`expand_serep`.

    Raises
    ------
    ModelError
        For sensors that the supports hold, that repeat others, or that leave a rigid-body motion unseen.
    """
    rows, labels, measured = _checked(system, sensors, shapes)
    _check_rigid(system, rows, labels)
    try:
        T, condition = _interpolant(system, system.K, rows, labels)
    except SingularMatrixError:
        msg = "held at its sensors, the structure has a motion that nothing resists; add sensors"
        raise ModelError(msg) from None
    return _result("static", system.Q @ (T @ measured), rows, measured, condition, labels)


def expand_dynamic(system: System, sensors: Selection, shapes: ArrayLike, frequency: ArrayLike) -> Expansion:
    """Expand with inertia: K - ω²M in place of K, each shape at its frequency.

    No force acts but at the sensors (Kidder, *AIAA J.* 11, 1973, 892). A natural frequency of the structure
    is no obstacle, but one of the structure held at its sensors is.

    Parameters
    ----------
    system : System
    sensors, shapes
        As in :func:`expand_serep`.
    frequency : array_like (n_shapes,)
        Frequency of each shape [Hz].

    Raises
    ------
    ModelError
        As :func:`expand_static`, or for frequencies that do not fit the shapes.
    """
    rows, labels, measured = _checked(system, sensors, shapes)
    frequency = np.atleast_1d(np.asarray(frequency, dtype=float))
    if frequency.shape != (measured.shape[1],) or not np.isfinite(frequency).all():
        msg = f"{measured.shape[1]} shapes need as many frequencies [Hz], found {frequency.size}"
        raise ModelError(msg)
    out = np.empty((system.model.n_dof, measured.shape[1]), dtype=measured.dtype)
    condition = 1.0
    for f in np.unique(frequency):
        at = frequency == f
        Z = system.K - (2 * np.pi * f) ** 2 * system.M
        try:
            T, c = _interpolant(system, Z, rows, labels)
        except SingularMatrixError:
            msg = f"{f:g} Hz is a natural frequency of the structure held at its sensors; add sensors"
            raise ModelError(msg) from None
        out[:, at] = system.Q @ (T @ measured[:, at])
        condition = max(condition, c)
    return _result("dynamic", out, rows, measured, condition, labels)


def left_inverse(seen: Array, frequency: Floats, n_sensors: int) -> tuple[Array, float]:
    """Return the left inverse (m, n) of modes at sensors (n, m), and their condition number.

    Raises
    ------
    ModelError
        For fewer sensors than modes, or modes that the sensors cannot tell apart; it names these.
    """
    n, m = seen.shape
    if n < m:
        msg = (
            f"{n_sensors} sensors cannot distinguish {m} modes; at least {m} sensors are needed, "
            "or fewer modes"
        )
        raise ModelError(msg)
    U, s, Vt = np.linalg.svd(seen, full_matrices=False)
    # Modes that sensors see with a larger condition number count as indistinguishable. Measured shapes are
    # good to three digits at best, so that even a hundredth of it leaves little.
    lost = s <= s[0] / 1e6
    if lost.any():
        weight = np.abs(Vt[lost]).max(axis=0)
        names = [
            f"{k + 1} ({frequency[k]:.4g} Hz)" for k in np.flatnonzero(weight > 0.1 * weight.max()).tolist()
        ]
        what = (
            f"mode {names[0]} does not move the {n_sensors} sensors"
            if len(names) == 1
            else f"the {n_sensors} sensors cannot distinguish the modes {', '.join(names)}"
        )
        msg = f"{what}; add sensors where they differ, or leave modes out"
        raise ModelError(msg)
    return (Vt.conj().T / s) @ U.conj().T, float(s[0] / s[-1])


def _column(noise: ArrayLike) -> tuple[int, ...]:
    """Return the shape of the noise with one value per sensor turned into a column."""
    shape = np.shape(noise)
    return (*shape, 1) if len(shape) == 1 else shape


def _checked(system: System, sensors: Selection, shapes: ArrayLike) -> tuple[Floats, tuple[str, ...], Array]:
    """Return the sensors' columns (n_dof, n), their labels, and the shapes (n, n_shapes)."""
    rows, labels = dof_vectors(system.model, sensors)
    measured = np.asarray(shapes)
    measured = measured.astype(complex if np.iscomplexobj(measured) else float)
    if measured.ndim == 1:
        measured = measured[:, None]
    if measured.ndim != 2 or len(measured) != len(labels):
        msg = f"the shapes have the size {measured.shape}; {len(labels)} sensors need as many rows"
        raise ModelError(msg)
    if not np.isfinite(measured).all():
        sensor = int(np.argwhere(~np.isfinite(measured))[0, 0])
        msg = f"the shape is not a finite number at sensor {labels[sensor]}"
        raise ModelError(msg)
    return rows, labels, measured


def _check_rigid(system: System, rows: Floats, labels: Sequence[str]) -> None:
    """Raise an error if a rigid-body motion of the structure moves no sensor."""
    if not system.rigid.shape[1]:
        return
    s = np.linalg.svd(rows.T @ (system.Q @ system.rigid), compute_uv=False)
    rank = int((s > 1e-9 * s[0]).sum())
    if rank < system.rigid.shape[1]:
        msg = (
            f"the structure has {system.rigid.shape[1]} rigid-body motions, of which {len(labels)} sensors "
            f"see {rank}; add sensors that see the others"
        )
        raise ModelError(msg)


def _interpolant(
    system: System, Z: sp.csc_array, rows: Floats, labels: Sequence[str]
) -> tuple[Floats, float]:
    """Return T (n_free, n) with B T = I that makes qᵀ Z q stationary, and a condition number.

    T = Y (B Y)⁻¹ with Y = (Z + Bᵀ W B)⁻¹ Bᵀ. The added stiffness W at the sensors is as large as that
    of the structure and changes nothing where B q is given, but makes free structures and natural
    frequencies regular.
    """
    B = sp.csr_array(rows.T) @ system.Q
    size = np.sqrt(np.asarray((B * B).sum(axis=1)).ravel())
    immobile = np.flatnonzero(size <= _TIED * np.maximum(np.linalg.norm(rows, axis=0), 1e-300))
    if immobile.size:
        msg = f"supports hold sensor {labels[immobile[0]]}; leave it out"
        raise ModelError(msg)
    _check_independent(B, size, labels)
    stiffness = np.asarray(abs(B) @ system.K.diagonal()[:, None]).ravel()
    weights = np.maximum(stiffness, 1e-300) / size**2 / np.asarray(abs(B).sum(axis=1)).ravel()
    Bt = sp.csc_array(B.T)
    Y = factorise(sp.csc_array(Z + Bt @ sp.diags_array(weights) @ B)).solve(Bt.toarray())
    G = np.asarray(B @ Y)
    # W^½ G W^½ = (W^-½ S W^-½ + I)⁻¹ with the structure's stiffness S against the sensors' motions, which
    # is infinite at a natural frequency of the structure held there.
    scale = np.sqrt(weights)
    scaled = scale[:, None] * G * scale
    singular = np.linalg.svd(scaled, compute_uv=False)
    condition = max(1.0, float(singular[0])) / max(float(singular[-1]), 1e-300)
    # Condition number above which a frequency counts as one of the structure held at its sensors
    if not condition < 1e9:
        msg = "the structure held at its sensors has a motion without stiffness"
        raise SingularMatrixError(msg)
    return np.linalg.solve(scaled, (Y * scale).T).T * scale, condition


def _check_independent(B: sp.csr_array, size: Floats, labels: Sequence[str]) -> None:
    """Raise an error that names a sensor whose row the others combine to."""
    touched = np.unique(B.indices)
    unit = B[:, touched].toarray() / size[:, None]
    R, order = sla.qr(unit.T, mode="r", pivoting=True)
    pivots = np.abs(R.diagonal())
    lost = np.concatenate([np.flatnonzero(pivots <= _TIED * pivots[0]), np.arange(len(pivots), len(labels))])
    if lost.size:
        row = int(order[lost[0]])
        like = np.flatnonzero(np.abs(unit @ unit[row]) > 1 - 1e-9)
        others = [labels[k] for k in like.tolist() if k != row]
        what = (
            f"sensor {labels[row]} repeats {others[0]}" if others else f"sensor {labels[row]} repeats others"
        )
        msg = f"{what}: rigid connections tie them, or they sit at the same place; leave it out"
        raise ModelError(msg)


def _smoothest(A: Array, b: Array, omega: Floats, n_rigid: int) -> tuple[Array, float]:
    """Minimise Σ ω² |c|² subject to ‖A c - b‖² ≤ n; the first ``n_rigid`` unknowns are free."""
    R, E = A[:, :n_rigid], A[:, n_rigid:] / omega[n_rigid:]
    basis = np.linalg.qr(R)[0] if n_rigid else np.zeros((len(A), 0))
    U, s, Vt = np.linalg.svd(E - basis @ (basis.T @ E), full_matrices=False)
    keep = s > 1e-12 * max(s.max(initial=0.0), 1e-300)
    U, s, Vt = U[:, keep], s[keep], Vt[keep]
    rest = b - basis @ (basis.T @ b)
    beta = U.T @ rest
    outside = max(float(np.linalg.norm(rest) ** 2 - np.linalg.norm(beta) ** 2), 0.0)
    target = len(b) - outside

    def excess(log_mu: float) -> float:
        filtered = beta / (1 + s**2 / np.exp(log_mu))
        return float(np.linalg.norm(filtered) ** 2) - target

    if not s.size:
        x, mu = np.zeros(0), 0.0
    else:
        low, high = np.log(s[-1] ** 2 * 1e-14), np.log(s[0] ** 2 * 1e14)
        if excess(low) >= 0:
            mu = 0.0  # not even the best fit is as good as the noise
        elif excess(high) <= 0:
            mu = np.inf  # rigid motions alone are good enough
        else:
            for _ in range(200):
                middle = (low + high) / 2
                low, high = (low, middle) if excess(middle) > 0 else (middle, high)
            mu = float(np.exp(low))
        x = beta * (s / (s**2 + mu)) if np.isfinite(mu) else 0 * beta
    elastic = Vt.T @ x
    c = np.concatenate(
        [
            np.linalg.lstsq(R, b - E @ elastic, rcond=None)[0] if n_rigid else np.zeros(0),
            elastic / omega[n_rigid:],
        ]
    )
    condition = np.sqrt((s[0] ** 2 + mu) / (s[-1] ** 2 + mu)) if s.size and np.isfinite(mu) else 1.0
    return c, float(condition)


def _result(
    method: str,
    shapes: Array,
    rows: Floats,
    measured: Array,
    condition: float,
    labels: tuple[str, ...],
    amplitudes: Array | None = None,
) -> Expansion:
    residual = measured - rows.T @ shapes
    size = np.maximum(np.linalg.norm(measured, axis=0), 1e-300)
    misfit = np.linalg.norm(residual, axis=0) / size
    return Expansion(method, shapes, residual, misfit, condition, labels, amplitudes)
