"""What has changed between two states of one structure, by the modes of both.

The model is calibrated on the first state. Two errors are common to both states: that of the form, and that
of the calibrated parameters. The first state's residuals are r = δ + J ε + n, with the form's error δ, the
parameters' error ε and noise n. The form has the share k = τ² / (σ² + τ²) of their variance. Without a change
the second state's residuals are

    r' = k r + (1 - k) J ε + n' + √k σ ξ,  ξ ~ N(0, 1).

So k r is carried over, as a change of the calibrated model's matrices in its modes
(:mod:`updating.inference.carried_modes`), and ε varies in every fit to the second state, with the first
one's posterior as its prior (:mod:`updating.inference.calibrated_errors`): a change acts on a structure
whose corners, clamps and sections are as uncertain as the first state has left them. Where they vary, the
first state's residuals do, too: r + J ε of them is the form's or noise, and k (r + J ε) is carried.

Where the first state says that the model lacks something, δ is no constant: see
:mod:`updating.diagnosis.baseline`.
"""

import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from fem.array_types import Floats, Ints
from fem.model import Effect, Model
from fem.summary import percent
from fem.system import assemble, mass_forces
from updating.diagnosis.baseline import calibrate
from updating.diagnosis.carried import CHANGED
from updating.diagnosis.evidence.diagnosis import Searched, search_progress
from updating.diagnosis.evidence.hypothesis import ScoredFit
from updating.diagnosis.evidence.mode_ranking import ModeRanking
from updating.diagnosis.evidence.search import Search
from updating.diagnosis.mode_diagnosis import (
    Baseline,
    Calibrated,
    ModeDiagnosis,
    candidates_for,
    concluded,
    searched_modes,
)
from updating.diagnosis.mode_table import HALF
from updating.inference.belief import TWIN_NATS
from updating.inference.calibrated_errors import CalibratedErrors
from updating.inference.carried_modes import CarriedModes
from updating.inference.defaults import EXPLAINED_LEVEL
from updating.inference.heartbeat import Progress
from updating.inference.mode_fit import BAD_PRIOR, FREQUENCY, ModeProblem, matched_modes, start_of
from updating.inference.mode_preparation import build_mode_problem
from updating.inference.mode_targets import FAR, LIKENESS, ModeTargets, mac_of
from updating.inference.parameters import Nuisance
from updating.inference.unknowns import values_at


def carried_modes(calibrated: Calibrated, after: ModeTargets) -> CarriedModes:
    """Return the share of the model's error of what a calibrated model misses of the first state's modes.

    Shapes where both states have the same sensors; a mode that the model or the first state has not misses
    nothing.
    """
    problem, fitted = calibrated.problem, calibrated.fitted
    before, (of_f, of_zeta, of_shape) = problem.targets, calibrated.carried_share
    computed, refs, every = calibrated.computed, list(fitted.values), np.arange(problem.targets.n)
    at = problem.parametric(every, refs, fitted.effects).at(
        np.array([fitted.values[r] for r in refs]),
        problem.damping.ratio(before.frequency, fitted.zeta),
    )
    partner = matched_modes(problem, at, every).partner
    some = np.flatnonzero((partner >= 0) & np.isfinite(computed.frequency))
    pairs = [at.pairs(int(i)) for i in some]
    lam = np.array([p.eigenvalues[partner[i]] for p, i in zip(pairs, some, strict=True)])
    x = [at.columns @ p.vectors[:, partner[i]] for p, i in zip(pairs, some, strict=True)]
    basis, system = problem.reduced.basis, assemble(calibrated.model, reciprocal=False)
    phi = basis.T @ np.stack(x, axis=1) if x else np.zeros((len(basis.T), 0))
    forces = mass_forces(system, phi)
    moved = lam * ((before.frequency / computed.frequency)[some] ** (2 * of_f[some]) - 1)
    ratio = np.where(np.isfinite(before.zeta) & (computed.zeta > 0), before.zeta / computed.zeta, 1.0)[some]
    lost = 2 * computed.zeta[some] * (ratio ** of_zeta[some] - 1) * (lam + moved)
    shapes = np.zeros((len(after.sensors), len(some)))
    if same_sensors(before, after):
        there = [p.shapes[:, partner[i]] for p, i in zip(pairs, some, strict=True)]
        each = [_shape_difference(before.shapes[:, i], c) for i, c in zip(some, there, strict=True)]
        shapes = of_shape[some] * np.array(each).T.reshape(shapes.shape)
    errors, by = calibrated_errors(calibrated)
    by_errors = 2 * (moved - of_f[some] * (lam + moved))[:, None] * by[:, some].T
    return CarriedModes(forces, moved, lost, shapes, errors, by_errors)


