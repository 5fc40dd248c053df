"""What changes with amplitude: FRFs at several levels of force as functions of a joint's law.

The rest of the structure is linear. The reduced model gives the receptances at the joint, and harmonic
balance (:mod:`fem.analysis.harmonic_balance`) what the joint makes of them at each level of force.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.analysis.harmonic_balance import Receptances, solve_steady
from fem.array_types import Complexes, Floats, Ints
from fem.effects.joint_nonlinear import AmplitudeDependent
from fem.model import Effect, ParameterRef, parameter_values
from fem.reduction.deviations import Deviations
from fem.reduction.parametric_frf import ParametricFRF
from updating.inference.fit import FitProblem
from updating.inference.fit_data import FitData
from updating.inference.fit_function import propagated
from updating.inference.fit_result import FitResult
from updating.inference.frf_inputs import LINEAR, F, FrfInputs, LinearResponses
from updating.measurement.measurement import Measurement
from updating.quality.faults import Fault
from updating.quality.gates import at_level


def force_levels(
    problem: FitProblem, measurements: Sequence[Measurement], faults: Sequence[Fault] = ()
) -> tuple[FitData, ...]:
    """Return the data at the problem's lines of all measurements that state their force, if two differ.

    Those of other lines or channels, and those without a value that counts, are left out.

    Parameters
    ----------
    problem : FitProblem
        Of the first measurement.
    measurements : sequence of Measurement
        The first is the problem's.
    faults : sequence of Fault
        What has been set right in the problem's data.
    """
    data = [problem.data, *(at_level(problem, m, faults) for m in measurements[1:])]
    levels = tuple(d for d in data if d is not None and d.measurement.force_level and d.mask.any())
    different = len({d.measurement.force_level for d in levels}) > 1
    return levels if different and levels[0] is problem.data else ()


def split(effects: Sequence[Effect]) -> tuple[list[Effect], list[AmplitudeDependent]]:
    """Return linear effects, and those that depend on amplitude."""
    return (
        [e for e in effects if not isinstance(e, AmplitudeDependent)],
        [e for e in effects if isinstance(e, AmplitudeDependent)],
    )


def at_force_levels(problem: FitProblem, levels: Sequence[FitData]) -> FitProblem:
    """Return a problem whose data are those of several levels of force, side by side as further forces.

    Effects may have one among them that depends on amplitude. The parameters are those of the structure, the
    same at all levels. Small deviations are those of linear structures, and it has none.

    Parameters
    ----------
    problem : FitProblem
        Of the first level.
    levels : sequence of FitData
    """

    def stacked(name: str) -> NDArray[Any]:
        each = [np.broadcast_to(getattr(d, name), d.H.shape) for d in levels]
        return np.concatenate(each, axis=2)

    data = replace(problem.data, **{name: stacked(name) for name in ("H", "mask", "weight", "noise")})
    return replace(problem, data=data, scatter=None, responses=LevelResponses(tuple(levels)))


@dataclass(frozen=True, slots=True, eq=False)
class LevelResponses(LinearResponses):
    """Steady vibration at several levels of force.

    Attributes
    ----------
    levels : tuple of FitData
    """

    levels: tuple[FitData, ...] = ()

    @property
    def n_levels(self) -> int:
        """Number of levels of force that the data are of."""
        return len(self.levels)

    def at_first_level(self, problem: F) -> F:
        """Return the problem with the data of the first level of force alone."""
        return replace(problem, data=self.levels[0], responses=LINEAR)

    def engine(
        self,
        problem: FrfInputs,
        frequency: Floats,
        refs: Sequence[ParameterRef],
        effects: Sequence[Effect],
        release: Sequence[tuple[str, str]],
        deviations: Deviations | None,
        channels: Floats | None,
    ) -> ParametricFRF:
        """Return the receptances at all levels as a function of parameters, without small deviations."""
        assert deviations is None or deviations.stiff.shape[1] + deviations.lossy.shape[1] == 0
        return LevelEngine(problem, self.levels, frequency, refs, effects, release)

    def receptance(self, problem: FrfInputs, result: FitResult, lines: Ints) -> Complexes:
        """Return the fitted model's receptances at all levels, at some lines."""
        f = problem.data.frequency[lines]
        engine = problem.engine(f, list(result.values), result.effects)
        values, zeta = np.array(list(result.values.values())), problem.damping.ratio(f, result.zeta)
        return engine.evaluate(values, zeta, gradient=False)[0]


