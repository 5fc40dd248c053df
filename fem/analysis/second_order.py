"""Second-order statics (P-Δ): a load case in equilibrium with the geometric stiffness of its own forces.

    Model ─ load case → solve_second_order → SecondOrder

(K + K_G) u = f, K_G of the section forces of u, iterated from those of first order. Displacements and turns
are small; the shortening of bent members (bowing) is left out.
"""

from dataclasses import dataclass

import numpy as np

from fem.analysis.buckling import lowest_factor
from fem.analysis.initial_stress import prestressed
from fem.analysis.loads import LoadCase
from fem.analysis.statics import StaticSolution, solve_static
from fem.model import Model, ModelError
from fem.summary import fields_summary
from fem.system import System, assemble

TOLERANCE = 1e-10
"""Relative change of the displacements, in the norm of the stiffness, at which the iteration ends [-]."""

_ROUNDS = 100


@dataclass(frozen=True, slots=True, eq=False)
class SecondOrder:
    """The response to one load case with the geometric stiffness of its own section forces.

    Attributes
    ----------
    first : StaticSolution
        Of first order.
    solution : StaticSolution
        Of second order: displacements, reactions and section forces in the displaced state, in the axes of
        the structure at rest. Its model has the geometric stiffness, the effect ``"prestress"``.
    factor : float
        By which the load may grow until the structure buckles, of the forces of first order; infinite where
        the load does not make it buckle [-].
    n_rounds : int
        Number of solutions beyond that of first order.
    """

    first: StaticSolution
    solution: StaticSolution
    factor: float
    n_rounds: int

    __repr__ = fields_summary


def solve_second_order(model: Model | System, case: LoadCase) -> SecondOrder:
    """Solve a load case with the geometric stiffness of its own section forces.

    Parameters
    ----------
    model : Model or System
    case : LoadCase
        Second-order responses do not add up: give a combination as one load case.

    Raises
    ------
    ModelError
        As :func:`fem.analysis.statics.solve_static`; for a load at or beyond the load at which the structure
        buckles, with its factor; and where the iteration does not converge.
    """
    system = model if isinstance(model, System) else assemble(model)
    first = solve_static(system, case)
    factor = lowest_factor(system, first)
    if factor <= 1:
        msg = (
            f"load case '{case.name}' makes the structure buckle at {factor:.4g} times its size: "
            "second-order displacements exist for factors above 1 only; reduce the load or stiffen the "
            "structure"
        )
        raise ModelError(msg)
    solution, change = first, np.inf
    for k in range(_ROUNDS):
        try:
            new = solve_static(assemble(prestressed(system.model, solution), reciprocal=False), case)
        except ModelError as reason:
            msg = (
                f"load case '{case.name}': under its second-order forces the structure is not stable, though "
                f"those of first order have the buckling factor {factor:.4g} ({reason})"
            )
            raise ModelError(msg) from reason
        change = _change(system, new, solution)
        solution = new
        if change <= TOLERANCE:
            return SecondOrder(first, solution, factor, k + 1)
    msg = (
        f"load case '{case.name}': second-order forces still change the displacements by {change:.1e} after "
        f"{_ROUNDS} rounds; its buckling factor is {factor:.4g}"
    )
    raise ModelError(msg)


def _change(system: System, new: StaticSolution, old: StaticSolution) -> float:
    """Return the change of displacements relative to them, in the norm of the stiffness."""
    u, before = (np.asarray(system.Q.T @ s.displacements[:, 0]) for s in (new, old))
    size = float(u @ (system.K @ u))
    step = u - before
    return float(np.sqrt(max(float(step @ (system.K @ step)), 0.0) / size)) if size > 0 else 0.0
