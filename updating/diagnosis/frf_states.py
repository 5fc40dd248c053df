"""What has changed between two states of one structure, by the FRFs of both.

The model is calibrated on the first state. What it leaves there, ln(computed / measured) line by line, is the
error of its form: it is common to both states and is taken off the second one's FRFs. Then only the
difference is left to explain.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.analysis.modes import solve_eigenpairs
from fem.model import Effect, Model
from fem.system import assemble
from updating.correlation import DB_PER_NEPER, log_ratio
from updating.diagnosis.begin import Progress
from updating.diagnosis.evidence.diagnosis import (
    Formed,
    Searched,
    begun_with,
    candidates_for_test,
    formed_problem,
)
from updating.diagnosis.evidence.fits import FULL_LINES
from updating.diagnosis.evidence.fitting import fit
from updating.diagnosis.evidence.ranking import FrfRanking
from updating.diagnosis.states import CHANGED
from updating.inference.fit import EXPLAINED_LEVEL, FitProblem
from updating.inference.fit_data import MODEL_ERROR, FitData
from updating.inference.fit_result import FitResult
from updating.inference.parameters import DampingCurve, Nuisance
from updating.inference.preparation import N_FIT_LINES, build_problem, fitted_model, prepared_like
from updating.inference.workers import ALONE, Workers
from updating.measurement.measurement import Measurement
from updating.quality.faults import Fault, corrected, find_faults

Floats = NDArray[np.float64]

N_BASES = 2
"""So many times the calibration is fitted on with its own modes in the basis."""
HIGHEST = 1.5
"""Modes up to this multiple of the highest frequency [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class CalibratedFrfs:
    """A model that was fitted to the FRFs of one state.

    Attributes
    ----------
    model : Model
        With fitted values, form included.
    problem : FitProblem
        Of this state, with faults set right.
    result : FitResult
        The fit.
    faults : tuple of Fault
        Of sensors and forces of this state.
    mesh_db : float
        Error of the mesh [dB].
    alone : FitProblem
        Of this state and the calibrated model, with nothing uncertain but damping, as of the second state.
    """

    model: Model
    problem: FitProblem
    result: FitResult
    faults: tuple[Fault, ...]
    mesh_db: float
    alone: FitProblem

    @property
    def level(self) -> float:
        """Robust level of what the model leaves, amplitude and phase [nepers]."""
        return self.result.level

    def at(self, before: Measurement, outputs: Sequence[str], inputs: Sequence[str]) -> "CalibratedFrfs":
        """Return the same calibration with data of other channels of the first state, as far as it has them.

        Parameters
        ----------
        before : Measurement
            Of the first state, with all channels.
        outputs, inputs : sequence of str
            Names of sensors and excitations.
        """
        frf = before.frf
        outputs, inputs = [n for n in outputs if n in frf.outputs], [n for n in inputs if n in frf.inputs]
        if not outputs or not inputs:
            return self
        f = self.alone.data.frequency
        kept = before.with_frf(frf.select(outputs, inputs, band=(float(f[0]), float(f[-1]))))
        data = corrected(prepared_like(self.alone, kept), self.faults)
        return replace(self, alone=replace(self.alone, data=data))


def calibrate_frfs(
    model: Model,
    before: Measurement,
    nuisances: Sequence[Nuisance] = (),
    *,
    damping_std: float = 0.5,
    band: tuple[float, float] | None = None,
    n_lines: int = N_FIT_LINES,
    model_error: float = EXPLAINED_LEVEL,
) -> CalibratedFrfs:
    """Fit uncertain parameters, and the form's, to the FRFs of the first state, and set faults right."""
    problem, begun = formed_problem(
        model, before, nuisances, damping_std=damping_std, band=band, n_lines=n_lines, model_error=model_error
    )
    null = fit(problem, n_lines=FULL_LINES)
    problem, result, faults = find_faults(problem, problem.assessed(null.result))
    for _ in range(N_BASES):
        problem = _with_modes_of(fitted_model(begun.formed, result), problem)
        result = fit(problem, n_lines=FULL_LINES, stages=problem.stages[-1:], x_from=result).result
    model = fitted_model(begun.formed, result)
    alone = build_problem(
        model, before, (), damping_std=damping_std, band=band, n_lines=n_lines, connections=True,
        model_error=model_error,
    )  # fmt: skip
    own = replace(alone, data=problem.data, damping=_at_its_fit(problem.damping, result.zeta))
    return CalibratedFrfs(model, problem, problem.assessed(result), faults, begun.mesh_db, own)


def _with_modes_of(model: Model, problem: FitProblem) -> FitProblem:
    """Return a problem whose basis has the modes of a fitted model, too: its form has moved far together."""
    system = assemble(model, reciprocal=False)
    pairs = solve_eigenpairs(system, max_frequency=HIGHEST * float(problem.data.frequency[-1]))
    return replace(problem, reduced=problem.reduced.with_shapes(np.asarray(system.Q @ pairs.vectors)))


def _at_its_fit(curve: DampingCurve, zeta: Floats) -> DampingCurve:
    """Return a fitted curve of damping as a nominal one."""
    ratio = partial(curve.ratio, unknowns=zeta)
    return replace(curve, nominal=np.atleast_2d(ratio(curve.knots))[0], base=ratio)


def carried_over(first: CalibratedFrfs, after: FitData) -> FitData:
    """Return the second state's data without what the calibrated model leaves on the first.

    ln H is less by d = ln(measured / computed) of the first state, and variances of both states add. The
    structure moves its resonances, and d with them: at a line whose FRF has changed by c = ln(after / before)
    as much as |c| of d may belong elsewhere, and |c| ≪ 1 for a small change. So d is uncertain by
    |d| min(1, √(CHANGED² + |c|²)). Values that the first state has not are compared without correction, and
    are as uncertain as d is large at the others.
    """
    before = first.alone.data
    d_at = -first.alone.log_ratio(first.alone.nominal())  # NaN where it does not count
    d, known = at_lines_of(d_at, before, after)
    H_before, _ = at_lines_of(np.log(np.where(before.H != 0, before.H, 1.0)), before, after, angle=True)
    noise, _ = at_lines_of(before.noise, before, after)
    c = np.where(known, log_ratio(after.H, np.exp(np.where(known, H_before, 0.0))), 0.0)
    d, noise = np.where(known, d, 0.0), np.where(known, noise, 0.0)
    uncertain = np.abs(d) * np.minimum(1.0, np.hypot(CHANGED, np.abs(c)))
    rms = float(np.sqrt((np.abs(d[known]) ** 2).mean())) if known.any() else 0.0
    uncertain = np.where(known, uncertain, rms)
    mask = after.mask
    whole = np.sqrt(after.uncertain**2 + noise**2 + uncertain**2)
    return replace(
        after,
        H=np.where(mask, after.H * np.exp(-d), after.H),
        weight=MODEL_ERROR / np.hypot(MODEL_ERROR, whole) * mask,
        noise=np.hypot(after.noise, noise),
    )


def at_lines_of(
    values: NDArray[Any], have: FitData, want: FitData, *, angle: bool = False
) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Return values of one state at lines and channels of another, and which of them there are.

    Between lines they are linear; with ``angle`` their imaginary parts are angles, continued first.
    """
    one, two = have.measurement.frf, want.measurement.frf
    out: NDArray[Any] = np.full(want.H.shape, np.nan, dtype=values.dtype)
    f = have.frequency
    within = (want.frequency >= f[0] * (1 - 1e-9)) & (want.frequency <= f[-1] * (1 + 1e-9))
    for (i, output), (j, force) in product(enumerate(two.outputs), enumerate(two.inputs)):
        if output in one.outputs and force in one.inputs:
            column = values[:, one.outputs.index(output), one.inputs.index(force)]
            if angle:
                column = np.real(column) + 1j * np.unwrap(np.imag(column))
            # NaN at a line that does not count makes lines between it and its neighbours NaN, too
            out[within, i, j] = np.interp(want.frequency, f, column)[within]
    return out, np.isfinite(out)


def changed_frf_problem(
    model: Model,
    before: Measurement,
    after: Measurement,
    nuisances: Sequence[Nuisance] = (),
    *,
    changes: Sequence[Effect] = (),
    damping_std: float = 0.5,
    band: tuple[float, float] | None = None,
    n_lines: int = N_FIT_LINES,
    model_error: float = EXPLAINED_LEVEL,
) -> tuple[CalibratedFrfs, Model, FitProblem]:
    """Return the calibration on the first state, and model and problem of the second one.

    Parameters as of :func:`begin_change`.
    """
    more = {"damping_std": damping_std, "band": band, "n_lines": n_lines}
    first = calibrate_frfs(model, before, nuisances, model_error=model_error, **more)  # type: ignore[arg-type]
    changed = first.model.with_effect(*changes)
    problem = build_problem(
        changed, after, (), connections=True, model_error=CHANGED * model_error, **more  # type: ignore[arg-type]
    )  # fmt: skip
    data = carried_over(first, corrected(problem.data, first.faults))
    return first, changed, replace(problem, data=data, damping=first.alone.damping)


def begin_change(
    model: Model,
    before: Measurement,
    after: Measurement,
    nuisances: Sequence[Nuisance] = (),
    *,
    changes: Sequence[Effect] = (),
    damping_std: float = 0.5,
    band: tuple[float, float] | None = None,
    kinds: Sequence[str] | None = None,
    exclude: Sequence[str] = (),
    n_lines: int = N_FIT_LINES,
    model_error: float = EXPLAINED_LEVEL,
    progress: Progress,
    crew: Workers = ALONE,
) -> tuple[Searched, CalibratedFrfs]:
    """Return a search for what has changed, and the calibration on the first state.

    Uncertain parameters have one value in both states. To the first order they do not matter to the
    difference, so that they stay where the first state has put them.

    Parameters
    ----------
    model : Model
        In the first state.
    before, after : Measurement
    changes : sequence of Effect
        Effects that are known to have come since the first state.
    nuisances, damping_std, band, kinds, exclude, n_lines, model_error
        As of :func:`updating.diagnosis.diagnose.diagnose`.
    progress : callable
    crew : Workers
    """
    progress("calibrating on the first state", 0.0)
    first, changed, problem = changed_frf_problem(
        model, before, after, nuisances, changes=changes, damping_std=damping_std, band=band, n_lines=n_lines,
        model_error=model_error,
    )  # fmt: skip
    progress("comparing the second state", 0.1)
    begun = Formed(changed, changed, (), first.mesh_db)
    candidates = candidates_for_test(changed, after, kinds, exclude)
    searched = begun_with(
        problem, begun, candidates, ranking=FrfRanking(form_share=CHANGED), progress=progress, crew=crew
    )
    note = (
        f"the calibrated model misses the first state's FRFs by {first.level * DB_PER_NEPER:.2g} dB; what it "
        "leaves there was taken off the second state's, so that only the change remains"
    )
    return replace(searched, notes=(note, *searched.notes)), first
