"""Elements that depend on frequency, rigid links, linear equations, and joints in axes of their own."""

from dataclasses import replace

import numpy as np
import pytest

from fem import (
    DIRECTIONS,
    AddedMass,
    FractionalKelvinVoigt,
    FractionalZener,
    Frame,
    Joint,
    MemberProperties,
    Mesh,
    Model,
    ModelError,
    MultiPointConstraint,
    RigidLink,
    TabulatedLaw,
    TabulatedStiffness,
    Viscoelastic,
    Zener,
    assemble,
    compute_frf,
    dof_vectors,
    lever_matrix,
    solve_modes,
)
from fem.reduction import LocalChanges, ParametricFRF, reduce_model, values_of
from tests.frames import FLAT, STEEL, TURNED, beam, fix, mounted

LAWS = {
    "zener": (Zener(4.0, 2e-3), lambda s: 1 + 4 * s * 2e-3 / (1 + s * 2e-3)),
    "kelvin_voigt": (FractionalKelvinVoigt(2e-3, 1.0), lambda s: 1 + 2e-3 * s),
    "fractional_kelvin_voigt": (FractionalKelvinVoigt(2e-3, 0.4), lambda s: 1 + (2e-3 * s) ** 0.4),
    "fractional_zener": (
        FractionalZener(4.0, 2e-3, 0.4),
        lambda s: 1 + 4 * (2e-3 * s) ** 0.4 / (1 + (2e-3 * s) ** 0.4),
    ),
}


@pytest.mark.parametrize("name", LAWS)
def test_a_law_is_its_complex_formula(name):
    law, formula = LAWS[name]
    omega = np.array([0.0, 1e-3, 1.0, 300.0, 5e4])
    storage, loss = law(omega)
    np.testing.assert_allclose(storage + 1j * loss, formula(1j * omega), rtol=1e-13)
    assert storage[0] == 1.0
    assert loss[0] == 0.0


def test_the_loss_factor_of_a_standard_linear_solid_is_highest_where_it_should_be():
    law = Zener(3.0, 1e-3)
    x = np.sort(np.append(np.geomspace(1.0, 1e5, 999), 1e3 / 2))  # 1/(τ √(1 + r)) = 500
    storage, loss = law(x)
    assert x[np.argmax(loss / storage)] == 500.0
    assert (loss / storage).max() == pytest.approx(3 / (2 * 2))


def test_a_table_gives_what_it_holds_and_is_linear_in_between():
    table = TabulatedLaw.of([10.0, 30.0], [100 + 5j, 300 + 25j])
    storage, loss = table(2 * np.pi * np.array([0.0, 10.0, 25.0, 30.0, 99.0]))
    np.testing.assert_allclose(storage + 1j * loss, [100 + 5j, 100 + 5j, 250 + 20j, 300 + 25j, 300 + 25j])


@pytest.mark.parametrize(
    ("frequency", "stiffness", "message"),
    [
        ([1.0, 2.0], [1.0], "1 stiffnesses for 2 frequencies"),
        ([2.0, 1.0], [1.0, 1.0], "increase"),
        ([-1.0, 1.0], [1.0, 1.0], "not negative"),
        ([1.0, 2.0], [1.0, np.nan], "not a finite number at 2 Hz"),
    ],
)
def test_a_bad_table_is_refused(frequency, stiffness, message):
    with pytest.raises(ModelError, match=message):
        TabulatedLaw.of(frequency, stiffness)


def rigid_bar_on(*elements):
    """Return a bar that a link makes rigid, 0.2 kg, on elements at its first end."""
    model = beam(1, 0.5, effects=(RigidLink(name="rigid", point=0, dependents=(1,)), *elements))
    frame = model.effects[0]
    properties = frame.members["beam"]
    return model, properties.material.rho * properties.section.A * 0.5


@pytest.mark.parametrize("method", ["reduced", "direct"])
@pytest.mark.parametrize("name", LAWS)
def test_a_rigid_mass_on_a_viscoelastic_mount(method, name):
    """H = 1 / (k law(ω) - ω² m), along the bar, which turns nothing."""
    law, formula = LAWS[name]
    mount = Viscoelastic(
        name="mount", point1=0, location=np.zeros(3), K=np.diag([2e4, 1e6, 1e6, 1e4, 1e4, 1e4]), law=law
    )
    model, mass = rigid_bar_on(mount)
    f = np.linspace(0.5, 120.0, 60)
    H = compute_frf(assemble(model), f, [(1, "x")], [(0, "x")], "receptance", method).H[:, 0, 0]
    s = 2j * np.pi * f
    np.testing.assert_allclose(H, 1 / (2e4 * formula(s) + mass * s**2), rtol=1e-10)


