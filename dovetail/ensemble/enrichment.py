"""Shapes that a basis lacks where uncertain parameters are far from their nominal values."""

import numpy as np
from numpy.typing import NDArray

from fem.analysis.modes import solve_modes
from fem.linalg.solvers import factorise
from fem.reduction.reduced_model import ReducedModel
from fem.system import assemble
from updating.inference.unknowns import ScaledUnknown

REACH = 2.0
"""Change of each parameter either way, one at a time, in standard deviations [-]."""
ABOVE = 1.25
"""Modes up to this multiple of the highest frequency must lie in the basis [-]."""
SHARE_OUTSIDE = 1e-3
"""Root of the share of a shape's energy that may lie outside; a mode's frequency errs by half the square
[-]."""


def enriched(
    reduced: ReducedModel,
    unknowns: tuple[ScaledUnknown, ...],
    highest: float,
    forces: NDArray[np.float64],
) -> ReducedModel:
    """Return a model with modes and static responses in its basis for each parameter moved either way.

    The parts outside the basis are compressed by their singular values in the energy norm (proper orthogonal
    decomposition); those below ``SHARE_OUTSIDE`` are dropped. A common modulus or density adds nothing.

    Parameters
    ----------
    reduced : ReducedModel
    unknowns : tuple of ScaledUnknown
    highest : float
        Highest frequency of interest [Hz].
    forces : ndarray (n_dof, k)
        Those of whose responses the basis was made.
    """
    loads, shift = np.asarray(reduced.system.Q.T @ forces), reduced.basis.shift
    system, V = reduced.system, reduced.basis.V
    outside = []
    for unknown in unknowns:
        for x in (unknown.mean - REACH * unknown.std, unknown.mean + REACH * unknown.std):
            value = unknown.to_value(float(np.clip(x, unknown.low, unknown.high)))
            model = reduced.model.with_values({unknown.ref: value})
            moved = assemble(model, reciprocal=False)
            modes = solve_modes(moved, max_frequency=ABOVE * highest)
            shapes = np.asarray(system.Q.T @ modes.shapes[:, modes.n_rigid :])
            static = factorise(moved.K - shift * moved.M).solve(loads)
            both = np.hstack([shapes, static])
            energy = np.einsum("ij,ij->j", both, system.K @ both - shift * (system.M @ both))
            both = both[:, energy > 0] / np.sqrt(energy[energy > 0])
            for _ in range(2):
                both = both - V @ (V.T @ (system.M @ both))
            outside.append(both)
    more = _principal(np.hstack(outside), system.K - shift * system.M) if outside else np.zeros((len(V), 0))
    return reduced.with_shapes(np.asarray(system.Q @ more)) if more.shape[1] else reduced


def _principal(shapes: NDArray[np.float64], K: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return combinations of shapes along which they hold more than ``SHARE_OUTSIDE`` of a mode's energy."""
    if not shapes.shape[1]:
        return shapes
    G = shapes.T @ (K @ shapes)
    energies, vectors = np.linalg.eigh((G + G.T) / 2)
    return shapes @ vectors[:, energies > SHARE_OUTSIDE**2]
