"""The bound of rounding in section forces and reactions: errors lie below it, and forces far above it."""

import numpy as np
import pytest

from fem import Frame, InitialStrain, LoadCase, MemberProperties, Mesh, Model, assemble, solve_static
from fem.analysis.line_loads import line_dofs
from fem.analysis.section_forces import line_stiffness
from fem.analysis.stations import forces_on_lines
from fem.system import full_matrices
from tests.frames import FLAT, STEEL, fix

STRAIN = 1e-3
FIXED_END = STEEL.E * FLAT.A * STRAIN


def tree(seed, pieces=6, branches=7):
    """Return a determinate frame: each member begins where another one ends, the first at a fixed point."""
    rng = np.random.default_rng(seed)
    points, lines = [np.zeros(3)], []
    for k in range(branches):
        lines.append([int(rng.integers(len(points))), k + 1])
        points.append(points[lines[-1][0]] + rng.uniform(-2, 2, 3))
    names = [f"m{k}" for k in range(branches)]
    mesh = Mesh.from_lines(points, lines, {m: [k] for k, m in enumerate(names)}).split(pieces)
    return Model(mesh, (Frame(members=dict.fromkeys(names, MemberProperties(STEEL, FLAT))), fix(0)))


def heated_and_loaded(model):
    strained = tuple(InitialStrain(member=m, axial=STRAIN) for m in model.mesh.members)
    heat = LoadCase(name="heat", members=strained)
    force = np.zeros(model.n_dof)
    force[6 * (len(model.mesh.members)) + np.arange(3)] = [30.0, -20.0, 10.0]  # the last branch's end
    return solve_static(assemble(model), [heat, LoadCase(name="force", points=force)])


@pytest.mark.parametrize("seed", range(12))
def test_a_frame_that_is_free_to_expand_holds_rounding_alone(seed):
    found = heated_and_loaded(tree(seed))
    forces = abs(forces_on_lines(found, 3)[..., 0]).max(axis=(0, 1))
    assert (forces.reshape(2, 3).max(axis=1) <= found.rounding[:, 0]).all()
    held = {d: float(abs(v[0])) for (_, d), v in found.reactions.items()}
    assert max(held[d] for d in ("x", "y", "z")) <= found.rounding[0, 0]
    assert max(held[d] for d in ("rx", "ry", "rz")) <= found.rounding[1, 0]
    assert found.rounding[0, 0] < 1e-8 * FIXED_END
    # The force at a tip is balanced by its support, the error of which is rounding.
    applied = {"x": 30.0, "y": -20.0, "z": 10.0}
    errors = [abs(found.reactions["support0", d][1] + f) for d, f in applied.items()]
    assert max(errors) <= found.rounding[0, 1] < 1e-3


def test_the_bound_is_that_of_all_nodal_forces_with_their_worst_signs():
    """Compare the estimate with the norm of the whole influence matrix, from the inverse of K."""
    model = tree(3, pieces=2)
    found, system = heated_and_loaded(model), assemble(model)
    K, on_lines, dofs = full_matrices(model)["K"].toarray(), line_stiffness(model), line_dofs(model)
    Q = system.Q.toarray()
    flexibility = Q @ np.linalg.inv(system.K.toarray()) @ Q.T
    outputs = np.vstack([*(k @ np.eye(model.n_dof)[d] for k, d in zip(on_lines, dofs, strict=True)), K[:6]])
    influence = abs(outputs @ flexibility)
    u, n_lines = abs(found.displacements[:, 0]), model.mesh.n_lines
    lines = abs(on_lines) @ u[dofs][..., None] + abs(found.equilibrium.fixed[..., :1])
    nodes = abs(K) @ u
    np.add.at(nodes, dofs.ravel(), lines.ravel())
    spread = influence @ nodes
    turns = np.tile([False] * 3 + [True] * 3, 2 * n_lines + 1)
    expected = np.array([spread[~turns].max(), spread[turns].max()])
    operations = 36 + (K != 0).sum(axis=1).max()
    found_in_units = found.rounding[:, 0] / (np.sqrt(3) * operations * np.finfo(float).eps / 2)
    # Hager's estimate is a lower bound of the norm; the error of the last product is added to it.
    assert (found_in_units > 0.5 * expected).all()
    assert (found_in_units < 2 * expected).all()
