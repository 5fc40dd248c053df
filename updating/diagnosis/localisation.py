"""Where a model fails.

Which sensors and bands carry the misfit, and which members and joints could take it away.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.effects import candidate_kinds, effect_classes
from fem.model import Effect, applicable
from fem.summary import fields_summary
from updating.correlation import compare
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult


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
    note: str

    __repr__ = fields_summary


def locate(problem: FitProblem, result: FitResult, n_bands: int = 8) -> Localisation:
    """Find where a fitted model fails.

    Members, joints and supports are judged by a score test: the residual is projected on what a small change
    of each place's stiffness, mass or damping does to the FRFs, after the directions of the nuisance
    parameters have been taken out.

    Parameters
    ----------
    problem : FitProblem
    result : FitResult
        Usually with fitted nuisance parameters and no added effect.
    n_bands : int
        Equal bands for the map.
    """
    m = problem.data.measurement.frf
    comparison = compare(m, problem.frf(result), n_bands, problem.data.mask)
    members: dict[str, float] = dict.fromkeys(problem.reduced.model.mesh.members, 0.0)
    places: dict[str, float] = {}
    project = _Projection.of(problem, result)
    classes = [effect_classes()[kind] for kind in candidate_kinds()]
    for cls in (c for c in classes if not c.is_form):
        proposed = cls.propose(problem.reduced.model)
        for effect in applicable(proposed, problem.reduced.model):
            if effect.amplitude_dependent:
                continue
            share = max((project.share(e, start) for e, start in _small(effect, problem)), default=0.0)
            member = getattr(effect, "member", None)
            if member is not None:
                members[member] = max(members[member], share)
            else:
                label = effect.where.rpartition(",")[0] or effect.where
                places[label] = max(places.get(label, 0.0), share)
    note = (
        "Shares come from a linear estimate: they say where a small change would help, not what is wrong. "
        "A large effect shows at places that move like it; only the fits of the candidates decide."
    )
    by_input = np.array([_rms(comparison.log_ratio[:, :, j].real) for j in range(len(m.inputs))])
    return Localisation(
        m.outputs, m.inputs, comparison.by_sensor(), by_input, comparison.bands, comparison.by_band(),
        members, tuple(sorted(places.items(), key=lambda item: -item[1])), note,
    )  # fmt: skip


def _small(effect: Effect, problem: FitProblem) -> list[tuple[Effect, dict[str, float]]]:
    """Return an effect at values where it is weak, at each of the places that its grid has."""
    out: dict[tuple[float, ...], tuple[float, dict[str, float]]] = {}
    for point in effect.starts(problem.surroundings):
        place = tuple(round(v, 9) for k, v in point.items() if k == "position")
        absent = {p.name: p.absent for p in effect.parameters()}
        strength = sum(_distance(v, absent[k]) for k, v in point.items() if k != "position")
        if place not in out or strength < out[place][0]:
            out[place] = (strength, point)
    return [(effect, point) for _, point in out.values()]


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

    @classmethod
    def of(cls, problem: FitProblem, result: FitResult, n_lines: int = 80) -> "_Projection":
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
        after = self.problem.receptance(changed, self.lines)
        d = np.where(
            self.weight > 0, self.weight * np.log(np.where(self.weight > 0, after / self.before, 1.0)), 0.0
        )
        return _flat(self.problem.data.seen(d))

    def share(self, effect: Effect, start: dict[str, float]) -> float:
        """Return the share of the residual that the direction of an effect explains."""
        values = {**self.result.values, **{(effect.name, k): v for k, v in start.items()}}
        try:
            column = self._column(replace(self.result, values=values, effects=(*self.result.effects, effect)))
        except np.linalg.LinAlgError:  # no structure: more mass taken away than there is
            return 0.0
        column = column - self.basis @ (self.basis.T @ column)
        norm = np.linalg.norm(column)
        total = np.linalg.norm(self.residual)
        if norm == 0 or total == 0:
            return 0.0
        return float((column @ self.residual / (norm * total)) ** 2)


def _flat(z: NDArray[Any]) -> NDArray[np.float64]:
    """Return real and imaginary parts of complex numbers in one row."""
    return np.concatenate([np.real(z).ravel(), np.imag(z).ravel()])


def _rms(x: NDArray[np.float64]) -> float:
    x = x[np.isfinite(x)]
    return float(np.sqrt((x**2).mean()) * 20 / np.log(10)) if x.size else float("nan")
