"""Which computed modes a test could have measured, by its plane and the directions of sensors and forces."""

from collections.abc import Iterator, Sequence

import numpy as np

from fem.array_types import Bools, Floats, Ints
from fem.model import Model
from fem.reduction.reduced_model import ReducedModel
from fem.system import assemble
from updating.inference.fit_data import sensor_vectors
from updating.inference.mode_targets import ModeTargets
from updating.measurement.measurement import MOTION, Sensor

IN_PLANE = 0.5
"""Least share of a mode's motion in the plane of a test for it to be seen [-]."""
LEAST_MOTION = 0.01
"""Least motion of a mode at the sensors or forces of a test, in parts of a mode's typical motion [-]."""
EIGENVALUE_TOLERANCE = 1e-6
"""Eigenvalues nearer than this, relatively, are one whose vectors may be any of their combinations [-]."""


def visible_modes(
    reduced: ReducedModel,
    targets: ModeTargets,
    mass: float,
    eigenvalues: Floats,
    n_rigid: Ints,
    vectors: Floats,
) -> Bools:
    """Return which computed modes of n models a test could have measured, (n, r).

    Left out are motions of rigid bodies, those mostly out of the plane of the test, and those without motion
    at any sensor or force along its direction. A vector x with xᵀ M x = 1 has a typical motion of m^-½, with
    the mass m of the structure. Of modes of one frequency as many count as the test tells apart.

    Parameters
    ----------
    reduced : ReducedModel
    targets : ModeTargets
    mass : float
        m [kg]; NaN where motion is not judged by its size.
    eigenvalues : ndarray (n, r)
        Of the modes [rad²/s²].
    n_rigid : ndarray of int (n,)
        Number of them that move as a rigid body.
    vectors : ndarray (n, r_basis, r)
        Their motions as combinations of the basis's columns.
    """
    lam = eigenvalues
    out = (np.arange(lam.shape[1]) >= n_rigid[:, None]) & (lam > 0)
    judged = [part for part in (targets.sensors, targets.driven) if _judged(part, mass)]
    if not judged and not targets.plane:
        return out
    V = vectors
    motion = [_motion(reduced, axes) for axes in (targets.plane, "xyz")] if targets.plane else []
    channels = [np.sqrt(mass) * _rows(reduced, part) @ V for part in judged]
    # Most modes are alone at their frequency: of these all at once.
    seen = out.copy()
    if motion:
        within, every = ((V * (G @ V)).sum(axis=1) for G in motion)
        seen &= (within >= IN_PLANE * every) & ~(every <= LEAST_MOTION**2 / mass)
    if channels:
        strength = np.prod([np.linalg.norm(rows, axis=1) for rows in channels], axis=0)
        seen &= strength >= LEAST_MOTION ** len(channels)
    for k, some in _alike(lam, out):
        v = V[k][:, some]
        n = len(some)
        if motion:
            n = _in_plane(v.T @ motion[0] @ v, v.T @ motion[1] @ v, LEAST_MOTION**2 / mass)
        if channels:
            first, *second = (rows[k][:, some] for rows in channels)
            response = first @ second[0].T if second else first
            strong = np.linalg.svd(response, compute_uv=False) >= LEAST_MOTION ** len(channels)
            n = min(n, int(strong.sum()))
        seen[k, some] = np.arange(len(some)) < n
    return seen


def mass_of(model: Model) -> float:
    """Return the mass of a model that may move, as the mean along the three axes [kg]."""
    system = assemble(model, reciprocal=False)
    along = np.zeros((model.n_dof, 3))
    for axis in range(3):
        along[axis : 6 * len(model.mesh.points) : 6, axis] = 1.0
    q = system.Q.T @ along
    return float(np.einsum("ik,ik->", q, system.M @ q) / 3)


def _judged(part: Sequence[Sensor], mass: float) -> bool:
    """Whether all channels are motions or forces of points: others have another scale."""
    motions = [s.directed and s.quantity == MOTION for s in part]
    return bool(motions) and all(motions) and bool(np.isfinite(mass))


def _rows(reduced: ReducedModel, part: tuple[Sensor, ...]) -> Floats:
    """Return the motions of some channels by the basis's columns, (n, r)."""
    gains = [abs(s.gain) for s in part]
    return reduced.projected(("seen", part), lambda: sensor_vectors(reduced.model, part) / gains)[1].T


def _motion(reduced: ReducedModel, axes: str) -> Floats:
    """Return the mean square of all points' motions along some axes, on the basis's columns, (r, r)."""
    basis = reduced.basis

    def part() -> Floats:
        chosen = np.isin(np.arange(len(basis.T)) % 6, ["xyz".index(a) for a in axes])
        return np.where(chosen[:, None], basis.T, 0.0) / np.sqrt(len(basis.T) / 6)

    return reduced.projected(("motion", axes), part)[1]


def _alike(eigenvalues: Floats, there: Bools) -> Iterator[tuple[int, Ints]]:
    """Yield models and those of their modes (n, r) that share one frequency, of modes that are ``there``."""
    near = np.diff(eigenvalues, axis=1) <= EIGENVALUE_TOLERANCE * eigenvalues[:, 1:]
    for k in np.flatnonzero((near & there[:, 1:] & there[:, :-1]).any(axis=1)).tolist():
        some = np.flatnonzero(there[k])
        lam = eigenvalues[k, some]
        first = np.flatnonzero(np.append(True, np.diff(lam) > EIGENVALUE_TOLERANCE * lam[1:])[: len(some)])
        size = np.diff(np.append(first, len(some)))
        yield from ((k, some[i : i + n]) for i, n in zip(first[size > 1], size[size > 1], strict=True))


def _in_plane(within: Floats, every: Floats, least: float) -> int:
    """Return how many modes of one frequency move in the plane, more than a least mean square."""
    size, U = np.linalg.eigh(every)
    there = size > (least if np.isfinite(least) else 0.0)
    W = U[:, there] / np.sqrt(size[there])
    return int((np.linalg.eigvalsh(W.T @ within @ W) >= IN_PLANE).sum())
