"""Joints of finite extent: elements on their patches, and their stiffness about the normal."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from fem.effects.joint_patch import JointPatch, turning_parameters
from fem.elements.splitting import split
from fem.model import Model
from updating.inference.parameters import Nuisance
from updating.inference.unknowns import Uncertain, Unknown

U = TypeVar("U", bound=Uncertain)
PATCH_REACH = 1.25
"""Elements are short up to this multiple of the stretch on which a joint acts [-]."""
PATCH_ELEMENTS = 3
"""Number of elements on half of a stretch as long as the other member is broad."""
TWIST_STD = 0.7
"""Standard deviation of the logarithm of the stiffness about the normal of joints with patches, from that of
discs as broad as the members [-]."""


def refined_on_patches(model: Model) -> Model:
    """Return a model whose elements are short on the patches that its joints have, if any."""
    patch = next(iter(model.of_kind(JointPatch)), None)
    return refined_at(model, patch) if patch else model


def refined_at(model: Model, patch: JointPatch) -> Model:
    """Return a model whose elements on patches are short enough: ``PATCH_ELEMENTS`` on half of one."""
    mesh, sides = model.mesh, [side for pair in patch.sides for side in pair]
    for side in sides:
        for towards in (-1, 1):
            end = side.position + towards * PATCH_REACH * side.half
            s = mesh.member_positions(side.member)
            if 0 < end < s[-1] and np.abs(s - end).min() > 0.1 * side.half:
                mesh = mesh.with_point_on(side.member, end)
    pieces = np.ones(mesh.n_lines, dtype=np.int64)
    for side in sides:
        lines, s = mesh.members[side.member], mesh.member_positions(side.member)
        on = np.abs((s[1:] + s[:-1]) / 2 - side.position) < PATCH_REACH * side.half
        needed = np.ceil(np.diff(s)[on] * PATCH_ELEMENTS / side.half - 1e-6).astype(np.int64)
        pieces[lines[on]] = np.maximum(pieces[lines[on]], needed)
    return split(model.with_mesh(mesh), pieces) if mesh is not model.mesh or (pieces > 1).any() else model


def with_turning(nuisances: Sequence[U], model: Model) -> tuple[U | Nuisance, ...]:
    """Return uncertain parameters with the stiffnesses about their normals of joints that have patches.

    They replace what is said of these, but for what an update asks for.
    """
    turning = {ref: Nuisance(*ref, TWIST_STD) for ref in turning_parameters(model)}
    for ref in (ref for n in nuisances if isinstance(n, Unknown) for ref in n.refs):
        turning.pop(ref, None)
    kept = tuple(turning.pop(n.refs[0], n) for n in nuisances)
    return (*kept, *turning.values())
