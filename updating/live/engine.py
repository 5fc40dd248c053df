"""FRFs and errors of hypotheses at once: one small eigenproblem for each change of a value."""

from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from functools import cached_property
from threading import Lock
from typing import Any

import numpy as np

from fem.analysis.frf import FRF
from fem.array_types import Bools, Complexes, Floats, Ints
from fem.model import Effect, ParameterRef, parameter_values
from fem.recent import Recent
from fem.reduction.parametric_frf import ParametricFRF
from updating.correlation import Comparison, compare
from updating.inference.fit import FitProblem
from updating.inference.fit_data import FitData
from updating.inference.fit_result import FitResult
from updating.live.hypothesis import Hypothesis
from updating.measurement.held_out import held_out_lines
from updating.quality.corrections import corrected

KEPT = 4
"""Sets of effects, and of corrections, whose engines and data are kept [-]."""


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """How far a hypothesis is from the measurement, in the numbers that `dovetail compare` prints.

    Attributes
    ----------
    hypothesis : Hypothesis
    result : FitResult
        With its errors on lines fitted and held out.
    frf, measured : FRF
        Computed, and measured as it is believed; both in the kind of the measurement.
    comparison : Comparison
        On all lines, of the channels that are fitted.
    held_out : Comparison or None
        Of the channels that no fit sees: a sensor for the fitted excitations, an excitation at the fitted
        sensors.
    mask : ndarray of bool (n_freq, n_out, n_in)
        Values that count, but for those of held-out channels.
    noise_db : float
        Noise of the FRFs that count [dB].
    """

    hypothesis: Hypothesis
    result: FitResult
    frf: FRF
    measured: FRF
    comparison: Comparison
    held_out: Comparison | None
    mask: Bools
    noise_db: float

    @property
    def left_db(self) -> float:
        """Error on the lines of the fit beyond the noise, by the difference of squares [dB]."""
        return float(np.sqrt(max(self.result.fit_db**2 - self.noise_db**2, 0.0)))

    def by_sensor(self) -> Floats:
        """Return the error of each sensor, those of held-out ones too, (n_out,) [dB]."""
        known = self.comparison.by_sensor()
        return known if self.held_out is None else np.where(np.isnan(known), self.held_out.by_sensor(), known)

    def by_band(self) -> Floats:
        """Return the error of each sensor in each band, those of held-out ones too, (n_out, n_bands) [dB]."""
        known = self.comparison.by_band()
        return known if self.held_out is None else np.where(np.isnan(known), self.held_out.by_band(), known)


