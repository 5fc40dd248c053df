"""Responses to a prescribed motion of the base: of all supports as one rigid body, or of single ones.

With the motion r of the structure that follows a slow motion w of the base, u = r w + Q q. The remainder q
answers to the forces that r leaves: Z q = -Qᵀ (Z r - f_g), f_g those of elastic elements whose ground moves.
Stiffness gives none, K r = f_g; inertia gives ω² M r, and local dampers that r strains give theirs.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fem.analysis.frf import FRF, FRFError, FRFKind
from fem.analysis.frf_solver import compute_frf
from fem.analysis.participation import rigid_motion_field
from fem.analysis.planar import refuse_motion
from fem.analysis.selection import Selection, dof_columns
from fem.analysis.statics import factor_stiffness
from fem.array_types import Complexes, Floats
from fem.declarations import Role
from fem.model import DIRECTIONS, Law, Model, ModelError
from fem.system import System, law_change, particular

Motion = str | tuple[str, str]
"""A direction of all of the base such as ``"z"``, or a support or grounded element and its direction."""

_ROUNDING = 1e-9
"""Forces below this part of the sum of their entries' absolute values are rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class _Forces:
    """Vectors (n_dof,) of Z r - f_g, each with a factor that depends on ω."""

    K: Floats
    M: Floats
    C: Floats
    D: Floats
    laws: tuple[tuple[Law, Floats], ...]


def compute_base_frf(
    system: System,
    frequency: ArrayLike,
    outputs: Selection,
    motions: Sequence[Motion],
    *,
    relative: bool = False,
    about: ArrayLike | None = None,
    mass_damping: str = "relative",
    kind: FRFKind | str = FRFKind.RECEPTANCE,
    method: str = "auto",
    tolerance: float = 1e-5,
) -> FRF:
    """Compute responses to a unit motion of the base.

    As receptance a response is a displacement for a displacement of the base of 1 m (or a rotation of 1 rad):
    the transmissibility, which is also acceleration for acceleration. As mobility or accelerance it is the
    velocity or acceleration for that displacement.

    Parameters
    ----------
    system : System
    frequency : array_like (n_freq,)
        Frequencies [Hz].
    outputs : selection
        DOF numbers, (point, direction) pairs, or rows of combinations (n, n_dof).
    motions : sequence of str or (str, str)
        ``"x"`` … ``"rz"``: all supports and the grounds of all elastic elements move as one rigid body.
        ``("foot", "z")``: one support alone in a direction that it holds, or the ground of one elastic
        element, while the others rest.
    relative : bool
        Whether responses are relative to the slow motion r: for a rigid base relative to the base.
    about : array_like (3,), optional
        Point about which the base turns, the origin unless given [m].
    mass_damping : str
        Motion that Rayleigh's αM resists: ``"relative"``, as modal damping and most codes have it, or
        ``"absolute"``, as dashpots between the masses and a ground that rests.
    kind : FRFKind or str
    method, tolerance
        As for :func:`fem.analysis.frf_solver.compute_frf`, which is asked for the responses to the forces
        that r leaves.

    Returns
    -------
    FRF
        Inputs are labelled ``"base Z+"`` or ``"foot Z+"``.

    Raises
    ------
    FRFError
        For an unknown ``mass_damping``, and as :func:`fem.analysis.frf_solver.compute_frf`.
    ModelError
        For a motion of something that does not exist or is free, and for a structure that nothing holds.
    """
    if mass_damping not in ("relative", "absolute"):
        msg = f"mass_damping is '{mass_damping}'; allowed are relative, absolute"
        raise FRFError(msg)
    if not motions:
        msg = "no motion of the base is given; give such as 'z' or ('foot', 'z')"
        raise FRFError(msg)
    model = system.model
    place = np.zeros(3) if about is None else np.asarray(about, dtype=float)
    lines = np.array(frequency, dtype=float, ndmin=1)
    omega = 2 * np.pi * lines
    out, out_labels = dof_columns(model, outputs)
    columns, labels = [], []
    for motion in motions:
        r, forces, label = _followed(system, motion, place)
        rows, weights = _loads(model, forces, omega, mass_damping)
        response = np.zeros((lines.size, out.shape[1]), dtype=complex)
        if rows:
            H = compute_frf(
                system, lines, outputs, np.array(rows), FRFKind.RECEPTANCE, method, tolerance=tolerance
            ).H
            response = np.einsum("fok,kf->fo", H, np.array(weights))
        columns.append(response if relative else response + out.T @ r)
        labels.append(label)
    H = np.stack(columns, axis=2)
    return FRF.from_arrays(lines, H, FRFKind.RECEPTANCE, out_labels, labels).as_kind(kind)