def with_first_errors(calibrated: Calibrated, after: ModeTargets) -> ModeTargets:
    """Return the second state's modes with variances that have what is not known of the model's error.

    That is the first state's noise, by the share that was carried over; all of the model's error where the
    first state has no reading, or a bad one.
    """
    before, k = calibrated.problem.targets, _common_modes(calibrated, after)
    known = np.array([k >= 0, k >= 0, (k >= 0) & same_sensors(before, after)])
    unknown = np.where(known, calibrated.bad[:, k], 1.0)
    noise = np.square([before.frequency_std, before.zeta_std, before.shape_std])
    more = (1 - unknown) * (calibrated.form_share * noise)[:, k]
    more += unknown * calibrated.form_error[:, None] ** 2
    stds = np.square([after.frequency_std, after.zeta_std, after.shape_std])
    f, zeta, shape = np.sqrt(stds + more)
    return replace(after, frequency_std=f, zeta_std=zeta, shape_std=shape)


def _common_modes(calibrated: Calibrated, after: ModeTargets) -> Ints:
    """Return the mode of the first state that each of the second was, -1 where that or the model has none."""
    before = calibrated.problem.targets
    out = partners(before, after)
    return np.where(np.isfinite(calibrated.computed.frequency[out]), out, -1)


def same_sensors(before: ModeTargets, after: ModeTargets) -> bool:
    """Whether both states have shapes at the same sensors."""
    return after.has_shapes and [s.name for s in after.sensors] == [s.name for s in before.sensors]


def partners(before: ModeTargets, after: ModeTargets) -> Ints:
    """Return the mode of the first state that each of the second was, -1 for none."""
    if before.numbers is not None and after.numbers is not None:
        known = {int(n): k for k, n in enumerate(before.numbers)}
        return np.array([known.get(int(n), -1) for n in after.numbers])
    off = np.abs(np.log(after.frequency[:, None] / before.frequency[None]))
    cost = LIKENESS * off
    if same_sensors(before, after):
        cost = cost - mac_of(after.shapes, np.nan_to_num(before.shapes))
    rows, columns = scipy.optimize.linear_sum_assignment(np.where(off < FAR, cost, 1e3))
    out = np.full(after.n, -1)
    ok = off[rows, columns] < FAR
    out[rows[ok]] = columns[ok]
    return out


def _shape_difference(measured: NDArray[np.number], computed: Floats) -> Floats:
    """Return measured less computed shape, scaled as the computed one; 0 at gaps."""
    known = np.isfinite(measured)
    out = np.zeros(len(computed))
    b, c = measured[known], computed[known]
    if known.sum() > 1 and (size := float((np.abs(b) ** 2).sum())) > 0:
        out[known] = np.real(b * (b.conj() @ c) / size) - c
    return out


def changed_problem(
    model: Model,
    before: ModeTargets,
    after: ModeTargets,
    nuisances: Sequence[Nuisance] = (),
    *,
    changes: Sequence[Effect] = (),
    damping_std: float = 0.5,
    model_error: float = EXPLAINED_LEVEL,
) -> tuple[Calibrated, Model, ModeProblem]:
    """Return the calibration on the first state, and model and problem of the second one.

    ``before`` and ``after`` are the modes of the two states; other parameters are as of
    :func:`updating.diagnosis.diagnose_modes.diagnose_modes`.
    """
    first = calibrate(model, before, nuisances, damping_std=damping_std, model_error=model_error)
    more: dict[str, Any] = {"damping_std": damping_std, "model_error": model_error}
    return first, *second_state(first, after, changes, **more)


def second_state(
    first: Calibrated,
    after: ModeTargets,
    changes: Sequence[Effect] = (),
    *,
    damping_std: float = 0.5,
    model_error: float = EXPLAINED_LEVEL,
) -> tuple[Model, ModeProblem]:
    """Return model and problem of the second state, given a calibration on the first.

    ``after`` are the modes of the second state; other parameters are as of
    :func:`updating.diagnosis.diagnose_modes.diagnose_modes`.
    """
    changed = first.model.with_effect(*changes)
    problem = build_mode_problem(
        changed,
        with_first_errors(first, after),
        (),
        damping_std=damping_std,
        model_error=CHANGED * model_error,
        mesh_level=0.0,
    )
    curve = replace(
        problem.damping,
        nominal=first.problem.damping.ratio(problem.damping.knots, first.fitted.zeta)[0],
    )
    carried = carried_modes(first, after)
    problem = replace(problem, damping=curve, carried=carried, calibrated=carried.errors, bad_prior=BAD_PRIOR)
    return changed, problem


