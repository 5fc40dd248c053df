"""Receptances of a linear model as functions of parameters, for the fits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fem.model import Effect, ParameterRef
from fem.reduction.deviations import DeviatingFRF, Deviations
from fem.reduction.parametric_frf import ParametricFRF
from updating.inference.fit_result import FitResult

if TYPE_CHECKING:
    from updating.inference.fit import FitProblem


@dataclass(frozen=True, slots=True)
class LinearResponses:
    """How receptances follow from a linear model: they are the same at any level of force."""

    @property
    def n_levels(self) -> int:
        """Number of levels of force that the data are of."""
        return 1

    def at_first_level(self, problem: FitProblem) -> FitProblem:
        """Return the problem with the data of the first level of force alone."""
        return problem

    def engine(
        self,
        problem: FitProblem,
        frequency: NDArray[np.float64],
        refs: Sequence[ParameterRef],
        effects: Sequence[Effect],
        release: Sequence[tuple[str, str]],
        deviations: Deviations | None,
        channels: NDArray[np.float64] | None,
    ) -> ParametricFRF:
        """Return receptances as a function of parameters, which are those of :meth:`FitProblem.engine`."""
        *_, outputs, inputs = problem.ends
        if channels is not None and channels.any():
            moved = np.einsum("rne,ne->rn", problem.misread, channels)
            outputs, inputs = outputs + moved[:, : outputs.shape[1]], inputs + moved[:, outputs.shape[1] :]
        make = ParametricFRF if deviations is None else partial(DeviatingFRF, deviations)
        return make(
            problem.reduced,
            outputs,
            inputs,
            frequency,
            refs,
            effects,
            release,
            projected=True,
            decay=problem.decay,
            viscous=problem.viscous,
        )

    def receptance(
        self, problem: FitProblem, result: FitResult, lines: NDArray[np.int64]
    ) -> NDArray[np.complex128]:
        """Return the receptances of a fitted model at some lines, (n_lines, n_out, n_in).

        With an effect that depends on amplitude they are those at the data's level of force.
        """
        if any(e.amplitude_dependent for e in result.effects):
            return problem.steady(result, lines).H
        f = problem.data.frequency[lines]
        refs = list(result.values)
        there = problem.with_forces_of(result)
        engine = there.engine(f, refs, result.effects, channels=result.channels)
        zeta = problem.damping.ratio(f, result.zeta)
        at = np.array([result.values[r] for r in refs])
        H, _, _ = problem.in_set_ups(engine).evaluate(at, zeta, gradient=False)
        return H


LINEAR = LinearResponses()
