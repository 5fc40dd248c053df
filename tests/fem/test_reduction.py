"""Reductions against closed forms and the full system, and bounds of their errors against the true ones."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fem import (
    Contribution,
    Damping,
    Effect,
    Joint,
    Mesh,
    Model,
    ModelError,
    Role,
    Section,
    assemble,
    dofs_of,
    solve_modes,
)
from fem.declarations import Site
from fem.reduction import reduce_craig_bampton, reduce_dynamic, reduce_guyan, reduce_irs, reduce_serep
from fem.reduction.frequency_errors import frequency_errors
from tests.frames import STEEL, beam, cross_beam, fix, planar, portal

ROUNDING = 3e-9
"""Of a frequency: 1e-16 of the highest ω², which is some 1e8 of the lowest ones here."""


def pairs(points, directions="xyz"):
    return [(p, d) for p in points for d in directions]


CASES = {
    "clamped square beam": (
        assemble(beam(20, effects=(fix(0),), section=Section.rectangle(0.02, 0.02))),
        pairs((1, 5, 10, 15), "yz"),
    ),
    "free cross": (assemble(cross_beam(0.05)), pairs((0, 2, 3, 5, 8, 15, 22, 28))),
    "portal": (assemble(portal(0.05)), pairs((6, 10, 14, 20, 24, 28))),
}
FULL = {name: solve_modes(system, 24) for name, (system, _) in CASES.items()}
METHODS = {
    "guyan": lambda s, k, m: reduce_guyan(s, k),
    "dynamic": lambda s, k, m: reduce_dynamic(s, k, 0.9 * m.frequency[m.n_rigid]),
    "irs": lambda s, k, m: reduce_irs(s, k),
    "irs, 5 iterations": lambda s, k, m: reduce_irs(s, k, 5),
    "serep": lambda s, k, m: reduce_serep(s, k, m.n_rigid + 5),
    "craig-bampton": lambda s, k, m: reduce_craig_bampton(s, k, 6),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", CASES)
def test_bounds_bracket_the_true_errors(name, method):
    (system, keep), full = CASES[name], FULL[name]
    first = full.n_rigid
    reduction = METHODS[method](system, keep, full)
    errors = frequency_errors(reduction, 1.02 * full.frequency[first + 3])
    n = len(errors.frequency)
    assert errors.counted
    assert errors.n_missed == 0
    assert n >= 2
    np.testing.assert_allclose(errors.frequency, reduction.modes().frequency[first : first + n], rtol=1e-12)
    true = errors.frequency / full.frequency[first : first + n] - 1
    assert (true >= -ROUNDING).all()
    assert (errors.least <= true + ROUNDING).all()
    assert (errors.most >= true - ROUNDING).all()
    # One step of inverse iteration takes off all but (ω_k/ω_j)⁴ of an error, ω_j of the modes that it is made
    # of; these lie above the reduced system's band, here at twice its frequencies and more for the first.
    large = true > 1e-7
    assert (errors.least[large] >= 0.9 * true[large]).all()


@pytest.mark.parametrize("name", CASES)
def test_errors_without_counting_are_the_same_where_none_is_missed(name):
    system, keep = CASES[name]
    top = 1.02 * FULL[name].frequency[FULL[name].n_rigid + 2]
    sure, cheap = (frequency_errors(reduce_guyan(system, keep), top, count=c) for c in (True, False))
    assert not cheap.counted
    np.testing.assert_array_equal(sure.lower, cheap.lower)


def test_missed_modes_are_counted():
    # z and ry of the points are kept: bending in x-y, stretching and torsion are not there at all
    system = assemble(beam(10, effects=(fix(0),)))
    reduction = reduce_craig_bampton(system, pairs((1, 5), ("z", "ry")), n_modes=0)
    full = solve_modes(system, 12)
    errors = frequency_errors(reduction, 60.0)
    below = int((full.frequency < errors.separation).sum())
    assert errors.n_missed == below - int((reduction.modes().frequency < errors.separation).sum())
    assert errors.n_missed > 0
    assert (errors.lower == 0).all()
    assert np.isinf(errors.most).all()
    assert (full.frequency[: len(errors.upper)] <= errors.upper * (1 + ROUNDING)).all()


def test_guyan_of_one_element_is_the_cubic_of_a_tip_load():
    # v = (3ξ² - ξ³)/2 has 3EI/L³ and ∫ ρA v² dx = 33/140 ρAL
    length, b, h = 0.7, 0.03, 0.01
    model = planar(beam(1, length, effects=(fix(0),)))
    reduction = reduce_guyan(assemble(model), [(1, "z")])
    assert reduction.labels == ("1Z+",)
    np.testing.assert_allclose(reduction.K, [[3 * STEEL.E * b * h**3 / 12 / length**3]], rtol=1e-12)
    np.testing.assert_allclose(reduction.M, [[33 / 140 * STEEL.rho * b * h * length]], rtol=1e-12)
    # and a slope dv/dx = 3/(2L), which is -ry
    np.testing.assert_allclose(reduction.T[6 + 4], -1.5 / length, rtol=1e-12)


def test_guyan_is_exact_in_statics_at_the_kept_dofs():
    system, keep = CASES["portal"]
    reduction = reduce_guyan(system, keep)
    force = np.random.default_rng(0).standard_normal(len(keep))
    dofs = [6 * p + "xyz".index(d) for p, d in keep]
    load = np.zeros(system.model.n_dof)
    load[dofs] = force
    u = system.Q @ np.linalg.solve(system.K.toarray(), system.Q.T @ load)
    np.testing.assert_allclose(
        reduction.T @ np.linalg.solve(reduction.K, force), u, atol=1e-9 * np.abs(u).max()
    )


@pytest.mark.parametrize("name", CASES)
def test_dynamic_reduction_at_a_natural_frequency_has_that_mode(name):
    (system, keep), full = CASES[name], FULL[name]
    f = full.frequency[full.n_rigid]
    reduced = reduce_dynamic(system, keep, f).modes()
    assert np.abs(reduced.frequency / f - 1).min() < ROUNDING


@pytest.mark.parametrize("name", CASES)
def test_static_is_dynamic_at_0_hz(name):
    system, keep = CASES[name]
    static, dynamic = reduce_guyan(system, keep), reduce_dynamic(system, keep, 0.0)
    np.testing.assert_array_equal(static.T, dynamic.T)


def test_irs_iterations_converge_to_the_modes_at_the_rate_of_their_linearisation():
    # At the fixed point T = Φ Φ_a⁻¹ with A = M_r⁻¹K_r = Φ_a Λ Φ_a⁻¹ and KT = MTA, a change E of t gives
    # M_r δA = AᵀG - GA with G = TᵀMδT, and becomes K_oo⁻¹ (M_oo E A + (M_oa + M_oo t) δA). ω² errs by E².
    system = assemble(planar(beam(16, effects=(fix(0),))))
    keep = pairs((1, 8, 12), "z")
    full = solve_modes(system, 3)
    K, M, phi = system.K.toarray(), system.M.toarray(), system.Q.T @ full.shapes
    a = [int(np.flatnonzero(system.Q.toarray()[6 * p + 2])[0]) for p, _ in keep]
    o = np.setdiff1d(np.arange(len(K)), a)
    T = phi @ np.linalg.inv(phi[a])
    A = phi[a] @ np.diag(full.omega**2) @ np.linalg.inv(phi[a])
    held, M_r = np.linalg.inv(K[np.ix_(o, o)]), T.T @ M @ T

    def linearised(E):
        G = (T.T @ M)[:, o] @ E
        dA = np.linalg.solve(M_r, A.T @ G - G @ A)
        return held @ (M[np.ix_(o, o)] @ E @ A + (M @ T)[o] @ dA)

    unit = np.eye(len(o) * 3).reshape(-1, len(o), 3)
    rate = np.abs(np.linalg.eigvals([linearised(E).ravel() for E in unit])).max() ** 2
    errors = [reduce_irs(system, keep, n).modes().frequency[2] / full.frequency[2] - 1 for n in (5, 6)]
    assert rate < 0.3
    # the errors' own size is what is left out
    assert errors[1] / errors[0] == pytest.approx(rate, rel=0.01)


def test_serep_keeps_frequencies_and_shapes():
    (system, keep), full = CASES["free cross"], FULL["free cross"]
    reduction = reduce_serep(system, keep, 11)  # the twelfth is one of two equal ones
    assert reduction.rank == 11
    assert reduction.K.shape == (len(keep), len(keep))
    modes = reduction.modes()
    assert modes.n_modes == 11
    np.testing.assert_allclose(modes.frequency[6:], full.frequency[6:11], rtol=ROUNDING)
    shapes = full.shapes[:, :11]
    dofs = [6 * p + "xyz".index(d) for p, d in keep]
    np.testing.assert_allclose(reduction.T @ shapes[dofs], shapes, atol=1e-9 * np.abs(shapes).max())


def test_craig_bampton_has_the_held_structures_modes():
    model = planar(beam(10, effects=(fix(0),)))
    system = assemble(model)
    keep = [(1, "z"), (1, "ry")]
    reduction = reduce_craig_bampton(system, keep, n_modes=4)
    assert reduction.labels == ("1Z+", "1RY+", "fixed mode 1", "fixed mode 2", "fixed mode 3", "fixed mode 4")
    held = solve_modes(assemble(planar(beam(10, effects=(fix(0), fix(1))))), 4)
    a = reduction.n_kept
    np.testing.assert_allclose(reduction.K[a:, a:].diagonal(), held.omega**2, rtol=ROUNDING)
    assert np.abs(reduction.K[:a, a:]).max() < 1e-9 * np.abs(reduction.K).max()
    np.testing.assert_allclose(reduction.M[a:, a:], np.eye(4), atol=1e-12)
    up_to = reduce_craig_bampton(system, keep, max_frequency=1.01 * held.frequency[2])
    assert up_to.labels[a:] == ("fixed mode 1", "fixed mode 2", "fixed mode 3")


def test_all_modes_of_the_held_structure_leave_no_error():
    system = assemble(planar(beam(4, effects=(fix(0),))))
    reduction = reduce_craig_bampton(system, [(1, "z")], n_modes=system.n_free - 1)
    np.testing.assert_allclose(
        reduction.modes().frequency, solve_modes(system, system.n_free).frequency, rtol=1e-8
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Rubber(Effect):
    """A spring between two points that stiffens and loses with frequency."""

    kind: ClassVar[str] = "rubber"
    role: ClassVar[Role] = Role.STIFFNESS
    k: Any = 1e5

    @property
    def where(self):
        return Site("here")

    def parameters(self):
        return ()

    def contribute(self, model):
        b = np.zeros(12)
        b[[2, 8]] = 1.0, -1.0

        def law(omega):
            x = 1e-3 * omega
            return 1 + x**2 / (1 + x**2), x / (1 + x**2)

        return (Contribution(dofs_of([3, 7]).reshape(1, 12), self.k * np.outer(b, b)[None], law=law),)


def test_damping_and_laws_are_reduced_with_the_rest():
    damper = np.diag([0, 0, 30.0, 0, 0.1, 0])
    model = cross_beam(0.1, C=damper, eta=0.1).with_effect(Rubber(name="rubber"))
    system = assemble(model.with_damping(Damping(alpha=2.0, beta=1e-6, loss_factor=0.01)))
    reduction = reduce_guyan(system, list(range(system.model.n_dof)))  # every DOF is kept
    Z = system.Q @ system.dynamic_stiffness(700.0) @ system.Q.T
    np.testing.assert_allclose(reduction.dynamic_stiffness(700.0), Z.toarray(), atol=1e-6)
    part = reduce_craig_bampton(system, pairs((0, 3, 7, 1, 4)), 10)
    T = system.Q.T @ part.T
    small = T.T @ (system.dynamic_stiffness(700.0) @ T)
    np.testing.assert_allclose(part.dynamic_stiffness(700.0), small, atol=1e-9 * np.abs(small).max())


@settings(max_examples=15)
@given(st.sets(st.integers(1, 20), min_size=4, max_size=10), st.integers(1, 5))
def test_more_kept_dofs_never_raise_a_frequency(points, n_more):
    # The spaces of static responses are nested, and Rayleigh-Ritz values fall with the space.
    system = assemble(planar(beam(20, effects=(fix(0),))))
    points = sorted(points)
    few = reduce_guyan(system, pairs(points, "z")).modes().frequency
    extra = [p for p in range(1, 21) if p not in points][:n_more]
    more = reduce_guyan(system, pairs([*points, *extra], "z")).modes().frequency
    full = solve_modes(system, len(few)).frequency
    assert (more[: len(few)] <= few * (1 + 1e-8)).all()
    assert (full <= few * (1 + 1e-8)).all()


def test_what_cannot_be_kept_is_refused_by_name():
    system = assemble(portal(0.1))
    with pytest.raises(ModelError, match=r"DOF 0X\+ is held by 'foot0'"):
        reduce_guyan(system, [(0, "x")])
    with pytest.raises(ModelError, match=r"DOF 1Z\+ is tied to others by 'corner0'"):
        reduce_irs(system, [(1, "z")])
    with pytest.raises(ModelError, match=r"DOF 8Y\+ is kept twice"):
        reduce_serep(system, [(8, "y"), (7, "x"), (8, "y")])
    with pytest.raises(ModelError, match="at least one DOF"):
        reduce_guyan(system, [])
    with pytest.raises(ModelError, match="combinations cannot be kept"):
        reduce_guyan(system, np.eye(system.model.n_dof)[:2])
    with pytest.raises(ModelError, match="2 kept DOFs cannot distinguish 3 modes"):
        reduce_serep(system, [(8, "y"), (7, "x")], 3)
    with pytest.raises(ModelError, match="needs at least 1"):
        reduce_irs(system, [(8, "y")], 0)
    with pytest.raises(ModelError, match="no elastic mode up to 1e-05 Hz"):
        frequency_errors(reduce_guyan(system, [(8, "y")]), 1e-5)


def test_kept_dofs_must_hold_a_free_structure():
    system = assemble(cross_beam(0.1))
    with pytest.raises(ModelError, match=r"held at its 3 kept DOFs, the structure still has 3 rigid-body"):
        reduce_guyan(system, pairs((0,)))


def test_a_natural_frequency_of_the_held_structure_is_refused():
    system = assemble(planar(beam(8, effects=(fix(0),))))
    held = solve_modes(assemble(planar(beam(8, effects=(fix(0), fix(1, ("z",)))))), 1).frequency[0]
    with pytest.raises(ModelError, match="is a natural frequency of the structure held at the kept DOFs"):
        reduce_dynamic(system, [(1, "z")], held)


def test_massless_kept_dofs_are_refused_by_irs():
    # a point without mass on a spring at the tip
    bar = beam(4, effects=(fix(0),))
    mesh = Mesh.from_lines(np.vstack([bar.mesh.points, [[1.0, 0, 0]]]), bar.mesh.lines, bar.mesh.members)
    free = len(mesh.points) - 1
    spring = Joint(name="spring", point1=free, point2=1, location=mesh.points[1], K=1e4 * np.eye(6))
    system = assemble(Model(mesh, (*bar.effects, spring)))
    keep = [(1, "z"), (free, "z")]
    with pytest.raises(ModelError, match=rf"kept DOF {free}Z\+ has no mass"):
        reduce_irs(system, keep)
    assert reduce_guyan(system, keep).modes().n_modes == 1


@pytest.mark.slow
def test_a_hundred_dofs_of_thirty_thousand():
    from benchmarks.lattice import lattice

    system = assemble(lattice(17))
    rng = np.random.default_rng(0)
    points = 17 * rng.integers(1, 17, 50) + np.arange(50) * 80
    keep = [(int(p), d) for p in points if p % 17 for d in "xy"]
    reduction = reduce_guyan(system, keep)
    full = solve_modes(system, 3).frequency
    errors = frequency_errors(reduction, 1.01 * reduction.modes().frequency[1])
    true = errors.frequency / full[: len(errors.frequency)] - 1
    assert errors.n_missed == 0
    assert (errors.least <= true).all()
    assert (true <= errors.most).all()