class LiveModel:
    """A problem whose hypotheses are evaluated one after the other.

    Engines of the last sets of effects are kept, so that another value of a parameter costs one small
    eigenproblem. One evaluation runs at a time.

    Parameters
    ----------
    problem : FitProblem
        As a comparison begins with it.
    form : callable, optional
        Makes the same problem with the form of its frame among the uncertain parameters, as a diagnosis has
        it. It is called once, by the first hypothesis whose values have the form's.
    """

    def __init__(self, problem: FitProblem, form: Callable[[], FitProblem] | None = None) -> None:
        self.problem = problem
        self._form = form
        self._lock = Lock()
        self._engines = Recent(KEPT)
        self._data = Recent(KEPT)

    @cached_property
    def formed(self) -> FitProblem:
        """The problem with the form of its frame; itself where there is no form."""
        return self.problem if self._form is None else self._form()

    @cached_property
    def form(self) -> tuple[Effect, ...]:
        """Effects that let the form vary, of no size."""
        known = {e.name for e in self.problem.reduced.model.effects}
        return tuple(e for e in self.formed.reduced.model.effects if e.name not in known)

    def has_form(self, h: Hypothesis) -> bool:
        """Return whether the form of the frame may vary in a hypothesis."""
        return not {effect for effect, _ in h.values} <= {e.name for e in self.problem.reduced.model.effects}

    def with_form(self, h: Hypothesis) -> Hypothesis:
        """Return a hypothesis whose form may vary: as it is drawn, unless it varies already."""
        return replace(h, values={**self._form_values, **h.values}, fit=None)

    def without_form(self, h: Hypothesis) -> Hypothesis:
        """Return a hypothesis whose form is as it is drawn, and whose channels are as described."""
        kept = {ref: v for ref, v in h.values.items() if ref not in self._form_values}
        return replace(h, values=kept, channels=h.channels[:0], fit=None)

    @cached_property
    def _form_values(self) -> dict[ParameterRef, float]:
        names = {e.name for e in self.form}
        nominal = self.formed.reduced.model.values()
        refs = (ref for n in self.formed.nuisances for ref in n.refs)
        return {ref: float(nominal[ref]) for ref in refs if ref[0] in names}

    def _problem(self, h: Hypothesis) -> FitProblem:
        """Return the problem whose parameters a hypothesis has."""
        return self.formed if self.has_form(h) else self.problem

    @cached_property
    def sensors(self) -> tuple[str, ...]:
        """Names of the sensors."""
        return self.problem.measured.outputs

    def data_of(self, h: Hypothesis) -> FitData:
        """Return the data of a hypothesis: corrected, without sensors that are off and held-out channels.

        Bands that it holds out take the place of the problem's own.
        """
        data = corrected(self.problem.data, h.faults)
        if bands := h.held_out_bands:
            data = replace(data, held_out=held_out_lines(data.frequency, bands, data.measurement.name))
        on, fitted = self._counted(h), self._held_out(h) == 0
        return data if (on & fitted).all() else replace(data, mask=data.mask & on & fitted)

    def compared(self, h: Hypothesis) -> Bools:
        """Return which values are compared, those of held-out channels too, (n_freq, n_out, n_in)."""
        return corrected(self.problem.data, h.faults).mask & self._counted(h)

    def _counted(self, h: Hypothesis) -> Bools:
        return np.array([name not in h.off for name in self.sensors])[:, None]

    def _held_out(self, h: Hypothesis) -> Ints:
        """Return how many ends of each FRF are held out, (n_out, n_in)."""
        frf = self.problem.data.measurement.frf
        out = np.array([f"sensor {name}" in h.held_out for name in frf.outputs], dtype=int)
        return out[:, None] + np.array([f"excitation {name}" in h.held_out for name in frf.inputs], dtype=int)

    def problem_of(self, h: Hypothesis) -> FitProblem:
        """Return the problem of a hypothesis, for a fit in another thread: it shares no cache."""
        problem = self._problem(h)
        apart = replace(problem.reduced).with_forces_of(h.effects)
        return replace(problem, reduced=apart, data=self.data_of(h))

    def learn(self, h: Hypothesis) -> None:
        """Let the basis have the responses of a hypothesis, where it errs without."""
        known = self.evaluate(h).result
        problem = self._problem(h)
        apart = replace(problem, reduced=replace(problem.reduced).with_forces_of(h.effects))
        good = apart.with_good_basis(known)
        if good is apart:
            return
        with self._lock:
            problem = replace(problem, reduced=good.reduced)
            if self.has_form(h):
                self.formed = problem
            else:
                self.problem = problem
            self._engines = Recent(KEPT)

    def evaluate(self, h: Hypothesis) -> Evaluation:
        """Return the FRFs of a hypothesis and their errors."""
        with self._lock:
            given = h.result()
            believed = (h.faults, h.off, h.held_out)
            data, measured, apart = self._data.get(believed, lambda: self._believed(h))
            H = self._receptances(self._problem(h), given)
            problem = replace(self._problem(h), data=data)
            result, frf = problem.assessed(given, H), problem.as_measured(H)
            comparison = compare(measured, frf, mask=data.mask)
            unseen = None if apart is None else compare(measured, frf, mask=apart)
            return Evaluation(h, result, frf, measured, comparison, unseen, data.mask, data.noise_db)

    def _believed(self, h: Hypothesis) -> tuple[FitData, FRF, Bools | None]:
        data = self.data_of(h)
        apart = self.compared(h) & (self._held_out(h) == 1)
        return data, replace(self.problem, data=data).measured, apart if apart.any() else None

    def _receptances(self, problem: FitProblem, result: FitResult) -> Complexes:
        refs: list[ParameterRef] = list(result.values)
        key = (problem is self.problem, *self._key(result))
        engine: ParametricFRF = self._engines.get(key, lambda: self._engine(problem, result, refs))
        f = self.problem.data.frequency
        values = np.array([result.values[r] for r in engine.refs])
        loaded = problem.in_set_ups(engine)
        return loaded.evaluate(values, self.problem.damping.ratio(f, result.zeta), gradient=False)[0]

    def _engine(self, problem: FitProblem, result: FitResult, refs: list[ParameterRef]) -> ParametricFRF:
        # with the forces of where the effects are now, as a crack that moves bends other places
        return problem.with_forces_of(result).engine(
            self.problem.data.frequency, refs, result.effects, channels=result.channels
        )

    @staticmethod
    def _key(result: FitResult) -> tuple[Hashable, ...]:
        """Return the key of an engine: the errors of its channels, its effects and their places."""
        at: list[Any] = [result.channels.tobytes()]
        for e in result.effects:
            values = parameter_values(e)
            at.append((e.name, *(values[p.name] for p in e.parameters() if p.position)))
        return tuple(at)
