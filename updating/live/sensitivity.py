"""Sensitivity of one FRF, or one natural frequency, to every parameter of a hypothesis."""

from dataclasses import dataclass, replace

import numpy as np

from fem.array_types import Floats, Ints
from fem.model import Model, ParameterRef, parameter_values
from fem.sensitivity.matrices import differentiate_matrices
from updating.correlation import DB_PER_NEPER
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.frf_function import FrfFunction
from updating.live.engine import LiveModel
from updating.live.hypothesis import Hypothesis

N_LINES = 200
"""Lines at which the derivatives are taken [-]."""


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """Change of the amplitude of one FRF by one parameter.

    Attributes
    ----------
    refs : tuple of (effect, parameter)
        Parameters that move together.
    added : bool
        Whether they are those of an added effect.
    assumed : bool
        Whether the parameter has no prior, so that the step is an assumed error of 20 %.
    mean_db, largest_db : float
        Mean absolute change over the lines, and largest change, with its sign, per standard deviation of the
        prior, to first order [dB].
    frequency : float
        Line of the largest change [Hz].
    """

    refs: tuple[ParameterRef, ...]
    added: bool
    assumed: bool
    mean_db: float
    largest_db: float
    frequency: float


@dataclass(frozen=True, slots=True)
class FrequencySensitivity:
    """Change of a natural frequency by one parameter.

    Attributes
    ----------
    refs : tuple of (effect, parameter)
        Parameters that move together.
    added : bool
        Whether they are those of an added effect.
    assumed : bool
        Whether the parameter has no prior, so that the step is an assumed error of 20 %.
    percent : float
        Change per standard deviation of the prior, to first order [%].
    """

    refs: tuple[ParameterRef, ...]
    added: bool
    assumed: bool
    percent: float


def sensitivities(live: LiveModel, h: Hypothesis, pair: tuple[str, str]) -> tuple[Sensitivity, ...]:
    """Return the sensitivity of ln|H| of one FRF to each parameter, the largest first.

    They are the rows of the Jacobian that fits use, times the standard deviation of the parameter's prior:
    σ ∂ln|H|/∂x, over lines spaced evenly over those that are fitted. Damping is not among them.

    Parameters
    ----------
    live : LiveModel
    h : Hypothesis
    pair : (output, input)
    """
    problem, result = live.problem_of(h), h.result()
    o, i = problem.measured.outputs.index(pair[0]), problem.measured.inputs.index(pair[1])
    data = problem.data
    mask = np.zeros_like(data.mask)
    mask[:, o, i] = True
    every = replace(data, mask=mask, weight=np.ones_like(data.weight))
    lines = problem.lines_up_to(np.inf, N_LINES)
    function = _function(replace(problem, data=every), result, lines)
    _, jacobian = function(function.moved_to(result), True)
    assert jacobian is not None
    names = {e.name for e in h.effects}
    out = []
    for v, row in zip(function.variables, jacobian, strict=False):  # damping and scatter follow
        change = DB_PER_NEPER * v.width * row.real
        k = int(np.abs(change).argmax())
        out.append(
            Sensitivity(
                v.refs,
                v.refs[0][0] in names,
                not v.has_prior,
                float(np.abs(change).mean()),
                float(change[k]),
                float(data.frequency[lines[k]]),
            )
        )
    return tuple(sorted(out, key=lambda s: -s.mean_db))


def frequency_sensitivities(
    live: LiveModel, h: Hypothesis, model: Model, frequency: float, shape: Floats
) -> tuple[FrequencySensitivity, ...]:
    """Return the sensitivity of a natural frequency to each parameter, the largest first.

    σ ∂f/∂x over f, from ∂λ/∂θ = φᵀ (∂K/∂θ - λ ∂M/∂θ) φ with λ = (2π f)² (Fox and Kapoor, *AIAA J.* 6, 1968,
    2426). Of modes with equal frequencies it is the derivative along the given shape.

    Parameters
    ----------
    live : LiveModel
    h : Hypothesis
    model : Model
        The full model of the hypothesis.
    frequency : float
        Natural frequency of an elastic mode [Hz].
    shape : ndarray (n_dof,)
        Its mass-normalised shape.
    """
    problem, result = live.problem_of(h), h.result()
    function = _function(problem, result, problem.lines_up_to(np.inf, N_LINES))
    names, known = {e.name for e in h.effects}, model.values()
    eigenvalue = (2 * np.pi * frequency) ** 2
    out = []
    for v, x in zip(function.variables, function.moved_to(result), strict=False):
        slope = 0.0
        for ref, by_x in zip(v.refs, v.slopes(float(x)), strict=True):
            for part in differentiate_matrices(model, ref) if ref in known else ():
                u = shape[part.dofs]
                for matrix, factor in ((part.K, 1.0), (part.M, -eigenvalue)):
                    if matrix is not None:
                        slope += by_x * factor * float(np.einsum("bi,bij,bj->", u, matrix, u))
        percent = 100 * v.width * slope / (2 * eigenvalue)
        out.append(FrequencySensitivity(v.refs, v.refs[0][0] in names, not v.has_prior, percent))
    return tuple(sorted(out, key=lambda s: -abs(s.percent)))


def _function(problem: FitProblem, result: FitResult, lines: Ints) -> FrfFunction:
    """Return the function that a fit minimises, at the effects of a result."""
    return problem.function(result.effects, [parameter_values(e) for e in result.effects], lines)
