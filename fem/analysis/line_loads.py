"""Loads between the nodes: their places on the lines, and the nodal forces that do their work.

Distributed and concentrated loads and the lines' weight become `SpreadLoads`, from which section forces
follow; `nodal_loads` and `nodal_weights` are the right-hand side of K u = f.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fem.analysis.loads import InitialStrain, LineLoad, LoadCase, MemberForce, checked_vector
from fem.array_types import Floats, Ints
from fem.elements import tapered
from fem.elements.frame import Frame
from fem.elements.interpolation import gauss_points
from fem.elements.layout import axes_and_arms, layout_of
from fem.elements.properties import LUMPED
from fem.mesh import Location
from fem.model import Contribution, Model, ModelError


@dataclass(frozen=True, slots=True, eq=False)
class LineAxes:
    """Ends of the lines' axes, and their local axes."""

    offset: Floats  # (n_lines, 2, 3): from the nodes to the ends of the axis
    zone: Floats  # (n_lines, 2): rigid zones, fractions of the axis
    span: Floats  # (n_lines,): length of the axis
    R: Floats  # (n_lines, 3, 3)

    def offset_at(self, lines: Ints, xi: Floats) -> Floats:
        """Return the offsets at fractions of lines, shape (n, 3)."""
        o = self.offset[lines]
        return o[:, 0] + xi[:, None] * (o[:, 1] - o[:, 0])


@dataclass(frozen=True, slots=True, eq=False)
class SpreadLoads:
    """Loads between the ends of lines: distributed ones, and concentrated ones where both xi are equal."""

    line: Ints  # (m,), rising
    case: Ints  # (m,)
    xi: Floats  # (m, 2)
    force: Floats  # (m, 2, 3): global; per length if distributed
    axes: LineAxes  # of all lines of the model, found once for the loads and for all cuts

    def case_of(self, column: int) -> "SpreadLoads":
        """Return the loads of one load case alone."""
        rows = np.flatnonzero(self.case == column)
        return SpreadLoads(self.line[rows], 0 * self.case[rows], self.xi[rows], self.force[rows], self.axes)


def loads_on_members(model: Model, axes: LineAxes, cases: Sequence[LoadCase]) -> tuple[SpreadLoads, Floats]:
    """Return the loads between the ends of lines, and initial strains (n_lines, 6, n_cases)."""
    mesh = model.mesh
    strain = np.zeros((mesh.n_lines, 6, len(cases)))
    rows: list[tuple[int, int, float, float, Floats, Floats]] = []
    for column, case in enumerate(cases):
        for load in case.members:
            for member in mesh.members_of(load.member):
                if isinstance(load, InitialStrain):
                    e0 = np.array([load.axial, 0, 0, 0, load.curvature_y, load.curvature_z], dtype=float)
                    if not np.isfinite(e0).all():
                        msg = f"load case '{case.name}': an initial strain of member '{member}' is not finite"
                        raise ModelError(msg)
                    strain[mesh.members[member], :, column] += e0
                else:
                    rows += [(r[0], column, *r[1:]) for r in _pieces(model, axes, member, load)]
    return spread_loads(rows, axes), strain


def spread_loads(rows: Sequence[tuple[Any, ...]], axes: LineAxes) -> SpreadLoads:
    """Return loads from rows of line, case, both fractions and both forces."""
    rows = sorted(rows, key=lambda r: r[0])
    return SpreadLoads(
        np.array([r[0] for r in rows], dtype=np.int64),
        np.array([r[1] for r in rows], dtype=np.int64),
        np.array([r[2:4] for r in rows], dtype=float).reshape(-1, 2),
        np.array([r[4:6] for r in rows], dtype=float).reshape(-1, 2, 3),
        axes,
    )


def _pieces(
    model: Model, axes: LineAxes, member: str, load: LineLoad | MemberForce
) -> list[tuple[int, float, float, Floats, Floats]]:
    """Return line, range of fractions and forces at its ends for each line that a load touches."""
    mesh = model.mesh
    if load.axes not in ("global", "local"):
        msg = f"a load on member '{member}' is in '{load.axes}' axes; allowed are global, local"
        raise ModelError(msg)

    def turned(force: Floats, line: int) -> Floats:
        return force if load.axes == "global" else axes.R[line].T @ force

    if isinstance(load, MemberForce):
        at = mesh.locate(member, load.position)
        force = turned(checked_vector(load.force, f"force on member '{member}'"), at.line)
        return [(at.line, at.xi, at.xi, force, force)]
    s = mesh.member_positions(member)
    stop = float(s[-1]) if load.stop is None else float(load.stop)
    slack = 1e-9 * s[-1]
    if not -slack <= load.start < stop <= s[-1] + slack:
        msg = (
            f"a line load on member '{member}' goes from {load.start:g} to {stop:g} m; it must rise within "
            f"0 to {s[-1]:g} m"
        )
        raise ModelError(msg)
    first = checked_vector(load.force1, f"line load on member '{member}'")
    last = first if load.force2 is None else checked_vector(load.force2, f"line load on member '{member}'")
    out = []
    for line, a, b in zip(mesh.members[member].tolist(), s[:-1], s[1:], strict=True):
        lo, hi = max(a, load.start), min(b, stop)
        if hi <= lo:
            continue
        at = [first + (x - load.start) / (stop - load.start) * (last - first) for x in (lo, hi)]
        xi = (lo - a) / (b - a), (hi - a) / (b - a)
        out.append((line, *xi, *(turned(q, line) for q in at)))
    return out


