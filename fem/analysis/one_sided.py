"""Statics with bars that carry tension alone, or compression alone.

    Model ─ load case → solve_one_sided → OneSided

A bar that would be in the other state goes slack. The set of slack bars is iterated until each slack bar
would be in the other state, and no other one is.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from fem.analysis.loads import LoadCase
from fem.analysis.statics import StaticSolution, solve_static
from fem.array_types import Bools, Floats
from fem.elements.frame import Frame
from fem.elements.properties import MemberProperties
from fem.model import Model, ModelError
from fem.summary import fields_summary
from fem.system import assemble

SLACK = 1e-9
"""Part of its stiffness that a slack bar keeps, so that its elongation is known [-]."""

_ROUNDING = 1e-7
"""Force relative to the largest, below which a bar carries nothing."""
_DIGITS = 1e-14
"""Part of stiffness times displacement that rounding leaves of a force that is 0 [-]."""
_ROUNDS = 200


@dataclass(frozen=True, slots=True, eq=False)
class OneSided:
    """The response to one load case.

    Attributes
    ----------
    solution : StaticSolution
        Of the structure without the stiffness of slack bars.
    slack : tuple of str
        Names of slack bars.
    n_rounds : int
        Number of solutions.
    """

    solution: StaticSolution
    slack: tuple[str, ...]
    n_rounds: int

    __repr__ = fields_summary


def one_sided(model: Model) -> dict[str, float]:
    """Return the members that carry tension (1) or compression (-1) alone."""
    return {
        name: 1.0 if p.only == "tension" else -1.0
        for frame in model.of_kind(Frame)
        for name, p in frame.members.items()
        if p.only and name in model.mesh.members
    }


def solve_one_sided(model: Model, case: LoadCase) -> OneSided:
    """Solve a load case with bars that go slack.

    Parameters
    ----------
    model : Model
    case : LoadCase
        Responses do not add up: give a combination as one load case.

    Raises
    ------
    ModelError
        As :func:`fem.analysis.statics.solve_static`; where slack bars alone would have to carry the load; and
        where no set of slack bars settles.
    """
    sides = one_sided(model)
    names = list(sides)
    sign = np.array([sides[name] for name in names])
    slack = np.zeros(len(names), dtype=bool)
    seen: set[bytes] = set()
    for k in range(_ROUNDS):
        changed = _with_slack(model, [n for n, yes in zip(names, slack, strict=True) if yes])
        system = assemble(changed, reciprocal=False)
        found = solve_static(system, case)
        N = np.array([found.line_forces[model.mesh.members[n], :, 0, 0].mean() for n in names])
        # Heat and misfits leave no force in a determinate structure: that on fixed nodes gives the size.
        parts = found.line_forces[:, :, :3], found.equilibrium.fixed[:, :3]
        size = max(*(float(np.abs(x).max(initial=0.0)) for x in parts), 1e-300)
        moved = float(np.abs(system.Q.T @ found.displacements[:, 0]).max(initial=0.0))
        nothing = _ROUNDING * size + _DIGITS * float(system.K.diagonal().max()) * moved
        would = sign * N / np.where(slack, SLACK, 1.0)
        wanted = np.where(slack, would <= nothing, would < -nothing)
        if (wanted == slack).all():
            _refuse_mechanism(case, names, slack, N, size)
            return OneSided(found, tuple(n for n, yes in zip(names, slack, strict=True) if yes), k + 1)
        seen.add(slack.tobytes())
        if wanted.tobytes() in seen:  # one bar at a time then: the one that is farthest from its state
            wrong = np.flatnonzero(wanted != slack)
            one = wrong[np.argmax(np.abs(N[wrong]) / np.where(slack[wrong], SLACK, 1.0))]
            wanted = slack.copy()
            wanted[one] = not slack[one]
            if wanted.tobytes() in seen:
                break
        slack = wanted
    msg = f"load case '{case.name}': the bars that carry {_words(sides.values())} alone do not settle"
    raise ModelError(msg)


def _refuse_mechanism(case: LoadCase, names: list[str], slack: Bools, N: Floats, size: float) -> None:
    """Raise an error where a slack bar still carries a part of the load: nothing else does."""
    carried = np.where(slack, np.abs(N), 0.0)
    # Force of a slack bar relative to the largest, above which nothing else carries the load
    if slack.any() and carried.max() > 1e-4 * size:
        name = names[int(carried.argmax())]
        msg = (
            f"load case '{case.name}': bar '{name}' goes slack, and nothing else holds the structure against "
            "the load; give it a brace that the load pulls, or a bar that carries both ways"
        )
        raise ModelError(msg)


def _with_slack(model: Model, slack: list[str]) -> Model:
    """Return the model whose slack bars keep their mass and next to no stiffness."""
    if not slack:
        return model
    effects = []
    for effect in model.effects:
        if isinstance(effect, Frame):
            members: dict[str, MemberProperties] = dict(effect.members)
            for name in slack:
                if name in members:
                    members[name] = _loose(members[name])
            effect = replace(effect, members=members)
        effects.append(effect)
    return replace(model, effects=tuple(effects))


def _loose(p: MemberProperties) -> MemberProperties:
    """Return the properties of a slack bar."""
    material = replace(p.material, name=f"{p.material.name}, slack", E=SLACK * p.material.E)
    return replace(p, material=material, pretension=0.0)


def _words(sides: Iterable[float]) -> str:
    return " or ".join(sorted({"tension" if s > 0 else "compression" for s in sides}, reverse=True))