class LevelEngine(ParametricFRF):
    """Receptances at several levels of force as a function of parameter values.

    Parameters
    ----------
    problem : FrfInputs
    levels : sequence of FitData
    frequency : ndarray (n_freq,)
        Lines of its data [Hz].
    refs : sequence of (effect, parameter)
        The parameters that vary.
    effects : sequence of Effect
        Effects that are added to the model, of which one may depend on amplitude.
    release : sequence of (str, str)
        Keys of constraints that are released besides those that the effects release.
    """

    def __init__(
        self,
        problem: FrfInputs,
        levels: Sequence[FitData],
        frequency: Floats,
        refs: Sequence[ParameterRef],
        effects: Sequence[Effect],
        release: Sequence[tuple[str, str]] = (),
    ) -> None:
        linear, laws = split(effects)
        self._law = laws[0] if laws else None
        self._levels = levels
        self._at = np.searchsorted(problem.data.frequency, frequency)
        names = [name for name, _ in refs]
        self._law_rows = [k for k, name in enumerate(names) if self._law and name == self._law.name]
        self._rest = [k for k in range(len(refs)) if k not in self._law_rows]
        self._names = tuple(refs[k][1] for k in self._law_rows)
        ends = problem.vectors_with(self._law) if self._law else problem.vectors
        super().__init__(problem.reduced, *ends, frequency, [refs[k] for k in self._rest], linear, release)

    def evaluate(
        self, values: Floats, zeta: Floats, gradient: bool = True
    ) -> tuple[Complexes, Complexes | None, Complexes | None]:
        """Return receptances (n_freq, n_out, n_levels n_in) and their derivatives by values and damping."""
        block, slopes, by_zeta = super().evaluate(values[self._rest], zeta, gradient)
        n = len(self._levels)
        if self._law is None:
            each = (None if x is None else np.concatenate([x] * n, axis=-1) for x in (block, slopes, by_zeta))
            return tuple(each)  # pyright: ignore[reportReturnType]
        law = self._law.with_values(**dict(zip(self._names, values[self._law_rows], strict=True)))
        part = Receptances.of(block)
        steady = [
            solve_steady(law, data.measurement.force_level, part, self._measured(data))
            for data in self._levels
        ]
        H = np.concatenate([s.H for s in steady], axis=-1)
        if not gradient or slopes is None or by_zeta is None:
            return H, None, None
        damping = by_zeta.reshape(-1, *block.shape)
        changes = np.concatenate([slopes.reshape(-1, *block.shape), damping])
        both = [s.slopes(changes, self._names) for s in steady]
        by_rest, by_law = (np.concatenate(x, axis=-1) for x in zip(*both, strict=True))
        by_values = np.empty((len(values), *H.shape), dtype=complex)
        by_values[self._rest], by_values[self._law_rows] = by_rest[: len(self._rest)], by_law
        return H, by_values, by_rest[len(self._rest) :].reshape(*by_zeta.shape[:-3], *H.shape)

    def _measured(self, data: FitData) -> Complexes:
        """Return measured receptances, by which that of several solutions is chosen; 0 where none counts."""
        return np.where(data.mask[self._at], data.H[self._at], 0.0)


def deviation_at_level(problem: FitProblem, result: FitResult) -> Floats:
    """Return the standard deviation of the ln|H| that a fit predicts at the force level of the data.

    √(gᵀ C g) as :meth:`updating.inference.fit.FitProblem.deviation`, with the derivatives of the steady
    vibration: of first order, and wide where it is about to jump.

    Parameters
    ----------
    problem : FitProblem
    result : FitResult
        With one effect that depends on amplitude.

    Returns
    -------
    ndarray (n_freq, n_out, n_in)
        [-]
    """
    data = problem.data
    every = replace(data, mask=np.ones_like(data.mask), weight=np.ones_like(data.weight))
    level = replace(at_force_levels(problem, (data,)), data=every)
    starts, lines = [parameter_values(e) for e in result.effects], np.arange(len(data.frequency))
    function = level.function(result.effects, starts, lines)
    x = function.moved_to(result)
    return propagated(function, x, function.units, result.covariance).reshape(data.mask.shape)