def line_axes(model: Model) -> LineAxes:
    """Return the axes of a model's lines."""
    (frame,), mesh = model.of_kind(Frame), model.mesh
    layout, rows = layout_of(frame.members, mesh), np.arange(mesh.n_lines)
    R, _, span, _ = axes_and_arms(layout, mesh, rows)
    return LineAxes(layout.offset, layout.zone / span[:, None], span, R)


def axis_motion(model: Model, axes: LineAxes, lines: Ints, xi: Floats) -> Floats:
    """Return the motion of places on the lines' axes from the lines' DOFs, global, shape (n, 6, 12)."""
    (frame,) = model.of_kind(Frame)
    N = np.real(frame.motions_at(model.mesh, lines, xi)[1]).copy()
    N[:, :3] += np.cross(N[:, 3:], axes.offset_at(lines, xi)[:, :, None], axis=1)
    return N


def line_dofs(model: Model) -> Ints:
    """Return the DOFs of all lines, shape (n_lines, 12)."""
    return (6 * model.mesh.lines[:, :, None] + np.arange(6)).reshape(-1, 12)


def nodal_loads(
    model: Model, axes: LineAxes, spread: SpreadLoads, strain: Floats, cases: Sequence[LoadCase]
) -> Floats:
    """Return the nodal forces that do the work of the loads on lines, shape (n_lines, 12, n_cases).

    f = ∫ Nᵀ q dx + ∫ Bᵀ (EA ε₀ …) dx. The shape functions of prismatic lines are cubic and the loads linear,
    on the flexible part and on each rigid zone: three Gauss points on each are exact.
    """
    (frame,) = model.of_kind(Frame)
    out = np.zeros((model.mesh.n_lines, 12, len(cases)))
    zone = axes.zone[spread.line]
    point = spread.xi[:, 0] == spread.xi[:, 1]
    parts = ((0 * zone[:, 0], zone[:, 0]), (zone[:, 0], 1 - zone[:, 1]), (1 - zone[:, 1], 1 + 0 * zone[:, 1]))
    for first, last in parts:
        lo, hi = np.maximum(spread.xi[:, 0], first), np.minimum(spread.xi[:, 1], last)
        k = np.flatnonzero((hi > lo) & ~point)
        for x, w in zip(*gauss_points(tapered.N_STATIONS if frame.has_tapers else 3), strict=True):
            xi = lo[k] + x * (hi[k] - lo[k])
            q = force_at(spread, k, xi) * (w * (hi - lo)[k] * axes.span[spread.line[k]])[:, None]
            _add_work(out, model, axes, spread, k, xi, q)
    k = np.flatnonzero(point)
    _add_work(out, model, axes, spread, k, spread.xi[k, 0], spread.force[k, 0])
    rows = np.flatnonzero(strain.any(axis=(1, 2)))
    if rows.size:
        out[rows] += np.real(frame.forces_of_strains(model.mesh, rows, strain[rows]))
    return out


def _add_work(
    out: Floats, model: Model, axes: LineAxes, spread: SpreadLoads, k: Ints, xi: Floats, force: Floats
) -> None:
    """Add the work of forces on the loads k of ``spread``, at fractions xi of their lines, to ``out``."""
    if k.size:
        N = axis_motion(model, axes, spread.line[k], xi)[:, :3]
        np.add.at(np.moveaxis(out, 1, 2), (spread.line[k], spread.case[k]), np.einsum("bki,bk->bi", N, force))


def force_at(spread: SpreadLoads, k: Ints, xi: Floats) -> Floats:
    """Return the forces of the loads k at fractions of their lines, shape (n, 3)."""
    x0, x1 = spread.xi[k].T
    share = np.divide(xi - x0, x1 - x0, out=np.zeros_like(xi), where=x1 > x0)
    return spread.force[k, 0] + share[:, None] * (spread.force[k, 1] - spread.force[k, 0])


