"""Where a model fails.

Which sensors and bands carry the misfit, and which members and joints could take it away.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.effects import candidate_kinds, effect_classes
from fem.model import Effect, applicable
from fem.reduction.local_changes import Fields, LocalChanges
from fem.summary import fields_summary
from updating.correlation import compare
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult

LEAST_SHARE = 0.1
"""Shares say something of the place if one of them is at least this [-]."""
MOST_SOLVED = 2000
"""Of more small changes those are solved for that explain most to first order, and the best of each place."""
LINEAR = (
    "Shares come from a linear estimate: they say where a small change would help, not what is wrong. "
    "A large effect shows at places that move like it; only the fits of the candidates decide."
)
NOWHERE = (
    f"No small change of a member, joint or support explains {100 * LEAST_SHARE:.0f} % of the misfit: the "
    "linear estimate does not say where the model fails. A large effect moves resonances farther than it can "
    "follow; only the fits of the candidates decide."
)
N_LINES, LEAST_LINES = 80, 12
"""Number of lines at which small changes are judged, and the least where there are very many changes."""
MOST_RESPONSES = 20_000_000
"""Largest number of responses of all DOFs, to sensors and forces at all lines, kept for the estimate."""


@dataclass(frozen=True, slots=True, eq=False)
class Localisation:
    """Where the misfit of a fitted model is.

    Attributes
    ----------
    sensors, inputs : tuple of str
        Names of responses and forces.
    by_sensor_db, by_input_db : ndarray (n_out,), (n_in,)
        Root mean square of the amplitude's error [dB]; NaN where nothing was compared.
    bands : ndarray (n_bands + 1,)
        Edges [Hz].
    by_band_db : ndarray (n_out, n_bands)
        The same in each band [dB].
    members : mapping of str to float
        For each member, the share of the misfit (sum of squared residuals) that a small change of it would
        explain, 0 to 1.
    places : tuple of (str, float)
        The same for joints and supports, best first.
    points : mapping of str to ndarray (n, 3)
        Points of each of these places [m].
    note : str
        How far this is to be trusted.
    """

    sensors: tuple[str, ...]
    inputs: tuple[str, ...]
    by_sensor_db: NDArray[np.float64]
    by_input_db: NDArray[np.float64]
    bands: NDArray[np.float64]
    by_band_db: NDArray[np.float64]
    members: Mapping[str, float]
    places: tuple[tuple[str, float], ...]
    points: Mapping[str, NDArray[np.float64]]
    note: str

    __repr__ = fields_summary

    @property
    def says_where(self) -> bool:
        """Whether a small change of some place would explain a part of the misfit worth the name."""
        shares = [*self.members.values(), *(share for _, share in self.places)]
        return max(shares, default=0.0) >= LEAST_SHARE


def locate(problem: FitProblem, result: FitResult, n_bands: int = 8) -> Localisation:
    """Find where a fitted model fails.

    Members, joints and supports are judged by a score test: the residual is projected on what a small change
    of each place's stiffness, mass or damping does to the FRFs, after the directions of the nuisance
    parameters have been taken out. Effects are solved for at their weakest start, all else as it was fitted;
    of very many, those that explain most to first order.

    Parameters
    ----------
    problem : FitProblem
    result : FitResult
        Usually with fitted nuisance parameters and no added effect.
    n_bands : int
        Equal bands for the map.
    """
    m = problem.measured  # set right for faults, unlike the FRFs of the measurement
    comparison = compare(m, problem.frf(result), n_bands, problem.data.mask)
    members: dict[str, float] = dict.fromkeys(problem.reduced.model.mesh.members, 0.0)
    places: dict[str, float] = {}
    points: dict[str, NDArray[np.float64]] = {}
    changes = list(_changes(problem))
    many = len(changes) > MOST_SOLVED
    project = _Projection.of(problem, result, _few_lines(problem) if many else N_LINES)
    for change in _most_telling(project, changes) if many else changes:
        found = members if change.in_member else places
        found[change.place] = max(found.get(change.place, 0.0), project.share(change))
        if not change.in_member and change.place not in points:
            points[change.place] = change.effect.locations(problem.reduced.model)
    by_input = np.array([_rms(comparison.log_ratio[:, :, j].real) for j in range(len(m.inputs))])
    found = Localisation(
        sensors=m.outputs,
        inputs=m.inputs,
        by_sensor_db=comparison.by_sensor(),
        by_input_db=by_input,
        bands=comparison.bands,
        by_band_db=comparison.by_band(),
        members=members,
        places=tuple(sorted(places.items(), key=lambda item: -item[1])),
        points=points,
        note=LINEAR,
    )
    return found if found.says_where else replace(found, note=NOWHERE)


@dataclass(frozen=True, slots=True, eq=False)
class _Change:
    """A weak effect at a place."""

    effect: Effect
    place: str
    in_member: bool


def _changes(problem: FitProblem) -> Iterator[_Change]:
    """Yield each candidate where it is weak, at each of the places that its grid has."""
    model = problem.reduced.model
    classes = [effect_classes()[kind] for kind in candidate_kinds()]
    for cls in (c for c in classes if not c.is_form):
        for effect in applicable(cls.propose(model), model):
            if effect.amplitude_dependent:
                continue
            member = getattr(effect, "member", None)
            place = effect.where.rpartition(",")[0] or effect.where if member is None else member
            for point in _weak_points(effect, problem):
                yield _Change(effect.with_values(**point), place, member is not None)


def _weak_points(effect: Effect, problem: FitProblem) -> list[dict[str, float]]:
    """Return values at which an effect is weak, at each of the places that its grid has."""
    out: dict[tuple[float, ...], tuple[float, dict[str, float]]] = {}
    for point in effect.starts(problem.surroundings):
        place = tuple(round(v, 9) for k, v in point.items() if k == "position")
        absent = {p.name: p.absent for p in effect.parameters()}
        strength = sum(_distance(v, absent[k]) for k, v in point.items() if k != "position")
        if place not in out or strength < out[place][0]:
            out[place] = (strength, point)
    return [point for _, point in out.values()]


def _few_lines(problem: FitProblem) -> int:
    """Return at how many lines the responses of all DOFs are kept."""
    frf = problem.data.measurement.frf
    responses = problem.reduced.model.n_dof * (len(frf.outputs) + len(frf.inputs))
    return min(N_LINES, max(MOST_RESPONSES // responses, LEAST_LINES))


def _most_telling(project: "_Projection", changes: Sequence[_Change]) -> list[_Change]:
    """Return the changes that explain most to first order, the best of each place, and all without one.

    Effects that release a constraint have no first order. Nor is there much of one where uncertain parameters
    do the same, as for a joint whose stiffness is uncertain: only its second order remains.
    """
    fields = project.solved(()).fields()
    small, shares, others = [], [], []
    for change in changes:
        share, distinct = (0.0, 0.0) if change.effect.released() else project.first_order(change, fields)
        if distinct < 0.5:
            others.append(change)
            continue
        small.append(change)
        shares.append(share)
    ranked = [small[k] for k in np.argsort(-np.array(shares), kind="stable")]
    best: dict[tuple[bool, str], int] = {}
    for k, change in enumerate(ranked):
        best.setdefault((change.in_member, change.place), k)
    return [*ranked[:MOST_SOLVED], *(ranked[k] for k in best.values() if k >= MOST_SOLVED), *others]


def _distance(value: float, absent: float) -> float:
    if not np.isfinite(absent):
        return 1 / value
    return abs(np.log(value / absent)) if absent > 0 and value > 0 else abs(value - absent)


@dataclass(frozen=True, slots=True, eq=False)
class _Projection:
    problem: FitProblem
    result: FitResult
    residual: NDArray[np.float64]
    basis: NDArray[np.float64]
    weight: NDArray[np.float64]
    lines: NDArray[np.int64]
    before: NDArray[np.complex128]
    # By released constraints: the model solved at the lines.
    _solved: dict[tuple[tuple[str, str], ...], LocalChanges] = field(default_factory=dict)

    @classmethod
    def of(cls, problem: FitProblem, result: FitResult, n_lines: int) -> "_Projection":
        problem = problem.unloaded(result)
        lines = problem.lines_up_to(np.inf, n_lines)
        before = problem.receptance(result, lines)
        keep = problem.data.mask[lines]
        measured = np.where(keep, problem.data.H[lines], 1.0)
        ratio = problem.data.seen(np.log(before / measured))
        r = np.where(keep, problem.data.weight[lines] * ratio, 0.0)
        # Robust weights: a line next to a shifted resonance does not decide.
        weight = problem.data.weight[lines] / (1 + np.abs(r) ** 2 / 0.25) ** 0.25 * keep
        empty = cls(problem, result, np.zeros(0), np.zeros((0, 0)), weight, lines, before)
        columns = []
        for ref, value in result.values.items():
            step = 1e-4 * (abs(value) or 1.0)
            columns.append(empty._column(replace(result, values={**result.values, ref: value + step})))
        for k in range(len(result.zeta)):
            zeta = result.zeta.copy()
            zeta[k] *= 1.01
            columns.append(empty._column(replace(result, zeta=zeta)))
        A = np.column_stack(columns) if columns else np.zeros((2 * weight.size, 0))
        Q = np.linalg.qr(A / np.maximum(np.linalg.norm(A, axis=0), 1e-300))[0] if A.size else A
        flat = _flat(np.where(keep, weight * ratio, 0.0))
        return cls(problem, result, flat - Q @ (Q.T @ flat), Q, weight, lines, before)

    def _column(self, changed: FitResult) -> NDArray[np.float64]:
        """Return what other values of the fit change."""
        return self._seen(self.problem.receptance(changed, self.lines) / self._divisor)

    @property
    def _divisor(self) -> NDArray[np.complex128]:
        return np.where(self.weight > 0, self.before, 1.0)

    def _seen(self, ratio: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the weighted logarithm of a ratio of FRFs to those before."""
        counts = self.weight > 0
        return _flat(
            self.problem.data.seen(np.where(counts, self.weight * np.log(np.where(counts, ratio, 1.0)), 0.0))
        )

    def solved(self, released: tuple[tuple[str, str], ...]) -> LocalChanges:
        """Return the fitted model solved at the lines, without the constraints that an effect releases."""
        if released not in self._solved:
            p, fit = self.problem.with_forces_of(self.result), self.result
            f, refs = p.data.frequency[self.lines], list(fit.values)
            engine, values = p.engine(f, refs, fit.effects, released), [fit.values[ref] for ref in refs]
            self._solved[released] = LocalChanges.of(engine, np.array(values), p.damping.ratio(f, fit.zeta))
        return self._solved[released]

    def share(self, change: _Change) -> float:
        """Return the share of the residual that a small change explains."""
        (H,) = self.solved(change.effect.released()).receptances([change.effect])
        if not np.isfinite(H).all():  # no structure: more mass taken away than there is
            return 0.0
        return self._explained(self._seen(H / self._divisor))

    def first_order(self, change: _Change, fields: Fields) -> tuple[float, float]:
        """Return the same for -Hₒ ΔZ Hᵢ, and the share of it that no uncertain parameter does.

        ΔZ is the change of the effect's own few element matrices.
        """
        parts = self.problem.reduced.model.parts_of(change.effect)
        slope = fields.slope(parts, change.effect.connection) / self._divisor
        column = _flat(self.problem.data.seen(self.weight * slope))
        size, known = column @ column, self.basis.T @ column
        return self._explained(column), float(1 - known @ known / size) if size > 0 else 1.0

    def _explained(self, column: NDArray[np.float64]) -> float:
        column = column - self.basis @ (self.basis.T @ column)
        norm, total = np.linalg.norm(column), np.linalg.norm(self.residual)
        if norm == 0 or total == 0:
            return 0.0
        return float((column @ self.residual / (norm * total)) ** 2)


def _flat(z: NDArray[Any]) -> NDArray[np.float64]:
    """Return real and imaginary parts of complex numbers in one row."""
    return np.concatenate([np.real(z).ravel(), np.imag(z).ravel()])


def _rms(x: NDArray[np.float64]) -> float:
    x = x[np.isfinite(x)]
    return float(np.sqrt((x**2).mean()) * 20 / np.log(10)) if x.size else float("nan")