def test_a_tabulated_mount_has_the_tables_stiffness():
    """Z with the element, less Z without it, is K(ω) of the table, also between its frequencies."""
    model = mounted()
    (element,) = model.of_kind(TabulatedStiffness)
    system, without = assemble(model), assemble(model.without_effect("mount"))
    dofs, B = element.relative(model)
    for f, K in ((60.0, element.K[1]), (35.0, (element.K[0] + element.K[1]) / 2), (1e3, element.K[2])):
        extra = system.dynamic_stiffness(2 * np.pi * f) - without.dynamic_stiffness(2 * np.pi * f)
        full = (system.Q @ extra @ system.Q.T).toarray()
        # the structure's loss factor acts on the element's static stiffness as on any other
        static = system.model.damping.loss_factor * 1j * np.real(element.K[0])
        expected = np.zeros_like(full)
        expected[np.ix_(dofs, dofs)] = 1.1 * B.T @ (K + static) @ B
        expected = system.Q @ (system.Q.T @ expected @ system.Q) @ system.Q.T
        np.testing.assert_allclose(full, expected, atol=1e-8 * abs(expected).max())


@pytest.mark.parametrize("gradient_of", ["rubber", "mount"])
def test_engine_follows_laws_and_their_parameters(gradient_of):
    model = mounted()
    f = np.linspace(20.0, 400.0, 23)
    at = [(0, "z"), (1, "y"), (3, "x"), (8, "z")]
    columns, _ = dof_vectors(model, at)
    sides = [
        np.eye(model.n_dof)[:, model.effect(n).relative(model)[0]] for n in ("rubber", "mount", "spring")
    ]
    reduced = reduce_model(model, np.hstack([columns, *sides]), f[-1], margin=2.5, n_krylov=2)
    refs = [(gradient_of, p.name) for p in model.effect(gradient_of).parameters()]
    engine = ParametricFRF(reduced, columns, columns, f, refs)
    x = values_of(model, refs)
    H, dH, _ = engine.evaluate(x, np.zeros(f.size))
    direct = compute_frf(assemble(model), f, at, at, "receptance", "direct").H
    rms = np.sqrt((abs(direct) ** 2).mean())
    assert abs(H - direct).max() < 3e-5 * rms
    assert dH is not None
    for i, (_, name) in enumerate(refs):
        step = 1e-4 * x[i]

        def at_value(value, i=i):
            return engine.evaluate(np.where(np.arange(len(x)) == i, value, x), np.zeros(f.size), False)[0]

        near = (at_value(x[i] + step) - at_value(x[i] - step)) / (2 * step)
        far = (at_value(x[i] + 2 * step) - at_value(x[i] - 2 * step)) / (4 * step)
        bound = 2 * abs(far - near).max() + 1e-9 * abs(H).max() / step
        assert abs(dH[i] - near).max() <= bound, name


def test_a_candidate_law_is_scanned_as_it_is_fitted():
    """A viscoelastic element added by a low-rank update gives what a model with it gives."""
    model = mounted().without_effect("rubber")
    extra = mounted().effect("rubber")
    f = np.linspace(20.0, 400.0, 23)
    at = [(0, "z"), (1, "y")]
    columns, _ = dof_vectors(model, at)
    sides = [np.eye(model.n_dof)[:, model.effect(n).relative(model)[0]] for n in ("mount", "spring")]
    sides.append(np.eye(model.n_dof)[:, extra.relative(model)[0]])
    reduced = reduce_model(model, np.hstack([columns, *sides]), f[-1], margin=2.5, n_krylov=2)
    engine = ParametricFRF(reduced, columns, columns, f, [])
    (H,) = LocalChanges.of(engine, np.zeros(0), np.zeros(f.size)).receptances([extra])
    added = ParametricFRF(reduced, columns, columns, f, [], [extra])
    np.testing.assert_allclose(H, added.evaluate(np.zeros(0), np.zeros(f.size), False)[0], rtol=1e-7)


def test_a_rigid_link_is_a_rigid_joint_and_a_lever():
    ends = {"dependents": (1,), "point": 0}
    link = assemble(beam(4, 0.7, effects=(RigidLink(name="link", **ends),)))
    joint = Joint(name="j", point1=1, point2=0, location=np.array([0.7, 0, 0]), rigid=DIRECTIONS)
    other = assemble(beam(4, 0.7, effects=(joint,)))
    np.testing.assert_allclose(solve_modes(link, 12).frequency, solve_modes(other, 12).frequency, rtol=1e-9)
    u = link.Q @ np.random.default_rng(0).standard_normal(link.n_free)
    np.testing.assert_allclose(u[6:12], lever_matrix([0.7, 0, 0]) @ u[:6], atol=1e-12)


def test_points_tied_by_an_equation_move_as_it_says():
    tie = MultiPointConstraint(name="tie", terms=((0, "z", 2.0), (1, "ry", 0.5)))
    system = assemble(beam(3, effects=(tie,)))
    u = system.Q @ np.random.default_rng(0).standard_normal(system.n_free)
    assert 2 * u[2] + 0.5 * u[10] == pytest.approx(0, abs=1e-14)
    assert system.n_free == 6 * 4 - 1