def rigidity_at(model: Model, line: int, xi: Floats) -> Floats:
    """Return EA, ky GA, kz GA, GJ, EIy and EIz at fractions of a line, (n, 6); 0 without shear strain."""
    (frame,) = model.of_kind(Frame)
    return np.real(frame.rigidity(model.mesh, [Location(line, float(x)) for x in xi]))


def nodal_weights(model: Model, gravity: Floats) -> Floats:
    """Return the nodal forces of gravity on the lines' mass, shape (n_lines, 12, n_cases)."""
    mesh = model.mesh
    out = np.zeros((mesh.n_lines, 12, gravity.shape[1]))
    if not gravity.any():
        return out
    field = np.tile(np.vstack([np.eye(3), np.zeros((3, 3))]), (2, 1)) @ gravity
    for rows, c in elements_on_lines(model):
        if c.M is not None:
            np.add.at(out, rows, np.real(c.M) @ field)
    return out


def elements_on_lines(model: Model) -> Iterator[tuple[Ints, Contribution]]:
    """Yield the elements of the frame and of effects within members, with the lines that they are on (b,)."""
    mesh = model.mesh
    for effect in model.effects:
        for c in effect.contribute(model) if effect.within_members else ():
            if c.dofs.shape[1] == 12:
                rows = c.lines
                if rows is None:
                    altered = [lines for m, lines in mesh.members.items() if effect.alters(model, m)]
                    rows = _lines_of_elements(model, np.concatenate(altered), c.dofs)
                yield rows, c


def _lines_of_elements(model: Model, rows: Ints, dofs: Ints) -> Ints:
    """Return the line, out of ``rows``, of each element of 12 DOFs."""
    if len(rows) == len(dofs) and (line_dofs(model)[rows] == dofs).all():
        return rows  # also where two lines join the same points
    first = model.mesh.lines[rows, 0]
    order = np.argsort(first)
    return rows[order[np.searchsorted(first[order], dofs[:, 0] // 6)]]


_UNIFORM = np.array([0.0, 1.0]), np.ones(2)


def _mass_along(model: Model, line: int, first: float, last: float) -> tuple[Floats, Floats]:
    """Return places on a tapered line, and its mass per length there relative to the mean."""
    # Stretches of a tapered line along which its weight is linear
    x = np.linspace(0, 1, 32 + 1)
    area = rigidity_at(model, line, first + x * (last - first))[:, 0]
    return x, area / np.trapezoid(area, x)


def _masses_between(model: Model) -> Iterator[tuple[int, float, float]]:
    """Yield masses at places between the ends of lines: line, fraction of it and mass [kg]."""
    along_x = np.tile(np.eye(6)[0], 2)
    for rows, c in elements_on_lines(model):
        if c.xi is not None and c.M is not None:
            masses = np.real(along_x @ c.M @ along_x)
            yield from zip(rows.tolist(), c.xi.tolist(), masses.tolist(), strict=True)


def with_weights(
    model: Model, axes: LineAxes, spread: SpreadLoads, gravity: Floats, weights: Floats
) -> SpreadLoads:
    """Return loads between the ends of lines with the lines' weight and that of masses on members."""
    if not gravity.any():
        return spread
    mesh, (frame,) = model.mesh, model.of_kind(Frame)
    force = weights[:, :3] + weights[:, 6:9]
    rows: list[tuple[Any, ...]] = list(
        zip(spread.line, spread.case, *spread.xi.T, spread.force[:, 0], spread.force[:, 1], strict=True)
    )
    for line, xi, mass in _masses_between(model):
        for c in np.flatnonzero(gravity.any(axis=0)):
            weight = mass * gravity[:, c]
            force[line, :, c] -= weight
            rows.append((line, int(c), xi, xi, weight, weight))
    lumped = np.zeros(mesh.n_lines, dtype=bool)
    for member, chain in mesh.members.items():
        lumped[chain] = getattr(frame.members[member], "mass", "consistent") in LUMPED
    a, b = axes.zone[:, 0], 1 - axes.zone[:, 1]
    per_length = force / ((b - a) * axes.span)[:, None, None]
    courses = {
        line: _mass_along(model, line, float(a[line]), float(b[line])) for line in frame.tapered_lines(mesh)
    }
    for c in np.flatnonzero(gravity.any(axis=0)):
        for line in np.flatnonzero(~lumped):
            x, share = courses.get(int(line), _UNIFORM)
            at, q = a[line] + x * (b[line] - a[line]), share[:, None] * per_length[line, :, c]
            rows += [(line, int(c), *at[i : i + 2], *q[i : i + 2]) for i in range(len(x) - 1)]
    return spread_loads(rows, axes)