def calibrated_errors(first: Calibrated) -> tuple[CalibratedErrors, Floats]:
    """Return what the first state leaves uncertain of its parameters, and what that does to its modes.

    The second are derivatives of ln f of its modes by errors of each parameter, (n_errors, n).
    Effects that both states have are among the parameters.
    """
    problem, fitted = first.problem, first.fitted
    function = problem.function(fitted.effects, start_of(fitted.effects), problem.targets.fitted)
    variables, x = function.variables, function.point_of(fitted)
    n = len(variables)
    errors = CalibratedErrors.of(variables, values_at(variables, x[:n]), fitted.covariance[:n, :n])
    _, J = function(x, True)
    assert J is not None
    t, some = problem.targets, function.kinds == FREQUENCY
    std = np.hypot(t.frequency_std, problem.mesh_level)[t.fitted]
    by = np.zeros((len(errors.refs), t.n))
    # Parameters of one unknown move together: the first of them stands for all.
    lead = np.cumsum([0, *(len(v.refs) for v in variables)])[:-1].astype(np.int64)
    by[np.ix_(lead, t.fitted)] = (J[:n, some].real * (std / std.min())) / function.units[:n, None]
    return errors, by


def change_since(
    baseline: Baseline,
    after: ModeTargets,
    changes: Sequence[Effect] = (),
    *,
    damping_std: float = 0.5,
    kinds: Sequence[str] | None = None,
    exclude: Sequence[str] = (),
    model_error: float = EXPLAINED_LEVEL,
    say: Progress,
) -> ModeDiagnosis:
    """Find what has changed since a state that is known.

    Parameters as of :func:`updating.diagnosis.diagnose_modes.diagnose_modes`.
    """
    start_time = time.perf_counter()
    ways: list[tuple[Searched[ModeProblem], Calibrated]] = []
    for base, weight in zip(baseline.bases, baseline.log_weights - baseline.log_weights[0], strict=True):
        changed, problem = second_state(
            base, after, changes, damping_std=damping_std, model_error=model_error
        )
        # What gives way in both states already is no candidate: it would not be absent where it is rigid.
        given = {key for e in base.fitted.effects for key in e.released()}
        candidates = candidates_for(changed, problem.targets, kinds, exclude)
        candidates = tuple(c for c in candidates if not given & set(c.released()))
        search = Search(
            problem,
            (),
            candidates,
            search_progress(say, start_time),
            ranking=ModeRanking(),
            beforehand=float(weight) + problem.log_density,
            seeds=_found_beside(way for way, _ in ways),
            rival_score=max((way.search.best.score for way, _ in ways), default=-np.inf),
        )
        ways.append((searched_modes(search, changed, say), base))
        if not ways[-1][0].finished:
            break
    ways.sort(key=lambda way: -way[0].search.best.score)
    (done, base), *others = ways
    done = replace(done, finished=all(way.finished for way, _ in ways))
    done = replace(done, otherwise=tuple(other for other, _ in others))
    out = concluded(done.answered())
    return replace(out, notes=(*_notes_on(baseline, base), *out.notes), baseline=base, judged=baseline)


def _found_beside(ways: Iterable[Searched[ModeProblem]]) -> tuple[ScoredFit, ...]:
    """Return what changes the data as probably as the best does, beside other models of the first state."""
    best: dict[frozenset[str], ScoredFit] = {}
    for way in ways:
        every = [h for h in way.search.known.values() if h.effects and h.score > way.best.score - TWIN_NATS]
        best = {h.key: h for h in every} | best
    return tuple(best.values())


def _worst(base: Calibrated) -> str:
    """Return the mode that is missed most, in standard deviations of its noise."""
    off = np.abs(base.missed)
    if not np.isfinite(off).any():
        return ""
    k = int(np.nanargmax(off))
    return f", most of all mode {k + 1} by {off[k]:.2g} σ"


def _notes_on(baseline: Baseline, base: Calibrated) -> tuple[str, ...]:
    """Return what a reader should know of the first state."""
    level, believed = 100 * base.fitted.level, base.bad[FREQUENCY] < HALF
    share = float(base.form_share[FREQUENCY, believed].mean()) if believed.any() else 0.0
    subtracted = (
        f"the calibrated model misses the first state's frequencies by {level:.2g} %{_worst(base)}; "
        f"model error has {percent(share)} of the residuals' variance, and that share was carried over to "
        "the second state"
    )
    return (*baseline.texts, subtracted)
