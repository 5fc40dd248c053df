"""Joints of finite extent: whether members that lie on each other are joined in a point or over an area."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from fem.effects.joint import Joint
from fem.effects.joint_patch import JointPatch, turning_parameters, with_patch
from fem.model import Effect, Model, parameter_values
from updating.diagnosis.acceptance import ACCEPT_GAIN
from updating.inference.fit import FitProblem
from updating.inference.fit_result import FitResult
from updating.inference.parameters import Nuisance

PATCH_SIZES = (0.5, 0.75, 1.0, 1.25)
"""Sizes that are tried, over the breadth of the members that cross [-]."""
PATCH_ELEMENTS = 3
"""So many elements lie on half of a stretch as long as the other member is broad."""
TWIST_STD, TWIST_REACH = 0.7, 2.0
"""Standard deviation of the logarithm of the stiffness about the normal of joints with patches, from that of
discs as broad as the members; by how many of them it may be off [-]."""
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


def with_turning(nuisances: Sequence[Nuisance], model: Model) -> tuple[Nuisance, ...]:
    """Return uncertain parameters with the stiffnesses about their normals of joints that have patches.

    They replace what is said of these.
    """
    own = {ref: Nuisance(*ref, TWIST_STD) for ref in turning_parameters(model)}
    kept = tuple(own.pop((n.effect, n.parameter), n) for n in nuisances)
    return (*kept, *own.values())


def choose_patch(
    build: Callable[[Model], FitProblem],
    model: Model,
    patch: JointPatch,
    problem: FitProblem,
    effects: Sequence[Effect] = (),
    twist: float = 0.0,
) -> JointPatch | None:
    """Return patches of the size with which the data are most likely; None if they hardly are more so.

    Constraints cannot be a parameter of a fit: the model is reduced and fitted for each size, and once more
    where a parabola through the best three has its minimum. Then joints that are rigid about their normals
    are let turn about them; that stays if the data are more likely by more than ``ACCEPT_GAIN`` and the
    stiffness is within ``TWIST_REACH`` standard deviations: a softer joint is an effect.

    Parameters
    ----------
    build : callable
        Makes the fits' problem of a model, with its uncertain parameters.
    model : Model
        Without patches.
    patch : JointPatch
    problem : FitProblem
        Of that model, or of one with patches, with the data as they are by now.
    effects : sequence of Effect
        What was found, with its values: fitted beside.
    twist : float
        Of patches of any size, if joints turn about their normals in all that was found [-].
    """
    starts = [parameter_values(e) for e in effects]

    def fitted(size: float, twist: float) -> FitResult:
        if size > 0 or twist > 0:
            built = build(with_patch(model, patch.with_values(size=size, twist=twist)))
        else:
            built = build(model) if problem.reduced.model.of_kind(JointPatch) else problem
        reduced = built.reduced.with_forces_of(effects)
        return replace(problem, reduced=reduced, nuisances=built.nuisances).fit_anew(effects, starts)

    def cost(size: float) -> float:
        return fitted(size, twist).solution.cost

    costs = {size: cost(size) for size in (0.0, *PATCH_SIZES)}
    sizes = np.array(list(costs))
    k = int(np.argmin([costs[s] for s in PATCH_SIZES])) + 1
    if k + 1 < len(sizes):
        a, b, _ = np.polyfit(sizes[k - 1 : k + 2], [costs[s] for s in sizes[k - 1 : k + 2]], 2)
        vertex = float(np.clip(-b / (2 * a), sizes[k - 1], sizes[k + 1])) if a > 0 else sizes[k]
        if vertex > 0.02 and np.abs(vertex - sizes).min() > 0.02:
            costs[vertex] = cost(vertex)
    best = min((s for s in costs if s > 0), key=lambda s: costs[s])
    least = costs[best]
    held = {(name, f"k{d}") for e in effects for name, d in e.released()}
    rigid = {(j.name, f"k{d}") for j in model.of_kind(Joint) for d in j.rigid}
    turning = {ref: k for ref, k in patch.turning(model).items() if ref in rigid}
    if turning and not twist and not held & set(turning):
        fit = fitted(best, 1.0)
        off = max(abs(np.log(fit.values[ref] / k)) for ref, k in turning.items()) / TWIST_STD
        if least - fit.solution.cost > ACCEPT_GAIN and off < TWIST_REACH:
            least, twist = fit.solution.cost, 1.0
    return patch.with_values(size=best, twist=twist) if costs[0.0] - least > ACCEPT_GAIN else None
