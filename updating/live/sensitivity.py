"""Sensitivity of one FRF to every uncertain and added parameter of a hypothesis."""

from dataclasses import dataclass, replace

import numpy as np

from fem.model import ParameterRef, parameter_values
from updating.correlation import DB_PER_NEPER
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
    starts = [parameter_values(e) for e in result.effects]
    function = replace(problem, data=every).function(result.effects, starts, lines)
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
