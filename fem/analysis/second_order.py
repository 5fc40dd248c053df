"""Second-order statics (P-Δ): a load case in equilibrium with the geometric stiffness of its forces.

    Model ─ load case → solve_second_order → SecondOrder

(K + K_G) u = f, K_G of the section forces of u, iterated from those of first order. Displacements and turns
are small; the shortening of bent members (bowing) is left out.

A round forms K_G of the last section forces and corrects u by the force out of balance. The factor of a
former round's K + K_G serves again while section forces hardly change, and all factors have one order of
elimination. On a fine mesh the force out of balance is rounding before the corrections fall below the
tolerance: the iteration then ends where they no longer fall.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fem.analysis.buckling import lowest_factor
from fem.analysis.initial_stress import StressedState, stress_effect
from fem.analysis.line_loads import line_dofs
from fem.analysis.loads import LoadCase
from fem.analysis.modes import n_negative
from fem.analysis.section_forces import line_stiffness
from fem.analysis.statics import Loading, StaticSolution, energy_rounding, factor_stiffness, residual_rounding
from fem.array_types import Floats
from fem.linalg.solvers import Factor, SingularMatrixError, factorise
from fem.model import Model, ModelError
from fem.recent import Recent
from fem.summary import fields_summary
from fem.system import System, assemble, full_matrices, on_pattern, stiffness_pattern, sum_stiffness

TOLERANCE = 1e-10
"""Relative error of the displacements, in the norm of the stiffness, at which the iteration ends [-].

Unless rounding of the forces out of balance makes a larger one."""

_ROUNDS = 100


@dataclass(frozen=True, slots=True, eq=False)
class SecondOrder:
    """The response to one load case with the geometric stiffness of its section forces.

    Attributes
    ----------
    first : StaticSolution
        Of first order.
    solution : StaticSolution
        Of second order: displacements, reactions and section forces in the displaced state, in the axes of
        the structure at rest. Its model has the geometric stiffness, the effect ``"prestress"``.
    n_rounds : int
        Number of solutions beyond that of first order.
    system : System
        Of the structure without geometric stiffness.
    """

    first: StaticSolution
    solution: StaticSolution
    n_rounds: int
    system: System
    _kept: Recent = field(default_factory=lambda: Recent(1), init=False, repr=False)

    __repr__ = fields_summary

    @property
    def factor(self) -> float:
        """By which the load may grow until the structure buckles, of the forces of first order [-].

        Infinite where the load does not make it buckle. Computed when first asked for.
        """
        value: float = self._kept.get("factor", lambda: lowest_factor(self.system, self.first))
        return value


def solve_second_order(model: Model | System, case: LoadCase) -> SecondOrder:
    """Solve a load case with the geometric stiffness of its section forces.

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
    loading, K = Loading.of(system.model, case), full_matrices(system.model)["K"]
    padded = replace(system, K=on_pattern(system.K, stiffness_pattern(system)))
    b = loading.on_coordinates(system, K)
    factor, q = None, b
    if system.n_free:
        factor = factor_stiffness(padded)
        q = factor.solve(b)
        q += factor.solve(b - system.K @ q)
    elastic = line_stiffness(system.model)
    first = loading.response(system.model, K, loading.motion(system, q), elastic)
    reactions = {key: float(value[0]) for key, value in first.reactions.items()}
    state = StressedState(system.model, first.displacements, first.equilibrium, reactions)
    change = before = np.inf
    dofs = line_dofs(system.model)
    for k in range(_ROUNDS):
        effect = stress_effect(state, elastic)
        loaded = system.model.with_effect(effect)
        added = effect.contribute(loaded)
        K_G = sum_stiffness(loaded, added)
        on_lines = elastic.copy()
        for c in added:
            if c.lines is not None and c.K is not None:
                on_lines[c.lines] += c.K
        stressed = system.K + _on_q(system, K_G)
        b = loading.on_coordinates(system, K + K_G)
        new = q
        if factor is not None:
            # Reuse the last factor while displacements change by less than this, relatively [-]
            if change > min(1e-3, 0.1 * before) or not k:
                factor = _factor(system, padded, stressed, factor, case, first)
            new = q + factor.solve(b - stressed @ q)
        change, before = _change(system, new, q), change
        q = new
        # changes fall by a constant factor at least: the rest of them is a geometric series
        ratio = change / before if k else 1.0
        converged = change <= TOLERANCE or (ratio < 1 and change * ratio / (1 - ratio) <= TOLERANCE)
        if not converged and change >= before and factor is not None:
            on_all = residual_rounding(K + K_G, on_lines, dofs, state.equilibrium, state.displacements)[1]
            rounding = energy_rounding(system, factor, on_all[:, 0])
            converged = change <= _relative(system, rounding, q)
        if converged:
            solution = loading.response(loaded, K + K_G, loading.motion(system, q), on_lines)
            return SecondOrder(first, solution, k + 1, system)
        state = _state(loading, loaded, K + K_G, on_lines, loading.motion(system, q))
    msg = (
        f"load case '{case.name}': second-order forces still change the displacements by {change:.1e} after "
        f"{_ROUNDS} rounds; its buckling factor is {lowest_factor(system, first):.4g}"
    )
    raise ModelError(msg)


def _state(loading: Loading, model: Model, K: Any, stiffness: Floats, u: Floats) -> StressedState:
    """Return the static state with displacements u under the stiffness of all DOFs and of lines."""
    reactions = {key: float(value[0]) for key, value in loading.reactions(K @ u - loading.f).items()}
    return StressedState(model, u, loading.equilibrium(model, stiffness, u), reactions)


def _on_q(system: System, X: Any) -> Any:
    return system.Q.T @ X @ system.Q


def _factor(
    system: System, padded: System, stressed: Any, like: Factor, case: LoadCase, first: StaticSolution
) -> Factor:
    """Factorise K + K_G; raises an error if it is not positive definite, so that the structure buckles.

    K being so, K + λ K_G is for 0 ≤ λ ≤ 1 if it is for λ = 1: the least positive load factor is above 1.
    """
    A = on_pattern(stressed, padded.K)
    try:
        factor = factorise(A, like)
        stable = not n_negative(A, factor)
    except SingularMatrixError:
        factor, stable = like, False
    if stable:
        return factor
    least = lowest_factor(system, first)
    if least > 1:
        msg = (
            f"load case '{case.name}': under its second-order forces the structure is not stable, though "
            f"those of first order have the buckling factor {least:.4g}"
        )
        raise ModelError(msg)
    msg = (
        f"load case '{case.name}' makes the structure buckle at {least:.4g} times its size: second-order "
        "displacements exist for factors above 1 only; reduce the load or stiffen the structure"
    )
    raise ModelError(msg)


def _change(system: System, new: Floats, old: Floats) -> float:
    """Return the change of coordinates (n_free, 1) relative to them, in the norm of the stiffness."""
    step = (new - old)[:, 0]
    return _relative(system, float(np.sqrt(max(float(step @ (system.K @ step)), 0.0))), new)


def _relative(system: System, energy: float, q: Floats) -> float:
    """Return a norm of displacements [√J] relative to that of coordinates (n_free, 1) [-]."""
    size = float(q[:, 0] @ (system.K @ q[:, 0]))
    return energy / float(np.sqrt(size)) if size > 0 else 0.0
