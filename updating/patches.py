"""Joints of finite extent: whether members that lie on each other are joined in a point or over an area."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from fem.effects.joint import Joint
from fem.effects.joint_patch import JointPatch
from fem.model import Effect, Model, parameter_values
from updating.acceptance import ACCEPT_GAIN
from updating.fit import FitProblem

PATCH_SIZES = (0.5, 0.75, 1.0, 1.25)
"""Sizes that are tried, over the breadth of the members that cross [-]."""
PATCH_ELEMENTS = 3
"""So many elements lie on half of a stretch as long as the other member is broad."""
MOST_JOINTS = 12
"""Patches are looked for at no more joints: the model is reduced anew for each size."""


def proposed_patch(candidates: Sequence[Effect], model: Model) -> JointPatch | None:
    """Return the patches among candidates, if one of their few joints is rigid about an axis.

    What their extent does to elastic joints alone is within the tolerance of the stiffness.
    """
    patch = next((e for e in candidates if isinstance(e, JointPatch)), None)
    rigid = {e.name for e in model.of_kind(Joint) if set(e.rigid) & {"rx", "ry", "rz"}}
    return patch if patch and rigid & set(patch.joints) and len(patch.joints) <= MOST_JOINTS else None


def refined_at(model: Model, patch: JointPatch) -> Model:
    """Return a model whose elements on patches are short enough: ``PATCH_ELEMENTS`` on half of one."""
    mesh, sides = model.mesh, [side for pair in patch.sides for side in pair]
    for side in sides:
        for towards in (-1, 1):
            end = side.position + towards * PATCH_SIZES[-1] * side.half
            s = mesh.member_positions(side.member)
            if 0 < end < s[-1] and np.abs(s - end).min() > 0.1 * side.half:
                mesh = mesh.with_point_on(side.member, end)
    pieces = np.ones(mesh.n_lines, dtype=np.int64)
    for side in sides:
        lines, s = mesh.members[side.member], mesh.member_positions(side.member)
        on = np.abs((s[1:] + s[:-1]) / 2 - side.position) < PATCH_SIZES[-1] * side.half
        needed = np.ceil(np.diff(s)[on] * PATCH_ELEMENTS / side.half - 1e-6).astype(np.int64)
        pieces[lines[on]] = np.maximum(pieces[lines[on]], needed)
    return model.with_mesh(mesh.split(pieces)) if mesh is not model.mesh or (pieces > 1).any() else model


def choose_patch(
    build: Callable[[Model], FitProblem],
    model: Model,
    patch: JointPatch,
    problem: FitProblem,
    effects: Sequence[Effect] = (),
) -> JointPatch | None:
    """Return patches of the size with which the data are most likely; None if they hardly are more so.

    Constraints cannot be a parameter of a fit: the model is reduced and fitted for each size, and once more
    where a parabola through the best three has its minimum.

    Parameters
    ----------
    build : callable
        Makes the fits' problem of a model.
    model : Model
        Without patches.
    patch : JointPatch
    problem : FitProblem
        Of that model, with the data as they are by now.
    effects : sequence of Effect
        What was found, with its values: fitted beside.
    """
    starts = [parameter_values(e) for e in effects]

    def cost(size: float) -> float:
        reduced = problem.reduced
        if size > 0:
            reduced = build(model.with_effect(patch.with_values(size=size))).reduced
        mine = replace(problem, reduced=reduced.with_forces_of(effects))
        return mine.fit_anew(effects, starts).solution.cost

    costs = {size: cost(size) for size in (0.0, *PATCH_SIZES)}
    sizes = np.array(list(costs))
    k = int(np.argmin([costs[s] for s in PATCH_SIZES])) + 1
    if k + 1 < len(sizes):
        a, b, _ = np.polyfit(sizes[k - 1 : k + 2], [costs[s] for s in sizes[k - 1 : k + 2]], 2)
        vertex = float(np.clip(-b / (2 * a), sizes[k - 1], sizes[k + 1])) if a > 0 else sizes[k]
        if vertex > 0.02 and np.abs(vertex - sizes).min() > 0.02:
            costs[vertex] = cost(vertex)
    best = min((s for s in costs if s > 0), key=lambda s: costs[s])
    return patch.with_values(size=best) if costs[0.0] - costs[best] > ACCEPT_GAIN else None
