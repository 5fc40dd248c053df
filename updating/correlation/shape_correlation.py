"""How alike shapes are: MAC and its relatives over the DOFs, over the modes, with mass, and of subspaces.

NaN is a gap: a DOF at which one shape was not measured. It is left out where that shape takes part, and kept
for all other shapes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem.array_types import Bools, Floats, Ints

Array = NDArray[Any]


def mac(phi_x: ArrayLike, phi_a: ArrayLike) -> Floats:
    """Compute the modal assurance criterion |φ_xᴴ φ_a|² / (φ_xᴴφ_x · φ_aᴴφ_a).

    Allemang and Brown, IMAC I, 1982, 110-116. It says whether shapes look alike at the measured DOFs,
    whatever their scale and phase. DOFs with large motion decide: a wrong small one is not seen. With few
    sensors different modes may look alike (spatial aliasing: see :func:`auto_mac`), and rotations must not be
    mixed with translations. It is not an orthogonality check: without the mass matrix different modes need
    not have 0.

    Parameters
    ----------
    phi_x, phi_a : array_like (n_dof, n_modes)
        Shapes at the same DOFs, real or complex; NaN where a shape was not measured.

    Returns
    -------
    ndarray (n_modes_x, n_modes_a)
        Over the DOFs that both shapes have, 0 to 1; 0 for a shape without motion there.

    Raises
    ------
    ValueError
        If the numbers of DOFs differ, or a value is infinite.
    """
    x, a = _shapes(phi_x, phi_a)
    known_x, known_a = ~np.isnan(x), ~np.isnan(a)
    if known_x.all() and known_a.all():
        size = np.outer(_norms(x), _norms(a))
    else:  # each length over the DOFs that the other shape has
        x, a = np.where(known_x, x, 0), np.where(known_a, a, 0)
        # the largest entry as the unit, or squares of tiny shapes lose their digits
        x, a = _largest_one(x), _largest_one(a)
        size = np.sqrt((np.abs(x) ** 2).T @ known_a) * np.sqrt(known_x.T @ (np.abs(a) ** 2))
    cosine = np.divide(np.abs(x.conj().T @ a), size, out=np.zeros(size.shape), where=size > 0)
    return np.minimum(cosine, 1.0) ** 2


def auto_mac(phi: ArrayLike) -> Floats:
    """Compute the MAC of a set of shapes with itself.

    Large entries off the diagonal are pairs that these DOFs cannot tell apart: of a model's modes at the
    sensors it is spatial aliasing, to be judged before the test; of measured modes it is that, or one mode
    identified twice.

    Parameters
    ----------
    phi : array_like (n_dof, n_modes)

    Returns
    -------
    ndarray (n_modes, n_modes)
        0 to 1, symmetric, 1 on the diagonal.
    """
    return mac(phi, phi)


def modal_scale_factor(phi_x: ArrayLike, phi_a: ArrayLike) -> Array:
    """Compute the factors that bring shapes nearest to others, φ_xᴴφ_a / φ_xᴴφ_x (Allemang and Brown, 1982).

    φ_x times the factor is closest to φ_a in least squares; noise on φ_x makes it too small by the part of
    noise in φ_xᴴφ_x.

    Parameters
    ----------
    phi_x, phi_a : array_like (n_dof, n_pairs)
        Shapes that belong together, column by column.

    Returns
    -------
    ndarray (n_pairs,)
        Real for real shapes; 0 for a shape without motion.

    Raises
    ------
    ValueError
        If the shapes differ.
    """
    x, a = _pairs(phi_x, phi_a)
    x, a = _without_gaps(x, a)
    cross, square = (x.conj() * a).sum(axis=0), (np.abs(x) ** 2).sum(axis=0)
    return np.divide(cross, square, out=np.zeros_like(cross), where=square > 0)


def comac(phi_x: ArrayLike, phi_a: ArrayLike) -> Floats:
    """Compute the coordinate modal assurance criterion of each DOF over pairs of modes.

    (Σ_r |φ_x φ_a|)² / (Σ_r |φ_x|² Σ_r |φ_a|²): Lieven and Ewins, IMAC VI, 1988, 690-695. Measured shapes are
    first scaled to the computed ones (:func:`modal_scale_factor`), as the sums over modes need one scale.

    A low value says where motions differ from mode to mode, which need not be where the model is wrong: a
    local fault changes shapes elsewhere too. It is blind to a constant factor of a sensor, to its sign, and
    to phases; use :func:`ecomac` for these. Small motions count as much as large ones, so that DOFs near
    nodes look bad. With a single pair all values are 1.

    Parameters
    ----------
    phi_x, phi_a : array_like (n_dof, n_pairs)
        Measured and computed shapes that belong together, column by column.

    Returns
    -------
    ndarray (n_dof,)
        Over the pairs that have the DOF, 0 to 1; 0 where one of the two never moves there, NaN where no pair
        has it.

    Raises
    ------
    ValueError
        If the shapes differ.
    """
    x, a = _pairs(phi_x, phi_a)
    measured = _measured(x, a).any(axis=1)
    x, a = _without_gaps(x, a)
    x, a = np.abs(x * modal_scale_factor(x, a)), np.abs(a)
    size = np.linalg.norm(x, axis=1) * np.linalg.norm(a, axis=1)
    cosine = np.divide((x * a).sum(axis=1), size, out=np.zeros(size.shape), where=size > 0)
    return np.where(measured, np.minimum(cosine, 1.0) ** 2, np.nan)


def ecomac(phi_x: ArrayLike, phi_a: ArrayLike) -> Floats:
    """Compute the enhanced coordinate modal assurance criterion, a mean difference of each DOF.

    Σ_r |φ_a - φ_x| / 2N over N pairs, each shape with its largest component 1 and measured ones turned to the
    computed phase: Hunt, IMAC X, 1992, 66-71. 0 is best, unlike CoMAC. It sees wrong signs and gains: a
    reversed sensor has the mean of |φ|. Since the largest component sets the scale, an error there spreads
    over all DOFs; DOFs that hardly move look good.

    Parameters
    ----------
    phi_x, phi_a : array_like (n_dof, n_pairs)
        Measured and computed shapes that belong together, column by column.

    Returns
    -------
    ndarray (n_dof,)
        Over the pairs that have the DOF, 0 to 1; NaN where no pair has it.

    Raises
    ------
    ValueError
        If the shapes differ.
    """
    x, a = _pairs(phi_x, phi_a)
    measured = _measured(x, a)
    x, a = (_largest_one(p) for p in _without_gaps(x, a))
    cross = (x.conj() * a).sum(axis=0)
    turn = np.divide(cross, np.abs(cross), out=np.ones_like(cross), where=np.abs(cross) > 0)
    n, total = measured.sum(axis=1), np.abs(a - x * turn).sum(axis=1)
    mean = np.divide(total, n, out=np.full(n.shape, np.nan), where=n > 0)
    return np.minimum(mean / 2, 1.0)


def mac_without(phi_x: ArrayLike, phi_a: ArrayLike) -> Floats:
    """Compute the MAC that each pair of modes has without one of the DOFs.

    The first step of MACCo: where it exceeds the MAC with all DOFs, the DOF lowers it. It finds the DOFs that
    dominate MAC, so large motions; several wrong DOFs may hide each other, see :func:`eliminate_coordinates`.

    Parameters
    ----------
    phi_x, phi_a : array_like (n_dof, n_pairs)
        Shapes that belong together, column by column.

    Returns
    -------
    ndarray (n_dof, n_pairs)
        MAC without the DOF, 0 to 1; that with all DOFs where the pair lacks the DOF.

    Raises
    ------
    ValueError
        If the shapes differ.
    """
    x, a = _without_gaps(*_pairs(phi_x, phi_a))
    return _mac_without(x, a, np.ones(len(x), dtype=bool))


@dataclass(frozen=True, slots=True, eq=False)
class CoordinateElimination:
    """DOFs in the order in which leaving them out raises MAC most.

    Attributes
    ----------
    order : ndarray of int (n_removed,)
        DOFs, the most harmful first.
    mac : ndarray (n_removed + 1, n_pairs)
        MAC of each pair with all DOFs, then after each removal.
    """

    order: Ints
    mac: Floats

    @property
    def gain(self) -> Floats:
        """Gain of the mean MAC by each removal, shape (n_removed,) [-]."""
        return np.diff(self.mac.mean(axis=1))


def eliminate_coordinates(
    phi_x: ArrayLike, phi_a: ArrayLike, at_most: int | None = None
) -> CoordinateElimination:
    """Leave out one DOF after another, each time the one that raises the mean MAC most (MACCo).

    Brughmans, Leuridan and Blauwkamp, IMAC XI, 1993. A steep start
    names the DOFs to look at. MAC tends to rise anyway, as shapes of few DOFs agree easily: the DOFs
    left out are not thereby wrong, and a MAC reported without the worst DOFs is no evidence for a model.

    Parameters
    ----------
    phi_x, phi_a : array_like (n_dof, n_pairs)
        Shapes that belong together, column by column.
    at_most : int, optional
        Number of DOFs to leave out; all but two unless given, and never more.

    Raises
    ------
    ValueError
        If the shapes differ.
    """
    x, a = _without_gaps(*_pairs(phi_x, phi_a))
    kept = np.ones(len(x), dtype=bool)
    order: list[int] = []
    values = [np.diag(mac(x, a))]
    most = max(len(x) - 2, 0)
    for _ in range(most if at_most is None else min(at_most, most)):
        without = _mac_without(x, a, kept)
        mean = np.where(kept, without.mean(axis=1), -1.0)
        worst = int(np.argmax(mean))
        order.append(worst)
        kept[worst] = False
        values.append(np.diag(mac(x[kept], a[kept])))
    return CoordinateElimination(np.array(order, dtype=np.int64), np.array(values))


def orthogonality(phi: ArrayLike, M: ArrayLike) -> Array:
    """Check shapes for orthogonality with a mass matrix on the measured DOFs, normalised to a unit diagonal.

    φᵀMφ with φ of unit modal mass; complex shapes with φᴴ. Off the diagonal 0.1 is a common limit
    (NASA-STD-5002). The mass matrix is the model's, reduced (`fem.reduction.condensation`), so that it errs
    with the model and the reduction: Guyan's is good below the modes of the held structure, while SEREP's
    gives the identity for its own modes whatever the model, hence says less.

    Parameters
    ----------
    phi : array_like (n_dof, n_modes)
    M : array_like (n_dof, n_dof) or (n_dof,)
        Mass matrix on these DOFs, or its diagonal [kg].

    Returns
    -------
    ndarray (n_modes, n_modes)
        -1 to 1 for real shapes and a positive semi-definite M.

    Raises
    ------
    ValueError
        If M does not fit, a shape has a gap, or it has no mass.
    """
    return cross_orthogonality(phi, phi, M)


def cross_orthogonality(phi_x: ArrayLike, phi_a: ArrayLike, M: ArrayLike) -> Array:
    """Check measured against computed shapes with a mass matrix: the pseudo-orthogonality check POC.

    φ_xᵀMφ_a, both of unit modal mass; complex shapes with φ_xᴴ. NASA-STD-5002 asks for 0.9 on the diagonal
    and 0.1 off it. Unlike MAC it weighs DOFs with their mass, and different modes have 0; M errs as told at
    :func:`orthogonality`. Its square is MAC for M = I.

    Parameters
    ----------
    phi_x, phi_a : array_like (n_dof, n_modes)
        Shapes at the same DOFs.
    M : array_like (n_dof, n_dof) or (n_dof,)
        Mass matrix on these DOFs, symmetric, or its diagonal [kg].

    Returns
    -------
    ndarray (n_modes_x, n_modes_a)
        -1 to 1 for real shapes; the sign is that of the shapes.

    Raises
    ------
    ValueError
        If M or the shapes do not fit, a shape has a gap, or it has no mass.
    """
    x, a = _shapes(phi_x, phi_a)
    refuse_gaps(("DOF", "mode"), phi_x=x, phi_a=a)  # a mass matrix needs the motion of every DOF
    mass = np.asarray(M)
    mass = np.diag(mass) if mass.ndim == 1 else mass
    if mass.shape != (len(x), len(x)):
        msg = (
            f"the mass matrix has shape {np.shape(M)}; {len(x)} DOFs need ({len(x)}, {len(x)}), or the "
            f"{len(x)} numbers on its diagonal"
        )
        raise ValueError(msg)
    unit = []
    for name, p in (("phi_x", x), ("phi_a", a)):
        modal = np.real((p.conj() * (mass @ p)).sum(axis=0))
        if not (modal > 0).all():
            k = int(np.flatnonzero(~(modal > 0))[0])
            msg = (
                f"mode {k} of {name} has the modal mass {modal[k]:.3g}; it must be positive (counted from 0)"
            )
            raise ValueError(msg)
        unit.append(p / np.sqrt(modal))
    return unit[0].conj().T @ mass @ unit[1]


def principal_angles(phi_x: ArrayLike, phi_a: ArrayLike) -> Floats:
    """Compute the principal angles between the spaces that two sets of shapes span.

    Björck and Golub, Math. Comp. 27, 1973, 579-594, with sines for small angles. For close or repeated modes
    any combination is as good a shape: only the spaces can be compared. For single shapes cos² is MAC.

    Parameters
    ----------
    phi_x, phi_a : array_like (n_dof, n_modes)
        Shapes at the same DOFs; those that depend on others do not count, nor do DOFs that one of them lacks.

    Returns
    -------
    ndarray (smaller number of dimensions,)
        Rising, 0 to π/2 [rad].

    Raises
    ------
    ValueError
        If the numbers of DOFs differ.
    """
    x, a = _shapes(phi_x, phi_a)
    known = ~(np.isnan(x).any(axis=1) | np.isnan(a).any(axis=1))
    x, a = orthonormal_basis(x[known]), orthonormal_basis(a[known])
    if x.shape[1] > a.shape[1]:
        x, a = a, x
    cross = a.conj().T @ x
    cosine = np.minimum(np.linalg.svd(cross, compute_uv=False), 1.0)
    sine = np.minimum(np.linalg.svd(x - a @ cross, compute_uv=False)[::-1], 1.0)
    return np.where(cosine**2 > 0.5, np.arcsin(sine[: cosine.size]), np.arccos(cosine))


def subspace_mac(phi_x: ArrayLike, phi_a: ArrayLike) -> Floats:
    """Compute the largest MAC that each shape has with any combination of a set of shapes.

    ‖P φ_x‖² / ‖φ_x‖² with P onto the set's space: D'Ambrogio and Fregolent's S2MAC for two (Mech. Syst.
    Signal Process. 17, 2003, 599-610), here for any number. A set of m shapes at n DOFs has m/n for a random
    shape, and 1 for any shape as soon as m = n.

    Parameters
    ----------
    phi_x : array_like (n_dof, n_modes_x)
    phi_a : array_like (n_dof, m)
        The set: close or repeated modes.

    Returns
    -------
    ndarray (n_modes_x,)
        Over the DOFs that the shape and the whole set have, 0 to 1.

    Raises
    ------
    ValueError
        If the numbers of DOFs differ, or a value is infinite.
    """
    x, a = _shapes(phi_x, phi_a)
    known = np.logical_not(np.isnan(x) | np.isnan(a).any(axis=1, keepdims=True))
    out = np.zeros(x.shape[1])
    patterns, of = np.unique(known, axis=1, return_inverse=True)
    for k, rows in enumerate(patterns.T):
        mine = of.ravel() == k
        part_x = x[np.ix_(rows, mine)]
        size = _norms(part_x)
        part = _norms(orthonormal_basis(a[rows]).conj().T @ part_x)
        out[mine] = np.minimum(np.divide(part, size, out=np.zeros(size.shape), where=size > 0), 1.0) ** 2
    return out


def orthonormal_basis(phi: Array) -> Array:
    """Return an orthonormal basis (n_dof, rank) of the space of shapes, each taken with unit length."""
    size = _norms(phi)
    unit = phi[:, size > 0] / size[size > 0]
    U, s, _ = np.linalg.svd(unit, full_matrices=False)
    # Singular values below this part of the largest are rounding: the vectors depend on one another
    return U[:, s > 1e-10 * s.max(initial=0.0)]


def _shapes(phi_x: ArrayLike, phi_a: ArrayLike) -> tuple[Array, Array]:
    x, a = (np.atleast_2d(np.asarray(p).T).T for p in (phi_x, phi_a))
    if x.shape[0] != a.shape[0]:
        msg = f"the shapes have {x.shape[0]} and {a.shape[0]} DOFs; MAC needs the same DOFs in both"
        raise ValueError(msg)
    for name, p in (("phi_x", x), ("phi_a", a)):
        bad = np.argwhere(np.isinf(p))
        if len(bad):
            dof, mode = bad[0]
            msg = (
                f"{len(bad)} value(s) of {name} are infinite, the first at DOF {dof}, mode {mode}, from 0; a "
                "value that was not measured is NaN"
            )
            raise ValueError(msg)
    return x, a


def refuse_gaps(axes: Sequence[str], **data: NDArray[Any]) -> None:
    """Refuse values that are not finite: a sum over them would not be a number.

    Parameters
    ----------
    axes : sequence of str
        Names of the axes, for the message.
    **data : ndarray
        By name.

    Raises
    ------
    ValueError
        If there are such values.
    """
    for name, values in data.items():
        bad = np.argwhere(~np.isfinite(values))
        if len(bad):
            at = ", ".join(f"{axis} {k}" for axis, k in zip(axes, bad[0], strict=False))
            msg = (
                f"{len(bad)} value(s) of {name} are not finite numbers, the first at {at}, from 0; leave "
                f"such {axes[0]}s out of both"
            )
            raise ValueError(msg)


def _pairs(phi_x: ArrayLike, phi_a: ArrayLike) -> tuple[Array, Array]:
    x, a = _shapes(phi_x, phi_a)
    if x.shape[1] != a.shape[1]:
        msg = f"{x.shape[1]} and {a.shape[1]} shapes are given; column by column they must belong together"
        raise ValueError(msg)
    x, a = (p if np.iscomplexobj(p) else p.astype(float) for p in (x, a))
    return x, a


def _measured(x: Array, a: Array) -> Bools:
    """Return which values both shapes of a pair have, shape (n_dof, n_pairs)."""
    return ~(np.isnan(x) | np.isnan(a))


def _without_gaps(x: Array, a: Array) -> tuple[Array, Array]:
    """Return pairs of shapes with zeros in both where one of the two has a gap: sums leave these out."""
    measured = _measured(x, a)
    return (x, a) if measured.all() else (np.where(measured, x, 0), np.where(measured, a, 0))


def _norms(phi: Array) -> Floats:
    return np.linalg.norm(phi, axis=0)


def _largest_one(phi: Array) -> Array:
    size = np.abs(phi).max(axis=0, initial=0.0)
    return np.divide(phi, size, out=np.zeros_like(phi), where=size > 0)


def _mac_without(x: Array, a: Array, kept: Bools) -> Floats:
    """Return the MAC of each pair over the kept DOFs but one, for each DOF, by taking off its terms."""
    x, a = x * kept[:, None], a * kept[:, None]
    terms = x.conj() * a, np.abs(x) ** 2, np.abs(a) ** 2
    cross, square_x, square_a = (t.sum(axis=0) - t for t in terms)
    size = square_x * square_a
    least = (1e-12 * terms[1].sum(axis=0)) * (1e-12 * terms[2].sum(axis=0))  # below this is rounding
    return np.minimum(np.divide(np.abs(cross) ** 2, size, out=np.zeros(size.shape), where=size > least), 1.0)
