"""Better reduced bases: with responses or modes of a fitted model, where its fit's own basis errs."""

from dataclasses import replace

import numpy as np

from fem.array_types import Floats
from fem.linalg.solvers import factorise
from fem.reduction.reduced_model import ReducedModel
from fem.system import assemble, connection_stiffness
from updating.correlation import DB_PER_NEPER, log_ratio, rms_db
from updating.inference.fit_data import ends_of
from updating.inference.fit_result import FitResult, fitted_model
from updating.inference.frf_inputs import FrfInputs

BASIS_SHARE = 0.03
"""Share of the level that a basis may err by [-]."""
N_BASES = 2
"""Number of further fits of a calibration, each with its own modes in the basis."""


def with_responses(problem: FrfInputs, result: FitResult, n_lines: int) -> tuple[float, ReducedModel] | None:
    """Return the error of the basis of FRFs [nepers], and one with responses of the fitted model.

    None where the error is small against the level.
    """
    error, responses = direct_responses(problem, result, n_lines)
    if error <= BASIS_SHARE * result.level / np.sqrt(2):
        return None
    # What a basis lacks of responses in directions smaller than this share of them does not join it [-]
    return error, problem.reduced.with_shapes(responses, 1e-4)


def direct_responses(problem: FrfInputs, result: FitResult, n_lines: int) -> tuple[float, Floats]:
    """Return the error of the reduced basis against direct solutions at some lines [nepers], and these.

    Effects that depend on amplitude are left out of both. The solutions, (n_dof, 2 n_lines n_in), are real
    and imaginary parts of the responses to the excitations.
    """
    effects = tuple(e for e in result.effects if not e.amplitude_dependent)
    excluded = {e.name for e in result.effects if e.amplitude_dependent}
    values = {ref: v for ref, v in result.values.items() if ref[0] not in excluded}
    result = replace(result, effects=effects, values=values)
    problem = problem.unloaded(result)
    model = problem.reduced.model
    system = assemble(fitted_model(model, result), reciprocal=False)
    m = problem.data.measurement
    outputs, inputs, references = ends_of(model, m.sensors, m.excitations)
    lines = problem.lines_up_to(np.inf, n_lines)
    f = problem.data.frequency[lines]
    zeta, *others = np.atleast_2d(problem.damping.ratio(f, result.zeta))
    connections = connection_stiffness(system) if others else None
    reduced = replace(problem, viscous=False).receptance(result.as_described(), lines)
    ratio, responses = [], []
    backend, factor = None if system.reciprocal else "superlu", None
    for k, omega in enumerate(2 * np.pi * f):
        Z = system.dynamic_stiffness(float(omega)) + 2j * zeta[k] * system.K
        if connections is not None:
            Z = Z + 2j * (others[0][k] - zeta[k]) * connections
        factor = factorise(Z, like=factor, backend=backend)
        X = system.Q @ factor.solve((system.Q.T @ inputs).astype(complex))
        direct = outputs.T @ X
        if references is not None:
            direct = references.read(direct[None], np.array([omega]))[0]
        responses += [X.real, X.imag]
        ratio.append(np.where(problem.data.mask[lines[k]], log_ratio(reduced[k], direct), complex("nan")))
    return rms_db(np.array(ratio)) / DB_PER_NEPER, np.hstack(responses)