def rigid_base_load(system: System, direction: str, about: ArrayLike | None = None) -> tuple[Floats, Floats]:
    """Return the rigid motion r of all of the base and M r, shapes (n_dof,).

    In coordinates relative to the base an acceleration a of it acts as the forces -M r a.

    Parameters
    ----------
    system : System
    direction : str
        ``"x"`` … ``"rz"``.
    about : array_like (3,), optional
        Point about which the base turns, the origin unless given [m].

    Raises
    ------
    ModelError
        For an unknown direction, or constraints within the structure that hold it against such a motion.
    """
    r, forces, _ = _followed(system, direction, np.zeros(3) if about is None else np.asarray(about, float))
    return r, forces.M


def _followed(system: System, motion: Motion, place: Floats) -> tuple[Floats, _Forces, str]:
    """Return the slow motion r (n_dof,), the forces that it leaves, and a label."""
    model = system.model
    constraints = model.constraints()
    if isinstance(motion, str):
        if motion not in DIRECTIONS:
            msg = f"the base moves in '{motion}'; allowed are {', '.join(DIRECTIONS)}, or a support in one"
            raise ModelError(msg)
        refuse_motion(model, motion)
        supports = (c for c in constraints if not c.everywhere and np.unique(c.dofs // 6).size == 1)
        if next(supports, None) is None and not _grounded(model):
            msg = "nothing holds the structure to the ground, so that no motion of the base reaches it"
            raise ModelError(msg)
        base = rigid_motion_field(model, place)[:, DIRECTIONS.index(motion)]
        _check_rigid(system, base, motion)
        return base, _forces(model, base, base, None), f"base {motion.upper()}+"
    name, direction = motion
    refuse_motion(model, direction)
    label = f"{name} {direction.upper()}+"
    by_key = {c.key: c for c in constraints}
    grounded = _grounded(model)
    if (name, direction) in by_key:
        moved = by_key[name, direction]
        start = particular(tuple(c for c in constraints if c is not moved), moved, model.n_dof)
        if not start.any():
            msg = f"'{name}' in {direction} cannot move alone: other constraints hold the same motion"
            raise ModelError(msg)
        base = np.zeros(model.n_dof)
        name = ""
    elif name in grounded and direction in DIRECTIONS:
        start = np.zeros(model.n_dof)
        where = model.effect(name).locations(model)[0]
        base = rigid_motion_field(model, where)[:, DIRECTIONS.index(direction)]
    else:
        known: dict[str, str] = {}
        for (holder, axis), c in by_key.items():
            if not c.everywhere:
                known[holder] = f"{known[holder]} {axis}" if holder in known else f"{holder} in {axis}"
        there = ", ".join([*known.values(), *(f"{n} in x … rz" for n in grounded)])
        msg = f"'{name}' in {direction} is nothing that holds the structure to the ground; there are {there}"
        raise ModelError(msg)
    r = start
    if not system.rigid.shape[1]:  # else any r that meets the constraints will do: forces of K remain
        forces = _forces(model, start, base, name).K
        r = start - np.asarray(system.Q @ factor_stiffness(system).solve(np.asarray(system.Q.T @ forces)))
    return r, _forces(model, r, base, name, settled=not system.rigid.shape[1]), label


def _check_rigid(system: System, base: Floats, motion: str) -> None:
    """Raise an error if a rigid motion of all violates a constraint within the structure."""
    for c in system.model.constraints():
        size = np.abs(c.coefficients) @ np.abs(base[c.dofs])
        violated = np.abs(c.coefficients @ base[c.dofs]) > _ROUNDING * size
        if violated and np.unique(c.dofs // 6).size > 1:  # of one point alone: a support
            msg = (
                f"the constraint ({', '.join(c.key)}) holds points against a motion of all in {motion}; "
                "move single supports instead"
            )
            raise ModelError(msg)


def _grounded(model: Model) -> tuple[str, ...]:
    """Return the names of effects with elements that resist the motion of a rigid body."""
    rigid = rigid_motion_field(model, model.mesh.points.mean(axis=0))
    out = []
    for effect in model.effects:
        if effect.within_members or Role.GYROSCOPIC in effect.role:
            continue  # a rotor resists its rotation in space, not that relative to its foot
        for c in effect.contribute(model):
            for X in (c.K, c.C, c.D):
                if X is None:
                    continue
                at = rigid[c.dofs]
                terms = np.abs(X) @ np.abs(at)
                if (np.abs(X @ at) > _ROUNDING * np.maximum(terms.max(), 1e-300)).any():
                    out.append(effect.name)
    return tuple(dict.fromkeys(out))


def _forces(model: Model, r: Floats, base: Floats, name: str | None, *, settled: bool = False) -> _Forces:
    """Return Z r - f_g by parts; the ground moves with ``base`` under one effect, or under all (None)."""
    grounded = _grounded(model) if name is None else (name,)
    total = {key: np.zeros(model.n_dof) for key in "KMCD"}
    terms = {key: np.zeros(model.n_dof) for key in "KMCD"}
    laws = []
    for effect in model.effects:
        moved = base if effect.name in grounded else np.zeros(model.n_dof)
        for c in effect.contribute(model):
            strain = (r - moved)[c.dofs]
            for key in "KMCD":
                X = c.static if key == "K" else getattr(c, key)
                if X is None:
                    continue
                u = r[c.dofs] if key == "M" else strain
                np.add.at(total[key], c.dofs, np.einsum("bij,bj->bi", np.real(X), u))
                np.add.at(terms[key], c.dofs, np.einsum("bij,bj->bi", abs(np.real(X)), abs(u)))
            if c.law is not None and c.K is not None:
                v = np.zeros(model.n_dof)
                np.add.at(v, c.dofs, np.einsum("bij,bj->bi", np.real(c.K), strain))
                laws.append((c.law, v))
    for key in "KCD":
        if np.abs(total[key]).max() <= _ROUNDING * terms[key].max():
            total[key] = np.zeros(model.n_dof)
    if settled:
        total["K"] = np.zeros(model.n_dof)
    return _Forces(**total, laws=tuple((law, v) for law, v in laws if v.any()))


def _loads(
    model: Model, forces: _Forces, omega: Floats, mass_damping: str
) -> tuple[list[Floats], list[Complexes]]:
    """Return the loads (n_dof,) on q and their factors (n_freq,), with the structure's damping."""
    damping = model.damping
    alpha = damping.alpha if mass_damping == "absolute" else 0.0
    stiffness = 1 + 1j * (damping.loss_factor + omega * damping.beta)
    parts: list[tuple[Floats, Any]] = [
        (forces.K, -stiffness),
        (forces.M, omega**2 - 1j * omega * alpha),
        (forces.C, -1j * omega),
        (forces.D, np.full(omega.size, -1j)),
        *((v, -law_change(law, omega)) for law, v in forces.laws),
    ]
    kept = [(v, np.asarray(g, dtype=complex)) for v, g in parts if v.any()]
    return [v for v, _ in kept], [g for _, g in kept]