def test_what_turns_a_joint_turns_its_stiffness():
    """A spring along an oblique axis holds a rigid mass as cos² of the angle says."""
    k = 5e4
    stiff = Joint(name="hold", point1=0, location=np.zeros(3), rigid=("y", "z", "rx", "ry", "rz"))
    spring = Joint(name="spring", point1=0, location=np.zeros(3), axes=TURNED, K=np.diag([k, 0, 0, 0, 0, 0]))
    model, mass = rigid_bar_on(stiff, spring)
    omega = solve_modes(assemble(model), 1).omega[0]
    assert omega == pytest.approx(np.sqrt(k * 0.6**2 / mass), rel=1e-12)


def test_a_joint_turned_with_its_directions_is_the_same_joint():
    """Rigid directions and matrices in axes that turn x into y are those of the other name."""
    quarter = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    plain = Joint(
        name="j",
        point1=1,
        location=np.array([1.0, 0, 0]),
        K=np.diag([0, 0, 0, 0, 7.0, 3.0]),
        rigid=("y", "z"),
    )
    # own x is global y, own y is global -x
    turned = replace(plain, axes=quarter, K=np.diag([0, 0, 0, 7.0, 0, 3.0]), rigid=("x", "z"))
    a, b = (solve_modes(assemble(beam(4, effects=(fix(0), j))), 8).frequency for j in (plain, turned))
    np.testing.assert_allclose(a, b, rtol=1e-12)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Joint(name="j", point1=0, location=np.zeros(3), axes=np.diag([1.0, 1, -1])), "right-handed"),
        (lambda: Joint(name="j", point1=0, location=np.zeros(3), axes=2 * np.eye(3)), "unit vectors"),
        (lambda: RigidLink(name="r", point=1, dependents=(1,)), "at least one other point"),
        (lambda: MultiPointConstraint(name="m", terms=()), "needs terms"),
        (lambda: MultiPointConstraint(name="m", terms=((0, "q", 1.0),)), "needs a direction"),
        (
            lambda: Viscoelastic(name="v", point1=0, location=np.zeros(3), K=np.eye(6), law=Zener(1.0, -1.0)),
            "tau is -1; it lies between",
        ),
        (
            lambda: TabulatedStiffness(
                name="t", point1=0, location=np.zeros(3), frequency=np.ones(1), K=np.ones((1, 3, 3))
            ),
            "is expected",
        ),
    ],
)
def test_what_cannot_be_is_refused(make, message):
    with pytest.raises(ModelError, match=message):
        make()


def test_an_equation_names_a_point_that_is_not_there():
    tie = MultiPointConstraint(name="tie", terms=((0, "z", 1.0), (99, "z", -1.0)))
    with pytest.raises(ModelError, match="refers to point 99, but the mesh has 2 points"):
        assemble(beam(1, effects=(tie,)))


def test_a_mass_on_rubber_between_two_bodies_moves_like_the_closed_form():
    """Two rigid bodies, one on the ground by a fractional mount, the other on the first by a Zener one."""
    mesh = Mesh.from_lines(
        [[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0], [0.3, 0, 0]], [[0, 1], [2, 3]], {"a": [0], "b": [1]}
    )
    frame = Frame(members={name: MemberProperties(STEEL, FLAT) for name in mesh.members})
    m = STEEL.rho * FLAT.A * 0.1
    low, _ = LAWS["fractional_kelvin_voigt"]
    high, _ = LAWS["zener"]
    K = np.diag([3e4, 1e6, 1e6, 1e4, 1e4, 1e4])
    model = Model(
        mesh,
        (
            frame,
            RigidLink(name="ra", point=0, dependents=(1,)),
            RigidLink(name="rb", point=2, dependents=(3,)),
            AddedMass(name="extra", point=3, mass=0.3),
            Viscoelastic(name="foot", point1=0, location=np.zeros(3), K=K, law=low),
            Viscoelastic(name="between", point1=1, point2=2, location=np.array([0.15, 0, 0]), K=K, law=high),
        ),
    )
    f = np.linspace(1.0, 150.0, 40)
    H = compute_frf(assemble(model), f, [(0, "x"), (3, "x")], [(3, "x")], "receptance").H[:, :, 0]
    s = 2j * np.pi * f
    k1, k2 = 3e4 * LAWS["fractional_kelvin_voigt"][1](s), 3e4 * LAWS["zener"][1](s)
    z1, z2 = k1 + k2 + m * s**2, k2 + (m + 0.3) * s**2
    np.testing.assert_allclose(H[:, 1], z1 / (z1 * z2 - k2**2), rtol=1e-9)
    np.testing.assert_allclose(H[:, 0], k2 / (z1 * z2 - k2**2), rtol=1e-9)
